"""Runs backward, from standing to standing."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.running_back import runs_back
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts
from marey.motion.skeleton import HUMANML3D
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps


def run(prompt: str, frames: int | None = None, seed: int = 1) -> np.ndarray:
    wish = FineWish(None, prompt=prompt, fixed=frames is not None)
    features = stated_features(LAYOUT, "walk-backward", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("prompt", "least"), [("jogs backwards", 1.5), ("jog back slowly", 1.2), ("a boy runs backward", 1.9)]
)
def test_it_is_faster_than_a_walk_and_both_feet_leave_the_floor(prompt: str, least: float, seed: int) -> None:
    joints = run(prompt, seed=seed)
    ways = np.gradient(joints[:, 0, 2]) * FPS
    assert -np.median(ways[20:-20]) > least
    assert not find_contacts(joints, HUMANML3D, FPS).any(1).all()
    assert RULES["walk-backward"](Motion(joints, FPS), "") >= SHOWN


def test_it_lasts_as_long_as_is_said() -> None:
    joints = run("jog backwards for four seconds", frames=80)
    assert len(joints) == 80
    assert np.linalg.norm(np.diff(joints[[0, -1], 0], axis=0)) > 4.0


@pytest.mark.parametrize(
    ("prompt", "form"),
    [
        ("jogs backwards", "jog"),
        ("sprints backward away from the dog", "run"),
        ("walks backwards", ""),
        ("runs backward in a circle", ""),
    ],
)
def test_other_ways_back_are_none(prompt: str, form: str) -> None:
    assert runs_back(prompt) == form
