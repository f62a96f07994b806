"""Sides of drawn movements whose prompts name another limb than the one that acts."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.drawn_sides import drawn_side
from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263

LAYOUT = HUMANML3D_263
KNEES, WRISTS = {"left": 4, "right": 5}, {"left": 20, "right": 21}


@pytest.mark.parametrize(
    ("prompt", "action", "side"),
    [
        ("kneels on the left knee", "kneel", "left"),
        ("goes down on his right knee", "kneel", "right"),
        ("kneels with the left knee up", "kneel", "right"),
        ("kneels, right foot flat on the floor", "kneel", "left"),
        ("kneels on both knees", "kneel", ""),
        ("draws a bow with the right hand", "draw-bow", "left"),
        ("pulls the string back with his left hand and shoots", "draw-bow", "right"),
        ("holds the bow in his left hand and shoots an arrow", "draw-bow", "left"),
        ("shoots an arrow, left arm extended", "draw-bow", "left"),
        ("a left-handed archer shoots an arrow", "draw-bow", "right"),
        ("shoots an arrow", "draw-bow", ""),
        ("wipes the counter with her right forearm", "wash", "right"),
        ("polishes the window with the left elbow", "wash", "left"),
        ("slashes with the sword in her left hand", "slash", "left"),
        ("wipes the left window", "wash", ""),
        ("waves with the left hand", "wave", None),
    ],
)
def test_the_side_of_a_drawn_movement_is_read(prompt: str, action: str, side: str | None) -> None:
    assert drawn_side(prompt, action) == side


@pytest.mark.parametrize("side", KNEES)
@pytest.mark.parametrize("seed", range(3))
def test_the_knee_that_is_named_is_on_the_floor(side: str, seed: int) -> None:
    drawn = drawn_whole(LAYOUT, "kneel", FineWish(side=side, prompt=f"kneels on the {side} knee"), seed, None)
    assert drawn is not None
    heights = LAYOUT.decode(drawn.features)[:, [KNEES[side], KNEES["right" if side == "left" else "left"]], 1]
    low = int(heights[:, 0].argmin())
    assert heights[low, 0] < 0.15
    assert heights[low, 1] > 0.35


@pytest.mark.parametrize("side", WRISTS)
@pytest.mark.parametrize("seed", range(3))
def test_the_arm_that_is_named_wipes(side: str, seed: int) -> None:
    prompt = f"wipes the table with the {side} arm"
    drawn = drawn_whole(LAYOUT, "wash", FineWish(side=side, prompt=prompt), seed, None)
    assert drawn is not None
    joints = LAYOUT.decode(drawn.features)
    way = {
        one: float(np.linalg.norm(np.diff(joints[:, wrist], axis=0), axis=-1).sum()) for one, wrist in WRISTS.items()
    }
    assert max(way, key=lambda one: way[one]) == side
