"""Small movements that are drawn on a motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.fine import FINE, drawn_features
from marey.motion.features import HUMANML3D_263
from marey.motion.skeleton import HUMANML3D
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES
from tests.support.bodies import Body

LAYOUT = HUMANML3D_263


def drawn(action: str, seconds: float = 5.0, count: int | None = None, seed: int = 1) -> np.ndarray[Any, Any]:
    features = drawn_features(LAYOUT.encode(Body(seconds).joints()), LAYOUT, action, count, seed)
    assert features is not None
    return LAYOUT.decode(features)


@pytest.mark.parametrize("count", [1, 2, 3, 6])
def test_nods_are_as_many_as_asked_for(count: int) -> None:
    assert len(REPETITIONS["nod"](Motion(drawn("nod", count=count), 20.0))) == count


def test_a_nod_moves_the_head_alone() -> None:
    made, before = drawn("nod"), LAYOUT.decode(LAYOUT.encode(Body(5.0).joints()))
    assert RULES["nod"](Motion(made, 20.0), "") >= 0.5
    moved = np.linalg.norm(made - before, axis=-1).max(axis=0)
    assert {HUMANML3D.joint_names[j] for j in np.flatnonzero(moved > 0.005)} == {"head"}
    bones = np.linalg.norm(made[:, HUMANML3D.index("head")] - made[:, HUMANML3D.index("neck")], axis=-1)
    assert np.ptp(bones) < 1e-3


def test_trembling_leaves_the_feet_where_they_stand() -> None:
    made, before = drawn("shiver"), LAYOUT.decode(LAYOUT.encode(Body(5.0).joints()))
    moved = np.linalg.norm(made - before, axis=-1).max(axis=0)
    assert moved[list(HUMANML3D.feet)].max() < 0.001
    wrist = (made - before)[:, HUMANML3D.index("L_wrist")]
    turns = np.abs(np.diff(np.sign(np.diff(wrist[20:-20] @ np.linalg.svd(wrist)[2][0])))).sum() / 2
    assert turns / ((len(wrist) - 40) / 20.0) >= 7  # two a swing


@pytest.mark.parametrize("action", FINE)
def test_seeds_differ_and_equal_seeds_do_not(action: str) -> None:
    np.testing.assert_array_equal(drawn(action, seed=3), drawn(action, seed=3))
    assert np.abs(drawn(action, seed=3) - drawn(action, seed=4)).max() > 0.003


@pytest.mark.parametrize("action", FINE)
def test_nothing_is_drawn_on_a_motion_without_room(action: str) -> None:
    assert drawn_features(LAYOUT.encode(Body(1.0).joints()), LAYOUT, action, None, 1) is None
