"""Swings of a bat."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.quality.measure import range_degrees

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
WRISTS, ANKLES = [20, 21], [7, 8]


def yaw_of(joints: np.ndarray, pair: tuple[int, int]) -> np.ndarray:
    """Degrees (T,) by which a line across the body has turned to its left."""
    across = joints[:, pair[0]] - joints[:, pair[1]]
    return np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))


@pytest.mark.parametrize(
    ("prompt", "way", "front"),
    [("swings a wooden bat at the ball", 1, 0), ("a left-handed batter swings the bat", -1, 1)],
)
@pytest.mark.parametrize("seed", range(3))
def test_the_hips_turn_before_the_shoulders_and_the_hands_are_fast(
    prompt: str, way: int, front: int, seed: int
) -> None:
    features = stated_features(LAYOUT, "idle", FineWish(prompt=prompt), None, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    hips, shoulders = way * yaw_of(joints, (1, 2)), way * yaw_of(joints, (16, 17))
    assert np.ptp(hips) > 70
    assert np.ptp(shoulders) > 110
    half = [int(np.argmax(np.gradient(each))) for each in (hips, shoulders)]
    assert half[0] <= half[1]
    speed = np.linalg.norm(np.diff(joints[:, WRISTS], axis=0), axis=-1) * FPS
    assert speed.max() > 5.8
    hit = int(speed.max(axis=1).argmax())
    apart = np.linalg.norm(joints[:, 20] - joints[:, 21], axis=-1)
    assert apart[hit - 8 : hit + 8].max() < 0.2, "both hands are on the bat"
    assert np.ptp(joints[:hit, ANKLES[front], 0]) > 0.12, "a stride"
    assert range_degrees(joints) < 15
