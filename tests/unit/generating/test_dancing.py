"""Dances by name: steps on counts, of a body that stays on the spot."""

from __future__ import annotations

import numpy as np
import pytest

from marey.drawing.dances import DANCES
from marey.generation.dancing import named_dance
from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, TOES = 0, [10, 11]
PROMPTS = {
    "salsa": "she does a salsa basic",
    "cha-cha": "a man dances the cha cha cha",
    "bachata": "bachata steps",
    "waltz": "an old couple waltzes",
    "hip-hop": "a hip-hop groove",
    "victory": "does a victory dance",
}


def drawn(prompt: str, *, seed: int = 1, frames: int | None = None) -> np.ndarray:
    wish = FineWish(prompt=prompt, fixed=frames is not None)
    features = stated_features(LAYOUT, "dance", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize("name", list(DANCES))
@pytest.mark.parametrize("seed", [1, 2])
def test_feet_step_in_turn_on_the_counts_and_the_body_stays(name: str, seed: int) -> None:
    joints = drawn(PROMPTS[name], seed=seed)
    assert named_dance(PROMPTS[name]) == name
    lifted = joints[:, TOES, 1] > joints[:, TOES, 1].min() + 0.02
    steps = (np.diff(lifted.astype(int), axis=0) == 1).sum()
    assert steps >= 0.7 * len(DANCES[name].steps)
    assert joints[:, TOES, 1].min(axis=1).max() < 0.04
    assert joints[..., 1].min() > -0.03
    assert np.abs(joints[-1, PELVIS] - joints[0, PELVIS]).max() < 0.12
    assert np.linalg.norm(np.diff(joints, n=2, axis=0), axis=-1).max() * FPS**2 < 160


def test_a_length_that_is_fixed_is_filled() -> None:
    joints = drawn(PROMPTS["salsa"], frames=180)
    assert len(joints) == 180
    moves = np.abs(np.diff(joints[:, PELVIS, 0])) * FPS > 0.05
    assert np.flatnonzero(moves)[-1] > 150


@pytest.mark.parametrize(
    "prompt",
    [
        "dances",
        "dances a tango",
        "eats chips with salsa",
        "a salsa turn",
        "dances hip hop",
        "waltzes across the room",
        "waltzes into the hall",
    ],
)
def test_others_are_no_basic_step(prompt: str) -> None:
    assert not named_dance(prompt)
