"""Hops and jumps back or to a side."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.hopping import hops_away, jumps_away
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES

LAYOUT, FPS = HUMANML3D_263, HUMANML3D_263.fps


def moved(action: str, prompt: str, seed: int, side: str = "") -> tuple[np.ndarray, np.ndarray]:
    """Joints (T, 22, 3), and metres to the left and ahead from the first frame to the last."""
    drawn = drawn_whole(LAYOUT, action, FineWish(prompt=prompt, side=side), seed, None)
    assert drawn is not None
    assert drawn.exact
    joints = LAYOUT.decode(drawn.features)
    return joints, (joints[-1, 0] - joints[0, 0])[[0, 2]]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("action", "prompt", "side", "way"),
    [
        ("dodge", "hops back", "", (0, -1)),
        ("dodge", "jumps backward", "", (0, -1)),
        ("dodge", "leaps backward over a crate", "", (0, -1)),
        ("dodge", "quickly jumps to the left", "left", (1, 0)),
        ("jump", "jumps right", "right", (-1, 0)),
        ("hop", "hops to the left", "left", (1, 0)),
        ("hop", "hops backward on one leg", "", (0, -1)),
        ("hop", "a backward hop on the right foot", "right", (0, -1)),
    ],
)
def test_a_jump_goes_where_the_words_say(action: str, prompt: str, side: str, way: tuple[int, int], seed: int) -> None:
    joints, went = moved(action, prompt, seed, side)
    assert float(went @ np.array(way)) > 0.2
    assert abs(float(went @ np.array(way[::-1]))) < 0.1
    assert len(joints) / FPS < 4.5
    assert RULES[action](Motion(joints.astype(np.float64), FPS), side) >= 0.5


def test_as_many_jumps_as_are_asked_for() -> None:
    once, thrice = (moved("dodge", prompt, 1)[1][1] for prompt in ("hops back", "hops back three times"))
    assert thrice < 2 * once < 0


@pytest.mark.parametrize(
    "prompt", ["jumps back and forth", "jumps up and down", "jumps back onto his feet", "jumps", "hops side to side"]
)
def test_other_jumps_are_left(prompt: str) -> None:
    for draw in (jumps_away, hops_away):
        assert draw(FineWish(prompt=prompt), random.Random(1), None) is None


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("prompt", "side", "count"),
    [("hops forward on the left leg", "left", 4), ("jumps ahead on her right foot", "right", 2)],
)
def test_hops_ahead_stay_on_their_foot(prompt: str, side: str, count: int, seed: int) -> None:
    drawn = drawn_whole(LAYOUT, "hop", FineWish(count, side=side, prompt=prompt), seed, None)
    assert drawn is not None
    joints = LAYOUT.decode(drawn.features).astype(np.float64)
    assert joints[-1, 0, 2] - joints[0, 0, 2] == pytest.approx(0.41 * count, abs=0.1 * count)
    assert RULES["hop"](Motion(joints, FPS), side) >= 0.5
    assert len(REPETITIONS["hop"](Motion(joints, FPS))) == count


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(
    ("action", "prompt"),
    [
        ("hop", "hops ahead on his right leg"),
        ("hop", "hops sideways"),
        ("hop", "hops backward on one leg"),
        ("jump", "jumps far to the left"),
    ],
)
def test_hips_set_off_before_a_flight_and_arrive_after_it(action: str, prompt: str, seed: int) -> None:
    joints = moved(action, prompt, seed)[0].astype(np.float64)
    velocity = np.diff(joints[:, 0, [0, 2]], axis=0) * FPS
    assert np.linalg.norm(np.diff(velocity, axis=0), axis=1).max() < 0.7  # metres a second, gained in a frame
