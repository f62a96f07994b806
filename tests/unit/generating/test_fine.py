"""Small movements that are drawn on a motion."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.fine import FINE, drawn_features
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.motion.rotations import from_rotvec, rotate
from marey.motion.skeleton import HUMANML3D
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES
from tests.support.bodies import Body, lift
from tests.support.drawn_motions import drawn_on

LAYOUT = HUMANML3D_263


RAISED = Body(5.0, right=lift(0.5, 5.0))
"""A body that lifts a hand and holds it still."""


def drawn(
    action: str, body: Body | None = None, count: int | None = None, seed: int = 1, prompt: str = ""
) -> np.ndarray[Any, Any]:
    body = body or (RAISED if action == "wave" else Body(5.0))
    return drawn_on(body.joints(), action, prompt, count=count, seed=seed)


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


def elbow_share(joints: np.ndarray[Any, Any]) -> float:
    """Return how fast the elbow moves beside the wrist, in the middle of the motion."""
    names = ("R_elbow", "R_wrist")
    elbow, wrist = (np.diff(joints[35:-10, HUMANML3D.index(name)], axis=0) for name in names)
    return float(np.median(np.linalg.norm(elbow, axis=-1)) / np.median(np.linalg.norm(wrist, axis=-1)))


def test_a_hand_that_is_held_up_waves() -> None:
    before = Motion(RAISED.joints(), 20.0)
    assert RULES["wave"](before, "") < 0.5 <= RULES["wave"](Motion(drawn("wave"), 20.0), "right")


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_a_hand_waves_as_often_as_asked_for(count: int) -> None:
    assert len(REPETITIONS["wave"](Motion(drawn("wave", count=count), 20.0))) == count


def test_an_elbow_that_swings_with_the_hand_comes_to_rest() -> None:
    joints, (shoulder, elbow, wrist) = RAISED.joints(), map(HUMANML3D.index, ("R_shoulder", "R_elbow", "R_wrist"))
    angle = np.radians(20) * np.sin(2 * np.pi * 2.0 * np.arange(len(joints)) / 20.0) * (np.arange(len(joints)) > 20)
    whole_arm = from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
    for joint in (elbow, wrist):
        joints[:, joint] = joints[:, shoulder] + rotate(whole_arm, joints[:, joint] - joints[:, shoulder])
    assert elbow_share(joints) > 0.45
    assert not FINE["wave"].is_well(joints, 20.0, FineWish())
    features = drawn_features(LAYOUT.encode(joints), LAYOUT, "wave", FineWish(), 1)
    assert features is not None
    made = LAYOUT.decode(features)
    assert elbow_share(made) < 0.3
    assert FINE["wave"].is_well(made, 20.0, FineWish())
    assert RULES["wave"](Motion(made, 20.0), "right") >= 0.5  # the hand still swings


def test_a_wave_that_swings_about_its_elbow_is_left_as_it_is() -> None:
    assert FINE["wave"].is_well(Body(5.0, right=lift(0.5, 5.0), wave=2.0).joints(), 20.0, FineWish())


def test_a_drawn_wave_moves_the_arm_alone_and_keeps_its_bones() -> None:
    made, before = drawn("wave"), LAYOUT.decode(LAYOUT.encode(RAISED.joints()))
    moved = np.linalg.norm(made - before, axis=-1).max(axis=0)
    assert {HUMANML3D.joint_names[j] for j in np.flatnonzero(moved > 0.005)} <= {"R_elbow", "R_wrist"}
    bones = np.linalg.norm(made[:, HUMANML3D.index("R_wrist")] - made[:, HUMANML3D.index("R_elbow")], axis=-1)
    assert np.ptp(bones) < 1e-3


@pytest.mark.parametrize("action", FINE)
def test_seeds_differ_and_equal_seeds_do_not(action: str) -> None:
    said = "vaults over a wall" if action == "climb-onto" else ""  # other climbs are the network's
    np.testing.assert_array_equal(drawn(action, prompt=said, seed=3), drawn(action, prompt=said, seed=3))
    first, other = drawn(action, prompt=said, seed=3), drawn(action, prompt=said, seed=4)
    assert first.shape != other.shape or np.abs(first - other).max() > 0.003


@pytest.mark.parametrize("action", FINE)
def test_nothing_is_drawn_on_a_motion_without_room(action: str) -> None:
    assert drawn_features(LAYOUT.encode(Body(1.0).joints()), LAYOUT, action, FineWish(), 1) is None
