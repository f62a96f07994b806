"""Parts of the API that need no server."""

from __future__ import annotations

from datetime import UTC, datetime
from uuid import uuid4

from hypothesis import given
from hypothesis import strategies as st

from marey.api.broadcaster import last_progress_only
from marey.http.ranges import parse_range
from marey.jobs import EventRow


@given(st.text("bytes=0123456789-, ", max_size=20), st.integers(0, 100))
def test_any_range_header_lies_inside_the_file_or_past_its_end(header: str, size: int) -> None:
    found = parse_range(header, size)
    if found is not None and found.start < size:
        assert found.length >= 1
        assert found.start + found.length <= size


def test_a_later_progress_event_makes_earlier_ones_stale_and_no_other() -> None:
    kinds = ["progress", "failed", "progress", "progress", "state"]
    job = uuid4()
    events = [EventRow(job, seq, kind, None, "", {}, datetime.now(UTC)) for seq, kind in enumerate(kinds, 1)]
    assert [event.seq for event in last_progress_only(events)] == [2, 4, 5]
