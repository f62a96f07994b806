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
from tests.unit.referee.bodies import FPS, LEGS, Joints, arm_to, body, seconds, standing, tipped, walking


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


# -- rules by the definitions of their actions -------------------------------------------------------------------------

_BELOW = np.array([0.12, -0.3, 0.2])  # a hand before the belly, from its shoulder


def _both_hands(length: float, hand: Joints) -> Joints:
    """Put both wrists at (T, 3) offsets from their shoulders; sideways is outward."""
    joints = arm_to(standing(length), "L", np.broadcast_to(hand, (len(seconds(length)), 3)))
    return arm_to(joints, "R", np.broadcast_to(hand * [-1.0, 1.0, 1.0], (len(seconds(length)), 3)))


def _talking(size: float) -> Joints:
    """Move both hands before the belly by `size` metres to each side, 1.5 times a second."""
    swing = size * np.sin(2 * np.pi * 1.5 * seconds(4.0))[:, None] * [0.6, 0.8, 0.0]
    return _both_hands(4.0, _BELOW + swing)


def test_who_talks_makes_small_gestures_with_the_hands() -> None:
    assert shows("talk", body(_talking(0.06)))
    assert not shows("talk", body(_talking(0.005)))  # holds the hands still
    assert not shows("talk", body(_talking(0.3)))
    assert not shows("talk", body(_waving()))


def test_who_shivers_trembles_all_the_time_with_the_hands_before_the_body() -> None:
    shake = 0.008 * np.sin(2 * np.pi * 5 * seconds(3.0))[:, None] * [1.0, 0.0, 0.0]
    assert shows("shiver", body(_both_hands(3.0, np.array([-0.1, -0.25, 0.25]) + shake)))
    assert not shows("shiver", body(_both_hands(3.0, np.array([0.08, -0.5, 0.05]) + shake)))  # the arms hang
    brief = np.concatenate([shake[:45], np.zeros((135, 3))])
    assert not shows("shiver", body(_both_hands(6.0, np.array([-0.1, -0.25, 0.25]) + brief)))


_AHEAD = np.array([-0.1, -0.1, 0.5])


def test_who_reaches_comes_back_and_who_aims_stays() -> None:
    time = seconds(3.0)
    out = np.clip((time - 0.5) * 2, 0, 1)
    reaching = arm_to(standing(3.0), "R", _between(_hanging(3.0), _AHEAD, out * np.clip((2.5 - time) * 2, 0, 1)))
    aiming = arm_to(standing(3.0), "R", _between(_hanging(3.0), _AHEAD, out))
    assert shows("reach-forward", body(reaching))
    assert not shows("reach-forward", body(aiming))
    assert shows("aim", body(aiming))
    assert not shows("aim", body(_showing()))  # to the side


def test_ahead_is_where_the_chest_faces() -> None:
    aiming = arm_to(standing(3.0), "R", _between(_hanging(3.0), _AHEAD, np.clip(seconds(3.0) * 2, 0, 1)))
    angle = np.deg2rad(55)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    upper = [i for i, name in enumerate(HUMANML3D.joint_names) if name.split("_")[-1] not in LEGS]
    aiming[:, upper] = aiming[:, upper] @ turn.T
    assert shows("aim", body(aiming))


def _striking(begin: Joints, end: Joints, side: str = "R") -> Joints:
    """Hold a hand at `begin`, bring it to `end` within 0.15 s and hold it there."""
    way = _between(np.tile(begin, (60, 1)), end, np.clip((seconds(2.0) - 1) / 0.15, 0, 1))
    return arm_to(standing(2.0), side, way)


def test_a_punch_is_driven_out_by_the_elbow() -> None:
    assert shows("punch", body(_striking(np.array([-0.02, -0.1, 0.12]), np.array([0.0, 0.0, 0.5]))))
    assert not shows("punch", body(_striking(np.array([-0.1, -0.48, 0.0]), np.array([0.0, 0.0, 0.5]))))  # swings up


