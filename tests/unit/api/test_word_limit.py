"""The limit on words that are parsed at once."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import Busy
from marey.text_service.limits import Ticket, WordLimit

LIMIT = 100


@given(st.lists(st.one_of(st.integers(1, 150), st.none()), max_size=40))
def test_words_in_flight_stay_within_the_limit_but_for_a_request_that_is_alone(steps: list[int | None]) -> None:
    limit, held = WordLimit(LIMIT), list[tuple[Ticket, int]]()
    for step in steps:
        if step is None:
            if held:
                ticket, _ = held.pop()
                ticket.release()
                ticket.release()  # a second one changes nothing
        else:
            fits = not held or limit.in_flight + step <= LIMIT
            try:
                held.append((limit.take(["walk " * (step - 1) + "walk"]), step))
            except Busy:
                assert not fits
            else:
                assert fits
        assert limit.in_flight == sum(words for _, words in held)


def test_a_request_that_fails_gives_its_share_back() -> None:
    limit = WordLimit(LIMIT)
    with pytest.raises(ZeroDivisionError), limit.take(["walk"]):
        _ = 1 / 0
    assert limit.in_flight == 0


def test_words_count_whatever_white_space_is_between_them() -> None:
    for space in " \n\t\u00a0\u3000":
        limit = WordLimit(LIMIT)
        with limit.take([space.join(["walk"] * 60)] * 2):
            assert limit.in_flight == 120
