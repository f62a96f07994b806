"""Blocks with both arms."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
HEAD, CHEST, WRISTS, ANKLES = 15, [16, 17], [20, 21], [7, 8]


@pytest.mark.parametrize(
    ("prompt", "low", "high"),
    [
        ("blocks with both forearms before her face", 0.08, 0.3),
        ("raises both arms high to block an overhead blow", 0.22, 0.5),
        ("crosses his arms to block", 0.02, 0.26),
        ("he guards his body with both arms, blocking", -0.2, 0.06),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_both_arms_go_up_from_a_guard_and_back(prompt: str, low: float, high: float, seed: int) -> None:
    features = stated_features(LAYOUT, "block", FineWish(prompt=prompt), None, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    up = joints[:, WRISTS, 1] - joints[:, CHEST, 1].mean(axis=1, keepdims=True)
    acts = np.abs(up - up[:1]).sum(axis=1).argmax()
    assert low < up[acts].min()
    assert up[acts].max() < high
    assert np.abs(up[-1] - up[0]).max() < 0.06, "it ends in the guard"
    assert np.ptp(joints[0, ANKLES, 2]) > 0.15, "in a stance"
    ahead = joints[acts, WRISTS, 2] - joints[acts, CHEST, 2].mean()
    assert ahead.min() > 0.1
    assert RULES["block"](Motion(joints, FPS), "") >= 0.5


def test_between_others_the_body_stands_before_and_after() -> None:
    wish = FineWish(prompt="blocks with both arms", beside=("walks up", "walks off"))
    features = stated_features(LAYOUT, "block", wish, None, 1)
    assert features is not None
    joints = LAYOUT.decode(features)
    assert joints[[0, -1]][:, WRISTS, 1].max() < 1.0


@pytest.mark.parametrize("prompt", ["blocks a blow", "blocks with the left arm", "a shield block", "parries high"])
def test_other_blocks_state_nothing(prompt: str) -> None:
    wish = FineWish(side="left" if "left" in prompt else "", prompt=prompt)
    assert stated_features(LAYOUT, "block", wish, None, 1) is None
