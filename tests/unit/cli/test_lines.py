"""A body of many lines is written once, read as often as it is sent, and gone afterwards."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from marey.client.lines import PIECE, Lines
from marey.core.errors import InvalidInput
from marey.core.spool import IN_MEMORY


@pytest.mark.parametrize("count", [1, 3, 2 * IN_MEMORY // 30])
def test_a_body_can_be_sent_again_from_its_beginning(count: int) -> None:
    objects = [{"prompt": f"a person walks {n} steps ü"} for n in range(count)]
    with Lines(iter(objects)) as lines:
        first, again = list(lines), list(lines)
        assert first == again
        assert len(lines) == sum(map(len, first))
        assert max(map(len, first)) <= PIECE
        assert [json.loads(line) for line in b"".join(first).splitlines()] == objects


def test_what_goes_wrong_while_objects_are_read_is_raised() -> None:
    def objects() -> Iterator[dict[str, str]]:
        yield {"prompt": "a person walks"}
        raise InvalidInput("line 2 is none")

    with pytest.raises(InvalidInput, match="line 2 is none"):
        Lines(objects())
