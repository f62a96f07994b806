"""Arms that stay raised in the turn behind."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.shots.raised_arms import guarded, kept_arms
from marey.motion.features import HUMANML3D_263, encode_all
from tests.support.bodies import Body

LAYOUT = HUMANML3D_263
TURN = encode_all(LAYOUT, Body(4.0).joints())


@pytest.mark.parametrize(("said", "wrists"), [("raises both arms", [20, 21]), ("raises his right hand", [21])])
@pytest.mark.parametrize("seed", [1, 2])
def test_raised_arms_stay_until_the_end_of_a_turn(said: str, wrists: list[int], seed: int) -> None:
    raises = drawn_whole(LAYOUT, "raise-arm", FineWish(prompt=said, beside=("", "turns")), seed, None)
    assert raises is not None
    kept = kept_arms(raises.features, TURN, LAYOUT)
    assert kept is not None
    assert len(kept.before) < len(raises.features)
    assert len(kept.after) == len(TURN)
    before, after = (LAYOUT.decode(each) for each in (kept.before, kept.after))
    high = after[:, wrists, 1] - after[:, :1, 1]
    assert (before[-1, wrists, 1] - before[-1, 0, 1]).min() > 0.3
    assert high[:-16].min() > 0.3
    assert high[-1].max() < 0.2


def test_arms_that_are_not_raised_are_left_alone() -> None:
    assert kept_arms(TURN, TURN, LAYOUT) is None


def test_feet_of_the_turn_stay_where_they_were() -> None:
    raises = drawn_whole(LAYOUT, "raise-arm", FineWish(prompt="raises both arms", beside=("", "turns")), 1, None)
    assert raises is not None
    kept = kept_arms(raises.features, TURN, LAYOUT)
    assert kept is not None
    feet = [LAYOUT.decode(each)[:, [7, 8, 10, 11]] for each in (kept.after, TURN)]
    assert np.abs(feet[0] - feet[1]).max() < 0.03


@pytest.mark.parametrize(
    ("action", "said"), [("block", "blocks"), ("punch", "throws a jab"), ("kick", "a boxer kicks")]
)
@pytest.mark.parametrize("follows", [True, False])
def test_the_guard_stays_up_in_the_steps_of_a_fight(action: str, said: str, *, follows: bool) -> None:
    beside = FineWish(prompt=said, beside=("", "steps back"))
    before = drawn_whole(LAYOUT, action, beside, 1, None)
    after = drawn_whole(LAYOUT, "punch", FineWish(prompt="throws a hook", beside=("steps back", "")), 1, None)
    assert before is not None
    assert after is not None
    kept = guarded(before.features, TURN, after.features if follows else None, LAYOUT)
    assert kept is not None
    assert len(kept.after) == len(TURN)
    steps = LAYOUT.decode(kept.after)
    assert (steps[:, [20, 21], 1] - steps[:, :1, 1]).min() > 0.2
    assert (LAYOUT.decode(kept.before)[-1, [20, 21], 1]).min() > 1.0


def test_who_has_no_guard_keeps_none() -> None:
    assert guarded(TURN, TURN, None, LAYOUT) is None
