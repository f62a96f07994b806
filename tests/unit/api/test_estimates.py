"""Words for what an estimate is based on."""

from __future__ import annotations

from datetime import UTC, datetime

from marey.api.jobs.estimates import basis_of
from marey.jobs.estimate_types import Estimate, Speed


def test_workers_are_counted_in_words() -> None:
    when = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)
    speed = Speed("tiny@1", 27, 1.113, when, when)
    basis = basis_of(Estimate(3, 3.3, {"one": 1, "two": 2, "none": 0}, (speed,), ()))
    assert basis.split("; ")[1:] == ["1 one worker", "2 two workers", "no live none worker: one assumed"]