@pytest.mark.parametrize(("side", "inward"), [("L", -0.1), ("R", 0.1)])
def test_a_fist_that_rises_past_the_face_strikes_with_a_bent_elbow(side: str, inward: float) -> None:
    low, chest, head = np.array([0.0, -0.25, 0.2]), np.array([inward, -0.05, 0.33]), np.array([inward, 0.2, 0.3])
    uppercut = body(_striking(low, head, side))
    assert np.ptp(uppercut.bend(side, "elbow")) < 40
    assert shows("punch", uppercut)
    assert not shows("punch", body(_striking(low, chest, side)))  # stops under the chin
    assert not shows("punch", body(_striking(np.array([inward, 0.0, 0.12]), head, side)))  # is at the chin before


def test_a_strike_is_no_dodge() -> None:
    lean = 30 * np.clip((seconds(2.0) - 1) / 0.3, 0, 1)
    dodging, striking = standing(2.0), _striking(np.array([-0.02, -0.1, 0.12]), np.array([0.0, 0.0, 0.5]))
    assert shows("dodge", body(tipped(dodging, lean)))
    assert not shows("dodge", body(tipped(striking, lean)))


def test_a_throw_comes_from_behind_and_stops_ahead() -> None:
    assert shows("throw", body(_striking(np.array([-0.15, 0.15, -0.2]), np.array([0.0, 0.0, 0.5]))))
    assert not shows("throw", body(_striking(np.array([-0.02, -0.1, 0.12]), np.array([0.0, 0.0, 0.5]))))


@pytest.mark.parametrize("facing", [-90, 90])
def test_a_sidestep_goes_across_the_way_that_the_body_faces(facing: float) -> None:
    angle = np.deg2rad(facing)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    upper = [i for i, name in enumerate(HUMANML3D.joint_names) if name.split("_")[-1] not in LEGS]
    joints = walking(3.0, 0.8)
    middle = joints[:, :1] * [1.0, 0.0, 1.0]
    assert not shows("sidestep", body(joints))
    joints[:, upper] = (joints[:, upper] - middle) @ turn.T + middle
    assert shows("sidestep", body(joints))
    assert shows("sidestep", body(joints - middle))  # in place


def test_sit_ups_are_done_on_the_back() -> None:
    joints, length = standing(4.0), 4.0
    joints[..., 1] -= joints[:, :1, 1] - 0.2
    for side, across in (("L", 0.1), ("R", -0.1)):
        for part, place in (
            ("hip", (0.18, 0.0)),
            ("knee", (0.5, 0.35)),
            ("ankle", (0.08, 0.55)),
            ("foot", (0.03, 0.67)),
        ):
            joints[:, HUMANML3D.index(f"{side}_{part}")] = [across, *place]
    tip = -45 - 35 * np.cos(2 * np.pi * seconds(length) / length)
    assert shows("sit-ups", body(tipped(joints, tip)))
    assert not shows("sit-ups", body(tipped(joints, tip + 80)))  # bends forward and back over the legs


def test_signs_take_three_seconds_and_three_places() -> None:
    time = seconds(5.0)
    places = np.array([[0.45, 0.0, 0.1], [0.1, 0.0, 0.45], [0.15, 0.45, 0.1], [0.45, 0.0, 0.1], [0.1, 0.0, 0.45]])
    step = np.minimum(time.astype(int), 4)
    share = np.clip((time - step) / 0.3, 0, 1)[:, None]
    hand = places[np.maximum(step - 1, 0)] * (1 - share) + places[step] * share
    signs = arm_to(standing(5.0), "L", hand)
    assert shows("signal", body(signs))
    assert not shows("signal", body(signs[:60]))
    assert not shows("signal", body(_showing()))


def test_what_follows_a_climb_is_judged_where_the_feet_are(monkeypatch: pytest.MonkeyPatch) -> None:
    bows, step = _bowing(), round(0.25 * FPS)
    both = body(np.concatenate([bows[: len(bows) // step * step], _waving() + np.array([0.0, 0.8, 0.0])]))
    monkeypatch.setitem(RULES, "climb-stairs", RULES["bow"])
    assert shows_in_order(["climb-stairs", "wave"], both)
    assert not shows_in_order(["bow", "wave"], both)
