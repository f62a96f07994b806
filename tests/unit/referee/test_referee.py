"""The referee on bodies whose movement is known, and what its verdicts may not depend on."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.skeleton import HUMANML3D
from marey.referee import RULES, Body, shows, shows_in_order
from marey.referee.body import runs, swings
from marey.vocabulary.entries import load_vocabulary
from tests.unit.referee.bodies import FPS, Joints, arm_to, body, seconds, standing, tipped, walking


def test_every_action_of_the_vocabulary_has_a_rule_and_no_other() -> None:
    assert set(RULES) == set(load_vocabulary().actions)


def _hanging(length: float) -> Joints:
    return np.tile([0.08, -0.5, 0.05], (len(seconds(length)), 1))


def _between(low: Joints, high: Joints, share: Joints) -> Joints:
    return low + (np.asarray(high) - low) * share[:, None]


def _waving(*, forearm: bool = True) -> Joints:
    time = seconds(4.0)
    up = np.clip(time - 0.5, 0, 1) * np.clip(3.9 - time, 0, 1)
    hand = _between(_hanging(4.0), np.array([0.2, 0.3, 0.1]), np.minimum(up, 1))
    still = arm_to(standing(4.0), "L", hand)
    if forearm:
        swing = 0.15 * np.sin(2 * np.pi * 2 * time) * (up >= 1)
        still[:, HUMANML3D.index("L_wrist"), 0] += swing
        return still
    hand[:, 0] += 0.15 * np.sin(2 * np.pi * 2 * time) * (up >= 1)
    return arm_to(standing(4.0), "L", hand)


def _raising() -> Joints:
    time = seconds(4.0)
    share = np.clip(time - 0.5, 0, 1)
    return arm_to(standing(4.0), "L", _between(_hanging(4.0), np.array([0.1, 0.5, 0.05]), share))


def _bowing() -> Joints:
    return tipped(standing(3.0), 45 * np.sin(np.pi * np.clip((seconds(3.0) - 0.5) / 2, 0, 1)))


def _jumping() -> Joints:
    joints, time = standing(2.5), seconds(2.5)
    air = np.clip((time - 1.0) / 0.5, 0, 1)
    joints[..., 1] += (1.2 * air * (1 - air))[:, None]
    return joints


CASES = {
    "idle": (standing(3.0), {"idle"}, {"walk", "run", "wave", "bow", "jump", "sit", "raise-arm"}),
    "walk": (walking(4.0, 1.3), {"walk"}, {"idle", "run", "walk-backward", "turn", "jump", "bow"}),
    "walk backward": (walking(4.0, -0.8), {"walk-backward"}, {"walk", "run", "idle"}),
    "run": (walking(4.0, 3.2, cadence=2.8, flight=0.15), {"run"}, {"walk", "idle", "sit"}),
    "wave": (_waving(), {"wave"}, {"idle", "walk", "bow", "jump", "sit"}),
    "raise": (_raising(), {"raise-arm"}, {"wave", "bow", "walk", "jump"}),
    "bow": (_bowing(), {"bow"}, {"idle", "walk", "jump", "wave"}),
    "jump": (_jumping(), {"jump"}, {"walk", "bow", "jump-forward", "sit"}),
}


@pytest.mark.parametrize("name", CASES)
def test_a_movement_shows_its_action_and_not_others(name: str) -> None:
    joints, shown, not_shown = CASES[name]
    found = {action for action in RULES if shows(action, body(joints))}
    assert shown <= found
    assert not found & not_shown


@given(
    name=st.sampled_from(sorted(CASES)),
    yaw=st.floats(-180, 180),
    x=st.floats(-5, 5),
    z=st.floats(-5, 5),
    size=st.floats(0.6, 1.2),
)
@settings(max_examples=40, deadline=None)
def test_verdicts_depend_neither_on_place_and_heading_nor_on_the_size_of_the_body(
    name: str, yaw: float, x: float, z: float, size: float
) -> None:
    joints, shown, not_shown = CASES[name]
    angle = np.deg2rad(yaw)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    moved = Body((joints @ turn.T) * size + [x, 0, z], FPS)
    assert all(shows(action, moved) for action in shown)
    assert not any(shows(action, moved) for action in not_shown)


@pytest.mark.parametrize("name", CASES)
def test_a_mirrored_movement_shows_the_same_action(name: str) -> None:
    joints, shown, not_shown = CASES[name]
    mirrored = body(joints[:, list(HUMANML3D.mirror)] * [-1.0, 1.0, 1.0])
    assert all(shows(action, mirrored) for action in shown)
    assert not any(shows(action, mirrored) for action in not_shown)


def _showing() -> Joints:
    """Lift the straight left arm to the side and hold it there; the right one hangs."""
    share = np.clip(seconds(3.0) - 0.5, 0, 1)
    return arm_to(standing(3.0), "L", _between(_hanging(3.0), np.array([0.5, -0.1, 0.1]), share))


def _dancing() -> Joints:
    """Swing both arms and step from side to side for five seconds."""
    time = seconds(5.0)
    joints = standing(5.0)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        hand = np.array([sign * 0.3, 0.0, 0.25]) + 0.25 * np.sin(2 * np.pi * time)[:, None] * [1.0, 1.0, 0.0]
        joints = arm_to(joints, side, hand)
    joints[..., 0] += (0.3 * np.sin(np.pi * time))[:, None]
    return joints


def test_a_loop_of_two_steps_is_a_walk() -> None:
    assert shows("walk", body(walking(1.5, 1.3)))


def test_an_arm_that_shows_the_way_rises_and_stays_while_the_other_hangs() -> None:
    assert shows("guide", body(_showing()))
    assert not shows("guide", body(_showing()[50:]))  # held all the time, as a spear is
    assert not shows("guide", body(_waving()))


def test_a_wave_is_of_the_forearm() -> None:
    assert shows("wave", body(_waving()))
    assert not shows("wave", body(_waving(forearm=False)))


@pytest.mark.parametrize(
    "action", ["talk", "signal", "block", "cast-spell", "dodge", "flinch", "shoot", "wave", "slash"]
)
def test_a_dance_is_no_single_gesture(action: str) -> None:
    assert shows("dance", body(_dancing()))
    assert not shows(action, body(_dancing()))


@pytest.mark.parametrize("name", ["walk", "run", "bow", "wave"])
@pytest.mark.parametrize("action", ["dodge", "flinch", "kick-ball", "shoot", "block", "dance", "fight-stance"])
def test_rules_of_combat_do_not_pass_everyday_movements(name: str, action: str) -> None:
    assert not shows(action, body(CASES[name][0]))


def test_several_actions_are_looked_for_in_their_order() -> None:
    first, second = _bowing(), _waving()
    both = body(np.concatenate([first, second]))
    assert shows_in_order(["bow", "wave"], both)
    assert not shows_in_order(["wave", "bow"], both)
    assert not shows_in_order(["bow", "jump"], both)


@pytest.mark.parametrize("joints", [np.zeros((9, 21, 3)), np.zeros((2, 22, 3)), np.full((9, 22, 3), np.nan)])
def test_what_is_no_motion_is_refused(joints: Joints) -> None:
    with pytest.raises(InvalidInput):
        Body(joints, FPS)


def test_an_unknown_action_is_refused_with_the_known_ones() -> None:
    with pytest.raises(InvalidInput, match="unknown action 'fly-away'; known: aim, arabesque"):
        shows("fly-away", body(standing(1.0)))


@given(st.lists(st.floats(-1, 1), min_size=1, max_size=60), st.floats(0.05, 1))
def test_swings_are_as_large_as_asked_and_alternate(values: list[float], size: float) -> None:
    found = swings(np.array(values), size)
    signs = [np.sign(values[b] - values[a]) for a, b in found]
    assert all(abs(values[b] - values[a]) >= size for a, b in found)
    assert all(a != b for a, b in pairwise(signs))
    if max(values) - min(values) >= size:
        assert found


@given(st.lists(st.booleans(), max_size=40))
def test_runs_hold_every_true_frame_once(mask: list[bool]) -> None:
    covered = [frame for begin, end in runs(np.array(mask, np.bool_)) for frame in range(begin, end)]
    assert covered == [frame for frame, value in enumerate(mask) if value]
