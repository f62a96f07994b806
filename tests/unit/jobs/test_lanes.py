"""The order in which a worker tries the lanes of its queue."""

from __future__ import annotations

import re
from pathlib import Path
from uuid import uuid4

from marey.jobs.claim import _Lane, _preferred_first
from marey.jobs.policy import Policy


def lane(batch_key: str, *, waited: float = 0.0, running: int = 0) -> _Lane:
    return _Lane(uuid4(), batch_key, waited, running, limited=False, lonely=False)


def test_the_lane_of_the_loaded_bundle_comes_first() -> None:
    lanes = [lane("a"), lane("b"), lane("c")]
    assert [each.batch_key for each in _preferred_first(lanes, "b", Policy())] == ["b", "a", "c"]
    assert _preferred_first(lanes, None, Policy()) == lanes
    assert _preferred_first(lanes, "other", Policy()) == lanes


def test_a_lane_that_has_waited_too_long_keeps_its_place() -> None:
    rules = Policy()
    lanes = [lane("a", waited=rules.patience + 1), lane("b")]
    assert _preferred_first(lanes, "b", rules) == lanes


def test_a_busier_tenant_has_less_patience_of_the_others() -> None:
    rules = Policy()
    assert rules.tenant_patience < rules.patience
    waited = (rules.tenant_patience + rules.patience) / 2
    busy = [lane("a", waited=waited, running=1), lane("b", running=2)]
    calm = [lane("a", waited=waited, running=2), lane("b", running=2)]
    assert _preferred_first(busy, "b", rules) == busy
    assert _preferred_first(calm, "b", rules) == calm[::-1]


def test_the_guide_states_how_long_a_lane_waits_for_a_loaded_bundle() -> None:
    guide = Path(__file__).resolve().parents[3] / "docs" / "how-to" / "tenants.md"
    told = re.search(r"for (\d+) s at most,\s+or (\d+) s if", guide.read_text(encoding="utf-8"))
    assert told is not None
    assert tuple(map(float, told.groups())) == (Policy().patience, Policy().tenant_patience)
