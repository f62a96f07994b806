"""Names of the segments of one file."""

from __future__ import annotations

import pytest

from marey.core.errors import InvalidFile
from marey.data.dataset import known_set, known_sets
from marey.data.index import parse_index, read_index
from marey.data.prepare import SETS

HEADER = "file,start,end\n"


def names(*lines: str) -> list[str]:
    return [row.id for row in parse_index(HEADER + "\n".join(lines), {}, "index.csv")]


def test_a_segment_is_named_by_its_start_and_by_its_end_where_two_begin_at_one() -> None:
    assert names("a.bvh,,", "b.bvh,,30", "b.bvh,30,60", "b.bvh,30,90") == ["a", "b@0", "b@30", "b@30-90"]


@pytest.mark.parametrize("lines", [("a.bvh,,", "a.bvh,,"), ("a.bvh,1,5", "a.bvh,1,9", "a.bvh,1,9")])
def test_one_segment_twice_is_refused(lines: tuple[str, ...]) -> None:
    with pytest.raises(InvalidFile, match="there are two clips"):
        names(*lines)


def test_every_index_of_a_known_set_can_be_read() -> None:
    read = [name for name in known_sets() if (SETS / name / "index.csv").is_file()]
    assert {"cmu", "g1_moves", "hdm05"} <= set(read)
    for name in read:
        assert read_index(SETS / name / "index.csv", known_set(name).model_copy(update={"columns": {}}))
