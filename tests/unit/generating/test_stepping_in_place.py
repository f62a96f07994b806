"""Gaits in place: "jogs on the spot"."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.named import names_movement
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
KNEES, TOES = [4, 5], [10, 11]


def joints_of(action: str, prompt: str, seconds: float | None = None, seed: int = 1) -> np.ndarray | None:
    frames = None if seconds is None else round(seconds * FPS)
    features = stated_features(LAYOUT, action, FineWish(prompt=prompt, fixed=frames is not None), frames, seed)
    return None if features is None else LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize(
    ("action", "prompt", "knees"),
    [
        ("walk", "a nurse walks on the spot", (0.51, 0.6)),
        ("walk", "the cadets march in place", (0.7, 0.8)),
        ("run", "he trots on the spot", (0.49, 0.6)),
        ("run", "a keeper runs on the spot", (0.54, 0.66)),
        ("run", "jogs in one place with high knees", (0.7, 0.8)),
        ("sprint", "she sprints in place", (0.59, 0.7)),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_bodies_step_where_they_stand(action: str, prompt: str, knees: tuple[float, float], seed: int) -> None:
    joints = joints_of(action, prompt, seed=seed)
    assert joints is not None
    assert np.ptp(joints[:, 0, [0, 2]], axis=0).max() < 0.12
    assert np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]]) < 0.03
    heights = joints[:, KNEES, 1].max(axis=0)
    assert knees[0] < heights.min() <= heights.max() < knees[1]
    for moment in (joints[0], joints[-1]):
        assert np.ptp(moment[TOES, 1]) < 0.01, "it stands at both ends"
    contacts = find_contacts(joints, HUMANML3D, FPS)
    assert skate(joints, contacts, HUMANML3D, FPS) < 0.08
    lifted = joints[:, TOES, 1] > joints[:, TOES, 1].min(axis=0) + 0.04
    assert (np.diff(lifted.astype(int), axis=0) == 1).sum(axis=0).min() >= 3, "both feet step"


@pytest.mark.parametrize("seconds", [2.0, 6.0, 9.5])
def test_they_last_as_long_as_said(seconds: float) -> None:
    joints = joints_of("run", f"she jogs on the spot for {seconds:g} seconds", seconds)
    assert joints is not None
    assert len(joints) == round(seconds * FPS)
    assert np.abs(joints[-1, KNEES, 1] - joints[0, KNEES, 1]).max() < 0.04


def test_other_ways_are_left_to_networks() -> None:
    assert joints_of("run", "he runs past the spot") is None
    assert joints_of("sprint", "a girl sprints away") is None
    assert names_movement("he jogs on the spot")
    assert not names_movement("he jogs along the beach")
