"""Round kicks, and kicks of a ball out of a run-up."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.quality.measure import range_degrees
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
SEEDS = range(3)


def drawn(action: str, prompt: str, *, side: str = "", count: int | None = None, seed: int = 1) -> np.ndarray:
    features = stated_features(LAYOUT, action, FineWish(count, side, prompt), None, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def bend_of(joints: np.ndarray, leg: tuple[int, int, int]) -> np.ndarray:
    """Degrees (T,) between thigh and shin; 180 = straight."""
    hip, knee, ankle = (joints[:, one] for one in leg)
    a, b = hip - knee, ankle - knee
    return np.degrees(np.arccos((a * b).sum(-1) / np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)))


@pytest.mark.parametrize(("side", "leg"), [("left", (1, 4, 7)), ("right", (2, 5, 8))])
@pytest.mark.parametrize(
    ("prompt", "low", "high"),
    [("a roundhouse", 0.9, 1.2), ("roundhouse kick to the jaw", 1.3, 1.6), ("a low round kick", 0.4, 0.7)],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_round_kick_comes_from_the_side_with_a_straight_leg(
    side: str, leg: tuple[int, int, int], prompt: str, low: float, high: float, seed: int
) -> None:
    joints = drawn("kick", prompt, side=side, seed=seed)
    foot = joints[:, leg[2]]
    hit = foot[:, 2].argmax()
    assert low < foot[hit, 1] < high
    assert bend_of(joints, leg)[hit - 2 : hit + 3].max() > 145
    out = 1.0 if side == "left" else -1.0
    assert (out * (foot - joints[:, 0])[hit - 8 : hit + 1, 0]).max() > 0.25
    across = joints[:, 1] - joints[:, 2]
    turned = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    assert np.ptp(turned) > 55, "the hips turn into it"
    assert np.linalg.norm(np.diff(foot, axis=0), axis=-1).max() * FPS > 7.5
    assert range_degrees(joints) < 15
    assert RULES["kick"](Motion(joints, FPS), side) >= 0.5


def test_round_kicks_are_as_many_as_asked_for() -> None:
    joints = drawn("kick", "three roundhouse kicks", side="left", count=3)
    up = joints[:, 7, 1] > 0.8
    assert np.count_nonzero(np.diff(up.astype(int)) == 1) == 3


def test_a_punch_and_other_kicks_are_no_round_ones() -> None:
    for prompt in ("a side kick", "kicks the door in", "a front kick to the ribs", "kicks his leg round the chair"):
        assert stated_features(LAYOUT, "kick", FineWish(prompt=prompt), None, 1) is None


@pytest.mark.parametrize(("side", "foot", "other"), [("left", 7, 8), ("right", 8, 7)])
@pytest.mark.parametrize("prompt", ["steps up and takes a penalty", "boots it far", "shoots at the goal"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_hard_kick_of_a_ball_is_run_up_to(prompt: str, side: str, foot: int, other: int, seed: int) -> None:
    joints = drawn("kick-ball", prompt, side=side, seed=seed)
    speed = np.linalg.norm(np.diff(joints[:, foot], axis=0), axis=-1) * FPS
    hit = int(speed.argmax())
    assert speed[hit] > 8.0
    assert joints[hit, 0, 2] - joints[0, 0, 2] > 0.8, "it comes up to the ball"
    planted = joints[hit - 1 : hit + 2, other]
    assert np.ptp(planted, axis=0).max() < 0.03
    assert joints[hit:, foot, 1].max() > 0.6
    leg = (1, 4, 7) if side == "left" else (2, 5, 8)
    bend = bend_of(joints, leg)
    assert bend[hit : hit + 7].max() > bend[hit - 2 : hit + 1].min() + 50, "the knee extends"
    assert joints[:, [7, 8, 10, 11], 1].min(axis=1).max() < 0.12, "no flight"
    assert RULES["kick-ball"](Motion(joints, FPS), side) >= 0.5


def test_a_soft_kick_of_a_ball_needs_no_run_up() -> None:
    for prompt in ("passes the ball to a friend", "taps it gently", "kicks a ball", "kicks a little ball softly"):
        assert stated_features(LAYOUT, "kick-ball", FineWish(prompt=prompt), None, 1) is None
