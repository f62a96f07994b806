"""Dodges that are drawn on a body that stands."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from marey.generation.calm import calm
from marey.generation.dodging import LOWEST, dodges_well
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.rules import RULES
from tests.support.bodies import Body, walker
from tests.support.drawn_motions import drawn_on

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
STANDS = Body(5.0).joints()
PELVIS, HEAD, FEET = 0, 15, [7, 8, 10, 11]


drawn = partial(drawn_on, STANDS)


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_head_goes_to_the_side_that_is_named_and_comes_back(side: str) -> None:
    joints = drawn("dodge", f"slips to the {side}", side=side, count=1)
    left = (joints[:, HEAD] - joints[0, HEAD])[:, 0]  # of a body that faces +Z
    far = left.max() if side == "left" else -left.min()
    assert far > 0.25
    assert np.abs(left[[0, -1]]).max() < 0.03
    assert np.abs(joints[:, FEET] - joints[0, FEET]).max() < 0.03
    assert RULES["dodge"](Motion(joints, FPS), side) >= 0.5


def test_a_duck_goes_down_and_stays_off_the_floor() -> None:
    joints = drawn("dodge", "ducks under a branch", count=1)
    assert joints[0, HEAD, 1] - joints[:, HEAD, 1].min() > 0.25
    assert joints[:, PELVIS, 1].min() > LOWEST - 0.05
    assert RULES["dodge"](Motion(joints, FPS), "") >= 0.5


def test_a_body_leans_back_from_a_blow() -> None:
    joints = drawn("dodge", "leans back", count=1)
    assert (joints[:, HEAD, 2] - joints[0, HEAD, 2]).min() < -0.2


@pytest.mark.parametrize("count", [1, 2])
def test_dodges_are_as_many_as_asked_for(count: int) -> None:
    joints = drawn("dodge", "slips aside", side="left", count=count)
    away = joints[:, HEAD, 0] - joints[0, HEAD, 0] > 0.15
    assert np.sum(away[1:] & ~away[:-1]) == count


def test_a_dodge_of_the_network_is_kept_where_the_feet_leave_their_place() -> None:
    assert dodges_well(STANDS, FPS, FineWish(prompt="jumps aside"))
    assert not dodges_well(STANDS, FPS, FineWish(prompt="dodges an attack"))


def test_a_body_that_walked_stands_in_place() -> None:
    joints = calm(walker(5.0).astype(np.float64), FPS, np.random.default_rng(0))
    assert len(joints) == len(walker(5.0))
    assert np.abs(joints[:, FEET] - joints[0, FEET]).max() < 1e-9
    assert np.abs(joints - joints.mean(0)).max() <= 0.03 + 1e-9
