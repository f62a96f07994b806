"""Planks, on hands, on forearms and on one side."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.quality.measure import range_degrees
from marey.vocabulary.bearing_words import stated_bearings

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
CHEST, ANKLES, SHOULDERS, WRISTS = 9, [7, 8], [16, 17], [20, 21]


def drawn(prompt: str, *, frames: int | None = None, beside: tuple[str, str] = ("", ""), seed: int = 1) -> np.ndarray:
    wish = FineWish(prompt=prompt, fixed=frames is not None, beside=beside)
    features = stated_features(LAYOUT, "idle", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def sag_of(joints: np.ndarray) -> np.ndarray:
    """Metres (T,) by which the hips are off the line from shoulders to ankles."""
    top, end = joints[:, SHOULDERS].mean(axis=1), joints[:, ANKLES].mean(axis=1)
    line = (end - top) / np.linalg.norm(end - top, axis=-1, keepdims=True)
    off = joints[:, 0] - top
    return np.linalg.norm(off - (off * line).sum(-1, keepdims=True) * line, axis=-1)


@pytest.mark.parametrize(
    ("prompt", "low", "high"),
    [
        ("she holds a plank", 0.25, 0.4),
        ("a straight-arm plank", 0.45, 0.6),
        ("a side plank on her right", 0.2, 0.6),
    ],
)
@pytest.mark.parametrize("frames", [70, 120, 200])
def test_a_straight_body_is_held_for_as_long_as_asked_for(prompt: str, low: float, high: float, frames: int) -> None:
    joints = drawn(prompt, frames=frames)
    assert len(joints) == frames
    assert sag_of(joints).max() < 0.1
    assert low < joints[:, SHOULDERS, 1].mean() < high
    assert np.ptp(joints[:, WRISTS + ANKLES], axis=0).max() < 0.02, "hands and feet stay"
    assert joints[:, [4, 5, 0], 1].min() > 0.05
    assert range_degrees(joints) < 15


def test_a_plank_on_one_side_is_on_the_arm_of_that_side() -> None:
    for side, wrist in (("left", 20), ("right", 21)):
        joints = drawn(f"holds a side plank on the {side}")
        assert joints[:, wrist, 1].max() < 0.1
        assert joints[:, 41 - wrist, 1].min() > 0.3


def test_between_others_a_body_goes_down_into_it_and_gets_up() -> None:
    joints = drawn("drops into a plank", beside=("walks to the mat", "walks away"))
    assert joints[0, 0, 1] > 0.85
    assert joints[-1, 0, 1] > 0.85
    assert joints[:, 0, 1].min() < 0.35
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.3


@pytest.mark.parametrize(
    ("prompt", "asked"),
    [
        ("plank for thirty seconds", True),
        ("he gets into a plank position", True),
        ("performs a forearm plank", True),
        ("planking on the mat", True),
        ("keeps a perfect plank", True),
        ("walks the plank", False),
        ("holds a plank of oak", False),
        ("carries two planks", False),
        ("does plank push-ups", False),
        ("starts in a plank and does push-ups", False),
        ("nails a plank to the fence", False),
    ],
)
def test_words_of_a_plank_are_those_of_the_exercise(prompt: str, asked: bool) -> None:
    assert any(each.name == "plank" for each in stated_bearings(prompt)) == asked
