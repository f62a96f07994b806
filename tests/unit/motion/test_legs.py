"""Legs that follow moved feet: how far they stretch, how far hips come down, and which way knees bend."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.legs import (
    MAX_DROP,
    STRETCH,
    _without_backward_bend,
    draw_foot,
    follow_feet,
    foot_chain,
    knee_over_floor,
    leg_lengths,
    needed_drop,
    soft_distance,
    soft_stretch,
    two_bone_knee,
)
from marey.motion.rotations import Array, dot, length, normalize
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN

THIGH, SHANK = 0.42, 0.40
AHEAD = np.array([0.0, 0.0, 1.0])
AWAY = np.array([0.3, -0.2, 0.5])
"""From the origin, so that a sum of places is no difference of them."""


def leg_of(distance: float | Array, way: tuple[float, float, float] = (0.0, -1.0, 0.0), bend: float = 1.0) -> Array:
    """Legs (T, 3, 3) from a hip at 1 m, whose ankle is so far away along `way`; the knee is in front, or behind it."""
    distance = np.atleast_1d(np.asarray(distance, dtype=np.float64))
    axis = normalize(np.array(way))
    pole = normalize(AHEAD - axis * (AHEAD @ axis)) * bend
    along = (distance**2 + THIGH**2 - SHANK**2) / (2 * distance)
    off = np.sqrt(np.maximum(THIGH**2 - along**2, 0.0))
    hip = np.tile([0.0, 1.0, 0.0], (len(distance), 1))
    knee = hip + along[:, None] * axis + off[:, None] * pole
    return np.stack([hip, knee, hip + distance[:, None] * axis], axis=1)


def knee_forward(leg: Array) -> Array:
    """Distance (T,) of the knee before the line from hip to ankle."""
    axis = normalize(leg[:, 2] - leg[:, 0])
    upper = leg[:, 1] - leg[:, 0]
    return (upper - axis * dot(upper, axis)[:, None])[:, 2]


def test_a_foot_is_all_below_the_shank() -> None:
    assert [[HUMANML3D.joint_names[j] for j in foot_chain(HUMANML3D, toe)] for toe in HUMANML3D.feet[1::2]] == [
        ["L_foot", "L_ankle"],
        ["R_foot", "R_ankle"],
    ]
    for toe in SNAPMOGEN.feet[1::2]:
        chain = foot_chain(SNAPMOGEN, toe)
        knee = SNAPMOGEN.parents[chain[-1]]
        assert SNAPMOGEN.parents[knee] in SNAPMOGEN.facing[:2]


@pytest.mark.parametrize("aside", [(0.0, 0.0), (0.3, 0.0), (0.0, -0.4), (0.2, 0.3)])
@pytest.mark.parametrize("missing", [0.004, 0.03])
def test_hips_come_down_until_leg_and_foot_reach_the_toe(aside: tuple[float, float], missing: float) -> None:
    leg, span = leg_of(0.7), 0.15
    reach = 0.99 * (THIGH + SHANK + span)
    down = np.sqrt(reach**2 - aside[0] ** 2 - aside[1] ** 2)
    toe = leg[:, 0] + [aside[0], -down - missing, aside[1]]
    ankle = toe + np.array([0.0, span, 0.0])
    foot = np.stack([toe, 9 + toe, ankle], axis=1)  # joints between the two do not count
    drop = needed_drop(leg, leg[:, 0], foot)
    assert drop[0] == pytest.approx(missing, abs=1e-9)
    assert length(leg[:, 0] - [0, drop[0], 0] - toe)[0] == pytest.approx(reach, abs=1e-9)


def test_hips_stay_where_the_toe_is_in_reach_or_above_and_come_down_by_six_centimetres_at_most() -> None:
    leg = leg_of(0.7)

    def drop(height: float, beside: float = 0.0) -> float:
        toe = leg[:, 0] + [beside, height, 0.0]
        return float(needed_drop(leg, leg[:, 0], np.stack([toe, toe + np.array([0, 0.1, 0])], axis=1))[0])

    assert drop(-0.6) == 0.0
    assert drop(0.95) == 0.0  # a foot over the head
    assert drop(-2.0) == MAX_DROP
    assert drop(-0.03, beside=3.0) == pytest.approx(0.03)  # too far aside: level with the toe, not below


def test_a_leg_stretches_the_less_the_nearer_it_is_to_straight() -> None:
    reach, was = np.array(0.9), np.array(0.8) * 0.9
    asked = np.linspace(0.5, 3.0, 200)
    found = soft_stretch(was, asked, reach)
    nearer = asked <= was
    assert np.array_equal(found[nearer], asked[nearer])
    assert (found[~nearer] < asked[~nearer]).all()
    assert (np.diff(found) >= 0).all()
    assert found.max() <= STRETCH * reach
    assert found[-1] == pytest.approx(STRETCH * reach, abs=1e-4)
    assert soft_stretch(was, was + 0.001, reach) == pytest.approx(was + 0.001, abs=1e-5)  # at first all of it
    # half the room is asked for: 1 - exp(-1/2) of it is given
    room = STRETCH * reach - was
    assert soft_stretch(was, was + room / 2, reach) == pytest.approx(was + room * (1 - np.exp(-0.5)))


def test_a_leg_that_was_straighter_may_hardly_be_stretched() -> None:
    was = np.array(0.995)
    assert was < soft_stretch(was, np.array(2.0), np.array(1.0)) <= 0.9951
    assert soft_stretch(was, np.array(0.99), np.array(1.0)) == 0.99


def test_a_bent_leg_gets_the_distance_that_is_asked() -> None:
    leg = leg_of(np.full(40, 0.6))
    asked = np.linspace(0.4, 0.6, 40)
    np.testing.assert_allclose(soft_distance(leg, asked, 20.0), asked, atol=1e-12)
    farther = np.full(40, 0.9)
    reached = soft_stretch(np.array(0.6), np.array(0.9), np.array(THIGH + SHANK))
    np.testing.assert_allclose(soft_distance(leg, farther, 20.0), reached, atol=1e-12)


@pytest.mark.parametrize("fps", [20.0, 60.0])
def test_the_knee_of_a_nearly_straight_leg_does_not_jump(fps: float) -> None:
    """A millimetre at the ankle would be centimetres at the knee."""
    leg = leg_of(np.full(60, 0.815))
    asked = np.where(np.arange(60) < 30, 0.815, 0.80)
    found = soft_distance(leg, asked, fps)
    off = [leg_of(distance)[0, 1, 2] for distance in found]
    plain = [leg_of(distance)[0, 1, 2] for distance in asked]
    jump = np.abs(np.diff(plain)).max()
    assert jump > 0.03
    sigma = 0.04 * fps
    assert np.abs(np.diff(off)).max() == pytest.approx(jump / (sigma * np.sqrt(2 * np.pi)), rel=0.25)
    np.testing.assert_allclose(found[:20], asked[:20], atol=2e-4)
    np.testing.assert_allclose(found[-20:], asked[-20:], atol=2e-4)


def test_a_held_foot_turns_around_its_toe_and_another_moves_as_a_whole() -> None:
    hip = np.array([[0.0, 1.0, 0.0]])
    foot = np.array([[[0.05, 0.0, 0.4], [0.0, 0.03, 0.35], [0.0, 0.08, 0.25]]])
    before = length(foot[:, -1] - hip)
    for change in (-0.04, -0.004, 0.01):
        wanted = before + change
        held = draw_foot(foot, hip, wanted, np.ones(1))
        np.testing.assert_allclose(held[:, 0], foot[:, 0], atol=1e-9)
        assert length(held - foot).max() < 4 * abs(change)  # it turns the short way
        free = draw_foot(foot, hip, wanted, np.zeros(1))
        np.testing.assert_allclose(free - foot, np.broadcast_to((free - foot)[:, :1], foot.shape), atol=1e-12)
        way = normalize(foot[:, -1] - hip)
        np.testing.assert_allclose(free[:, -1], hip + wanted[:, None] * way, atol=1e-9)
        for moved in (held, free):
            np.testing.assert_allclose(length(moved[:, -1] - hip), wanted, atol=1e-9)
            np.testing.assert_allclose(length(np.diff(moved, axis=1)), length(np.diff(foot, axis=1)), atol=1e-9)
    higher = draw_foot(foot, hip, before - 0.04, np.ones(1))
    assert higher[0, -1, 1] > foot[0, -1, 1] + 0.02  # the heel comes up


def test_a_half_held_foot_turns_half_of_the_way() -> None:
    hip, foot = np.array([[0.0, 1.0, 0.0]]), np.array([[[0.0, 0.0, 0.2], [0.0, 0.08, 0.05]]])
    before = length(foot[:, -1] - hip)
    half = draw_foot(foot, hip, before - 0.04, np.full(1, 0.5))
    turned = foot[:, :1] + (half - half[:, :1])  # as if the toe had stayed
    np.testing.assert_allclose(length(turned[:, -1] - hip), before - 0.02, atol=1e-9)
    np.testing.assert_allclose(length(half[:, -1] - hip), before - 0.04, atol=1e-9)


def test_a_toe_out_of_reach_is_left() -> None:
    hip, foot = np.array([[0.0, 1.0, 0.0]]), np.array([[[0.0, -0.5, 0.2], [0.0, -0.42, 0.05]]])
    moved = draw_foot(foot, hip, np.full(1, 0.8), np.ones(1))
    np.testing.assert_allclose(length(moved[:, -1] - hip), 0.8, atol=1e-9)
    np.testing.assert_allclose(length(moved[:, 0] - moved[:, 1]), length(foot[:, 0] - foot[:, 1]), atol=1e-9)
    line = normalize(foot[:, 0] - hip)
    assert dot(normalize(moved[:, -1] - hip), line)[0] > 0.99999  # leg and foot lie along the way to the toe


@pytest.mark.parametrize("bend", [1.0, -1.0])
def test_a_knee_stays_in_the_plane_of_its_leg(bend: float) -> None:
    leg = leg_of(0.65, bend=bend) + AWAY
    for distance in (0.5, 0.65, 0.78):
        ankle = leg[:, 0] + distance * np.array([0.0, -1.0, 0.0])
        knee = two_bone_knee(leg, leg[:, 0], ankle, AHEAD[None])
        np.testing.assert_allclose(knee, leg_of(distance, bend=bend)[:, 1] + AWAY, atol=1e-9)


def test_a_leg_turns_as_a_whole_to_where_its_ankle_goes() -> None:
    leg = leg_of(0.65) + AWAY
    way = (0.6, -0.8, 0.0)
    hip = np.array([[0.2, 1.3, -0.4]])
    knee = two_bone_knee(leg, hip, hip + 0.65 * np.array([way]), AHEAD[None])
    np.testing.assert_allclose(knee - hip, leg_of(0.65, way)[:, 1] - leg_of(0.65)[:, 0], atol=1e-9)


def test_a_leg_points_to_an_ankle_out_of_its_reach() -> None:
    leg = leg_of(0.65)
    knee = two_bone_knee(leg, leg[:, 0], leg[:, 0] + [0.0, -2.0, 0.0], AHEAD[None])
    np.testing.assert_allclose(knee - leg[:, 0], [[0.0, -THIGH, 0.0]], atol=1e-6)


class Standing:
    """A body on two legs whose ankles are `flex` metres under the length of its legs."""

    def __init__(self, frames: int, flex: float = 0.004) -> None:
        joints = np.tile(HUMANML3D.rest.astype(np.float64), (frames, 1, 1))
        self.ankles, self.toes, self.knees, self.hips = [7, 8], [10, 11], [4, 5], [1, 2]
        for hip, knee, ankle, toe in zip(self.hips, self.knees, self.ankles, self.toes, strict=True):
            thigh, shank = leg_lengths(HUMANML3D.rest[[hip, knee, ankle]].astype(np.float64))
            distance = thigh + shank - flex
            along = (distance**2 + thigh**2 - shank**2) / (2 * distance)
            foot = HUMANML3D.rest[toe] - HUMANML3D.rest[ankle]
            joints[:, knee] = joints[:, hip] + [0.0, -along, np.sqrt(thigh**2 - along**2)]
            joints[:, ankle] = joints[:, hip] + [0.0, -distance, 0.0]
            joints[:, toe] = joints[:, ankle] + foot
        self.joints = joints
        self.body = [j for j in range(22) if j not in self.ankles + self.toes + self.knees]


@pytest.mark.parametrize("most", [MAX_DROP, 0.01])
def test_the_body_comes_down_as_a_whole_for_a_foot_that_stands_too_low(most: float) -> None:
    standing = Standing(60)
    moved = standing.joints.copy()
    moved[:, [7, 10], 1] -= 0.12
    stands = np.zeros((60, 2), bool)
    stands[:, 0] = True
    follow_feet(standing.joints, moved, stands, HUMANML3D, 20.0, most_drop=most)
    drops = (standing.joints - moved)[:, standing.body]
    np.testing.assert_allclose(drops[..., [0, 2]], 0.0, atol=1e-9)
    np.testing.assert_allclose(drops[..., 1], np.broadcast_to(drops[:, :1, 1], drops.shape[:2]), atol=1e-9)
    assert 0.5 * most < drops[..., 1].max() <= most + 1e-9
    for side in range(2):
        chain = [standing.hips[side], standing.knees[side], standing.ankles[side], standing.toes[side]]
        np.testing.assert_allclose(
            length(np.diff(moved[:, chain], axis=1)), length(np.diff(standing.joints[:, chain], axis=1)), atol=1e-6
        )
    np.testing.assert_allclose(moved[:, 11], standing.joints[:, 11], atol=0.07)


def test_a_body_stays_up_where_its_low_feet_do_not_stand() -> None:
    standing = Standing(60)
    moved = standing.joints.copy()
    moved[:, [7, 10], 1] -= 0.1
    follow_feet(standing.joints, moved, np.zeros((60, 2), bool), HUMANML3D, 20.0)
    np.testing.assert_allclose(moved[:, standing.body], standing.joints[:, standing.body], atol=1e-12)
    reach = sum(leg_lengths(standing.joints[0, [1, 4, 7]]))
    assert (length(moved[:, 7] - moved[:, 1]) <= reach + 1e-9).all()  # the foot leaves its place
    assert (moved[:, 10, 1] > standing.joints[:, 10, 1] - 0.02).all()


def test_a_toe_that_stands_keeps_its_place_while_its_heel_comes_up() -> None:
    standing = Standing(60)
    moved = standing.joints.copy()
    moved[:, [7, 10], 2] -= 0.12  # behind: out of the leg's soft reach
    follow_feet(standing.joints, moved, np.ones((60, 2), bool), HUMANML3D, 20.0)
    target = standing.joints[:, 10] - [0.0, 0.0, 0.12]
    np.testing.assert_allclose(moved[:, 10], target, atol=1e-3)
    assert (moved[:, 7, 1] > standing.joints[:, 7, 1] + 0.002).all()


def test_knees_that_a_decoder_bent_backwards_come_to_straight() -> None:
    """A knee 1 cm behind its leg for half a second, in a motion whose knees bend forward."""
    standing = Standing(80, 0.02)
    before = standing.joints.copy()
    for frame in range(35, 45):
        for hip, knee, ankle in zip(standing.hips, standing.knees, standing.ankles, strict=True):
            upper = before[frame, knee] - before[frame, hip]
            axis = normalize(before[frame, ankle] - before[frame, hip])
            before[frame, knee] -= 2 * (upper - axis * (upper @ axis)) * 0.12
            before[frame, knee] -= (upper - axis * (upper @ axis)) * 0.88
    moved = before.copy()
    moved[:, 10, 0] += 0.001
    follow_feet(before, moved, np.ones((80, 2), bool), HUMANML3D, 20.0)
    for knee in (4, 5):
        leg = moved[:, [knee - 3, knee, knee + 3]]
        assert knee_forward(leg).min() > -1e-3


def bent_back(metres: float, frames: int = 80) -> Array:
    """Legs (T, 3, 3) whose knees are 9 cm before their line, and in frames 35 to 44 so far behind it."""
    off = np.where((np.arange(frames) >= 35) & (np.arange(frames) < 45), -metres, 0.09)
    along, below = np.sqrt(THIGH**2 - off**2), np.sqrt(SHANK**2 - off**2)
    hip = np.tile(AWAY, (frames, 1))
    knee = hip + np.stack([0 * off, -along, off], axis=1)
    return np.stack([hip, knee, hip + np.stack([0 * off, -along - below, 0 * off], axis=1)], axis=1)


@pytest.mark.parametrize("fps", [20.0, 60.0])
def test_a_slight_backward_bend_becomes_straight_and_keeps_the_lengths_of_bones(fps: float) -> None:
    leg = bent_back(0.01)
    fixed = _without_backward_bend(leg, np.tile(AHEAD, (80, 1)), fps)
    assert knee_forward(leg).min() < -0.009
    assert -1e-9 < knee_forward(fixed)[35:45].min() < 0.005
    np.testing.assert_allclose(leg_lengths(fixed), leg_lengths(leg), atol=1e-9)
    np.testing.assert_array_equal(fixed[:, 0], leg[:, 0])
    np.testing.assert_allclose(fixed[35:45, 2], leg[35:45, 2], atol=1e-3)
    far = round(0.3 * fps)
    np.testing.assert_array_equal(fixed[: 35 - far], leg[: 35 - far])
    np.testing.assert_array_equal(fixed[45 + far :], leg[45 + far :])


def test_knees_that_bend_forward_or_far_backward_are_left() -> None:
    ahead = np.tile(AHEAD, (80, 1))
    for leg in (bent_back(-0.02), bent_back(0.08)):
        np.testing.assert_array_equal(_without_backward_bend(leg, ahead, 20.0), leg)


def test_a_knee_is_turned_out_of_the_floor() -> None:
    hip, ankle = np.array([[0.1, 0.1, 0.0]]), np.array([[0.1, 0.1, -0.7]])
    knee = np.array([[0.1, -0.1, -0.35]])
    height, out = np.array([0.08]), np.array([[0.1, 0.0, 0.0]])
    turned = knee_over_floor(knee, hip, ankle, height, out)
    assert turned[0, 1] > 0.0
    assert turned[0, 0] > 0.1, "away from the other leg"
    for joint in (hip, ankle):
        assert length(turned - joint) == pytest.approx(length(knee - joint))
    over = knee + np.array([0.0, 0.3, 0.0])
    assert np.array_equal(knee_over_floor(over, hip, ankle, height, out), over)
