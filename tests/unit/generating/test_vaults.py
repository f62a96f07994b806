"""Vaults over walls: on the hands, the legs at one side."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.quality.measure import range_degrees, self_contact
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
WRISTS, ANKLES = [20, 21], [7, 8]
SEEDS = range(4)


def vaulted(prompt: str, seed: int) -> np.ndarray | None:
    drawn = drawn_whole(LAYOUT, "climb-onto", FineWish(prompt=prompt), seed, None)
    return None if drawn is None else LAYOUT.decode(drawn.features).astype(np.float64)


@pytest.mark.parametrize("prompt", ["she vaults a garden wall", "vaulting over the gate", "leaps over it on one hand"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_body_passes_over_a_wall_on_its_hands(prompt: str, seed: int) -> None:
    joints = vaulted(prompt, seed)
    assert joints is not None
    assert RULES["climb-onto"](Motion(joints, FPS), "") >= 0.5
    over = np.flatnonzero(joints[:, ANKLES, 1].min(axis=1) > 0.7)
    assert 0.2 <= len(over) / FPS <= 0.8
    still = np.linalg.norm(np.diff(joints[:, WRISTS], axis=0), axis=-1) * FPS < 0.5
    leans = still & (np.abs(joints[1:, WRISTS, 1] - 0.98) < 0.1)
    assert leans[over[0] - 5 : over[-1]].any(axis=1).sum() >= 4, "a hand stays on the wall while the body passes"
    assert joints[:, 0, 1].max() < 1.3
    far = joints[-1, 0, 2] - joints[0, 0, 2]
    assert 2.0 < far < 4.5
    assert self_contact(joints) < 0.06
    assert range_degrees(joints) < 15


@pytest.mark.parametrize(("side", "way"), [("left", 1), ("right", -1)])
def test_the_legs_go_to_the_side_that_is_named(side: str, way: int) -> None:
    joints = vaulted(f"vaults the barrier with his legs swinging to the {side}", 2)
    assert joints is not None
    high = joints[:, ANKLES, 1].min(axis=1).argmax()
    assert way * (joints[high, ANKLES, 0].mean() - joints[high, 0, 0]) > 0.15


@pytest.mark.parametrize(
    "prompt",
    [
        "climbs over a wall",
        "vaults onto the platform",
        "a pole vault over the bar",
        "clambers out of a window",
        "mantle",
    ],
)
def test_other_climbs_stay_as_the_network_makes_them(prompt: str) -> None:
    assert vaulted(prompt, 1) is None
