"""Parts of live streams' sockets that need no server."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.api.streams.accept import first_frame, key_of
from marey.api.streams.backpressure import BEHIND_FRAMES, LagTracker
from marey.api.streams.messages import MessageRateLimit
from marey.api.streams.socket_writer import close_code
from marey.core.errors import Busy, InvalidInput, MareyError, NotFound, Refused, Unauthenticated, Unreachable


def test_a_header_wins_over_a_subprotocol_and_another_scheme_is_no_key() -> None:
    offered = ["marey.stream.v1", "marey.key.two"]
    assert key_of("Bearer one", offered) == "one"
    assert key_of("bearer  one ", []) == "one"
    assert key_of(None, offered) == "two"
    assert key_of("Basic eDp5", offered) == "two"
    assert key_of("Basic eDp5", ["marey.stream.v1"]) is None
    assert key_of(None, []) is None


@given(st.text("0123456789", max_size=12) | st.text(max_size=30))
def test_what_is_no_number_of_a_frame_is_an_invalid_input(text: str) -> None:
    if text.isascii() and text.isdigit() and int(text) < 2**32:
        assert first_frame(text) == int(text)
    else:
        with pytest.raises(InvalidInput, match="from"):
            first_frame(text)


def test_a_client_that_catches_up_is_not_slow_and_one_that_falls_behind_is() -> None:
    lag = LagTracker()
    assert not any(lag.is_falling_behind(behind) for behind in (1200, 1210, 900, 500, 530, 20, 20 + BEHIND_FRAMES))
    assert lag.is_falling_behind(20 + BEHIND_FRAMES + 1)
    lag.caught_up()
    assert not lag.is_falling_behind(BEHIND_FRAMES)
    assert lag.is_falling_behind(BEHIND_FRAMES + 1)


def test_a_rate_lets_a_second_of_messages_through_at_once_and_then_as_many_a_second() -> None:
    rate = MessageRateLimit(20)
    start = rate._at
    assert [rate.allows(start) for _ in range(21)] == [True] * 20 + [False]
    assert not rate.allows(start + 0.04)
    assert rate.allows(start + 0.06)
    assert sum(rate.allows(start + 100) for _ in range(30)) == 20


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (Unauthenticated("x"), 4401),
        (Refused("x"), 4403),
        (NotFound("x"), 4404),
        (InvalidInput("x"), 4422),
        (Busy("x", seconds=1), 1013),
        (Unreachable("x"), 1013),
    ],
)
def test_a_close_code_is_the_status_or_asks_to_come_later(error: MareyError, code: int) -> None:
    assert close_code(error) == code
