"""Motions that end with their action."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from marey.generation.ends import STEP_S, STILL_M, ended
from marey.generation.flights import UP_M, lowest_foot
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, runner, walker
from tests.unit.generating.test_flights import jumper

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps


def test_a_jump_ends_on_the_floor() -> None:
    features = LAYOUT.encode(jumper(0.3, 0.6, after_s=0.0)[: -round(0.2 * FPS)])
    ends = ended(features, LAYOUT, "jump")
    assert ends is not None
    assert lowest_foot(LAYOUT.decode(ends))[-1] < UP_M
    np.testing.assert_array_equal(ends, features[: len(ends)])


def kneeling(rises: float) -> np.ndarray:
    """Return joints of a body that goes down by half a metre, stays, and at its end rises by so many metres."""
    joints = Body(5.0).joints()
    time = np.arange(len(joints)) / FPS
    joints[..., 1] -= 0.5 * np.clip(time, 0, 1)[:, None]
    joints[..., 1] += rises * np.clip((time - 4.5) / 0.5, 0, 1)[:, None]
    joints[..., 1] += 0.5
    return joints


def test_a_body_that_knelt_down_does_not_begin_to_rise() -> None:
    features = LAYOUT.encode(kneeling(0.25))
    ends = ended(features, LAYOUT, "kneel")
    assert ends is not None
    height = LAYOUT.decode(ends)[:, 0, 1]
    assert height[-1] < height[-round(FPS) :].min() + STILL_M
    assert len(ends) / FPS == pytest.approx(4.5, abs=0.3)


@pytest.mark.parametrize(("rises", "action"), [(0.0, "kneel"), (0.25, "squat"), (0.25, "stand-up"), (0.03, "sit")])
def test_others_stay_as_long_as_they_are(rises: float, action: str) -> None:
    assert ended(LAYOUT.encode(kneeling(rises)), LAYOUT, action) is None


def test_no_more_than_its_end_is_left_out() -> None:
    features = LAYOUT.encode(jumper(0.3, 3.0, before_s=1.0, after_s=0.0))
    assert ended(features, LAYOUT, "jump") is None


@pytest.mark.parametrize("count", range(64, 80, 3))
@pytest.mark.parametrize(("action", "body"), [("walk", walker), ("run", runner)])
def test_ways_end_on_a_settled_step(action: str, body: Callable[..., np.ndarray], count: int) -> None:
    features = LAYOUT.encode(body(4.0))[:count]
    ends = ended(features, LAYOUT, action)
    kept = features if ends is None else ends
    assert len(features) - len(kept) <= STEP_S * FPS
    np.testing.assert_array_equal(kept, features[: len(kept)])
    toes = LAYOUT.decode(kept)[-1, [10, 11], 1]
    assert (toes.max() if action == "walk" else toes.min()) < 0.05


def test_ways_that_end_in_mid_stride_are_shorter_and_no_others() -> None:
    features = LAYOUT.encode(walker(4.0))
    ends = [ended(features[:count], LAYOUT, "walk") for count in range(60, 80)]
    assert any(each is None for each in ends)
    assert any(each is not None for each in ends)
    assert all(ended(features[:count], LAYOUT, "dance") is None for count in range(60, 80))
