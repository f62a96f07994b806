"""Bodies that drop to both knees at once, alone and as rows of a sequence."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.kneeling import drops
from marey.generation.row_postures import row_postures
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, KNEES, TOES = 0, [4, 5], [10, 11]


def drawn(prompt: str, *, seed: int = 1, frames: int | None = None) -> np.ndarray:
    wish = FineWish(prompt=prompt, fixed=frames is not None)
    features = stated_features(LAYOUT, "kneel", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def seconds_down(joints: np.ndarray) -> float:
    """Seconds from the first knee that has begun to sink until both are on the floor."""
    knees = joints[:, KNEES, 1]
    begins = np.flatnonzero(knees.min(axis=1) < knees[0].min() - 0.03)[0]
    return float(np.flatnonzero(knees.max(axis=1) < 0.1)[0] - begins) / FPS


@pytest.mark.parametrize(
    ("prompt", "least", "most"),
    [
        ("a knight drops to both knees", 0.25, 0.8),
        ("her knees buckle", 0.25, 0.8),
        ("the boy collapsed onto his knees", 0.25, 0.8),
        ("she slowly sinks to her knees", 0.5, 1.3),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_both_knees_come_down_at_once_and_stay(prompt: str, least: float, most: float, seed: int) -> None:
    joints = drawn(prompt, seed=seed)
    assert least <= seconds_down(joints) <= most
    down = np.flatnonzero(joints[:, KNEES, 1].max(axis=1) < 0.1)[0]
    assert joints[down + 2 :, KNEES, 1].max() < 0.12
    assert joints[..., 1].min() > -0.03
    assert np.abs(joints[-1, TOES] - joints[0, TOES]).max() < 0.08
    assert np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1).max() * FPS**2 < 160


def test_a_length_that_is_fixed_is_kept() -> None:
    assert len(drawn("falls to his knees", frames=90)) == 90


@pytest.mark.parametrize(
    "text",
    [
        "kneels down",
        "goes down on one knee",
        "drops to one knee",
        "bends the knees",
        "falls and hurts one knee",
        "drops the box on his knees",
    ],
)
def test_others_kneel_or_do_something_else(text: str) -> None:
    assert not drops(text)


def test_a_row_that_drops_comes_to_its_knees_by_itself_and_goes_on_from_there() -> None:
    drop, raises = row_postures([("kneel", "drops to his knees"), ("raise-arm", "raises his hands")], 1)
    assert (drop.own, drop.falls, drop.is_drawn, drop.goes_on) == ("knees", True, False, True)
    assert raises.begin == "knees"
    kneels = row_postures([("kneel", "kneels down"), ("raise-arm", "raises his hands")], 1)[0]
    assert (kneels.falls, kneels.is_drawn) == (False, True)
