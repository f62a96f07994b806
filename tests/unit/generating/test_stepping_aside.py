"""Steps to a side: single ones, and those of some seconds."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.named import names_movement
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263

LAYOUT = HUMANML3D_263


def aside(prompt: str, side: str, frames: int | None = None, seed: int = 1) -> np.ndarray | None:
    wish = FineWish(side=side, prompt=prompt, fixed=frames is not None)
    features = stated_features(LAYOUT, "sidestep", wish, frames, seed)
    return None if features is None else LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    "prompt",
    [
        "a fast sidestep to the left",
        "she steps left",
        "takes a step to the left",
        "steps to his left",
        "one side step left",
    ],
)
def test_a_single_step_is_one(prompt: str, seed: int) -> None:
    joints = aside(prompt, "left", seed=seed)
    assert joints is not None
    assert 0.4 < joints[-1, 0, 0] - joints[0, 0, 0] < 0.8


def test_steps_fill_the_seconds_that_are_stated() -> None:
    joints = aside("strafes right for four seconds", "right", frames=80)
    assert joints is not None
    assert len(joints) == 80
    assert joints[-1, 0, 0] - joints[0, 0, 0] < -1.5


@pytest.mark.parametrize("prompt", ["strafes left", "keeps stepping to the left", "steps from side to side"])
def test_ways_on_and_on_are_left_to_networks(prompt: str) -> None:
    assert aside(prompt, "left") is None


@pytest.mark.parametrize(
    ("prompt", "action", "left", "ahead"),
    [
        ("walks diagonally forward to the left, 4 steps", "sidestep", 1, 1),
        ("steps diagonally forward to the right", "sidestep", -1, 1),
        ("steps forward-right three times", "walk", -1, 1),
        ("walks diagonally backward to the left", "walk-backward", 1, -1),
    ],
)
def test_diagonal_steps_go_as_far_ahead_as_aside(prompt: str, action: str, left: int, ahead: int) -> None:
    wish = FineWish(side="left" if left > 0 else "right", prompt=prompt)
    features = stated_features(LAYOUT, action, wish, None, 1)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    gone = joints[-1, 0] - joints[0, 0]
    assert left * gone[0] > 0.6
    assert ahead * gone[2] == pytest.approx(left * gone[0], rel=0.15)
    assert names_movement(prompt)
