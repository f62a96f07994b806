from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.feet import FLOOR_BAND, RULE, _fill, clean_feet, find_contacts, floor_height, rule_for, runs, skate
from marey.motion.filters import smooth_above
from marey.motion.kinematics import bone_lengths
from marey.motion.legs import two_bone_knee
from marey.motion.pose import solve_pose
from marey.motion.resample import frame_times, interpolate, interpolate_rotations
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN, Skeleton
from tests.support.bodies import runner
from tests.support.motions import drift
from tests.support.stepping import sliding, stepping
from tests.support.walker import walker

L_ANKLE, L_TOE, R_ANKLE, R_TOE = HUMANML3D.feet
HIPS, KNEES, ANKLES = [1, 2], [4, 5], [7, 8]


def acceleration(joints, fps=20.0):
    return np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1) * fps**2


def test_contacts_are_found_where_feet_were_laid_down():
    contacts = find_contacts(stepping(), HUMANML3D, 20)
    phase = (np.arange(120) / 20) % 1
    wrong = contacts[:, 1] != (phase < 0.6)
    near = np.minimum(phase, np.abs(phase - 0.6)) < 0.11  # touch-down and lift-off are gradual
    assert not wrong[~near & (phase < 0.95)].any()
    assert wrong.mean() < 0.15


def test_planted_feet_stand_still_to_the_last_digit():
    joints = sliding()
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert skate(joints, contacts, HUMANML3D, 20) > 0.02
    assert skate(clean, contacts, HUMANML3D, 20) < 1e-6


def test_every_bone_keeps_its_length():
    joints = sliding()
    clean, _ = clean_feet(joints, HUMANML3D, 20)
    np.testing.assert_allclose(bone_lengths(clean, HUMANML3D), bone_lengths(joints, HUMANML3D), atol=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_cleaning_makes_no_pops_and_hardly_moves_the_body(seed):
    joints = sliding(seed=seed)
    clean, _ = clean_feet(joints, HUMANML3D, 20)
    was, now = acceleration(joints), acceleration(clean)
    assert now.max() < 1.3 * was.max()
    assert np.sqrt((now**2).mean()) < 1.1 * np.sqrt((was**2).mean())
    upper = [j for j in range(22) if j not in KNEES + ANKLES + [L_TOE, R_TOE]]
    assert np.linalg.norm((clean - joints)[:, upper], axis=-1).max() < 0.02


def test_knees_do_not_pop_at_a_high_rate_either():
    slow = solve_pose(sliding(0.03, seed=7), HUMANML3D, measure=False)
    times = frame_times(len(slow.root), 20, 120)
    fast = solve_pose(interpolate(slow.joints, times), HUMANML3D, fps=120, measure=False).joints
    clean, contacts = clean_feet(fast, HUMANML3D, 120)
    assert skate(clean, contacts, HUMANML3D, 120) < 1e-6
    assert acceleration(clean, 120)[:, KNEES].max() < 1.5 * acceleration(fast, 120).max()
    assert np.isfinite(interpolate_rotations(slow.rotations, times)).all()


def test_a_knee_that_a_decoder_bent_backwards_does_not_pop():
    joints = np.tile(HUMANML3D.rest.astype(float), (120, 1, 1))
    bend = 0.04 * np.cos(2 * np.pi * np.arange(120) / 12) + 0.025  # from 6.5 cm forward to 1.5 cm backward
    along = np.sqrt(0.39**2 - bend**2) + np.sqrt(0.41**2 - bend**2)
    for hip, knee, ankle, toe in ((1, 4, 7, 10), (2, 5, 8, 11)):
        joints[:, [ankle, toe], 1] += (0.80 - along)[:, None]
        joints[:, knee] = joints[:, hip] + np.stack([0 * bend, -np.sqrt(0.39**2 - bend**2), bend], axis=1)
    joints[..., 1] -= (0.80 - along)[:, None]  # feet on the floor, the body goes up and down
    joints[:, [7, 10]] += drift(3, 120, 3, 0.01)[:, None] * [1, 0, 1]  # and one foot slides
    joints = solve_pose(joints, HUMANML3D, measure=False).joints
    clean, _ = clean_feet(joints, HUMANML3D, 20)
    assert (joints[:, 5, 2] - joints[:, 2, 2]).min() < -0.01
    assert acceleration(clean)[:, KNEES].max() < 1.3 * acceleration(joints)[:, KNEES].max()


def test_motion_whose_feet_stand_already_is_left_alone():
    joints = stepping()
    clean, _ = clean_feet(joints, HUMANML3D, 20)
    assert np.linalg.norm(clean - joints, axis=-1).mean() < 0.004


def test_feet_come_out_of_the_floor():
    joints = sliding()
    joints[:, L_TOE, 1] -= 0.02 * (np.arange(len(joints)) % 40 < 10)
    clean, _ = clean_feet(joints, HUMANML3D, 20)
    assert joints[:, [L_TOE, R_TOE], 1].min() < -0.01
    assert clean[:, [L_TOE, R_TOE], 1].min() > -0.0021


@pytest.mark.parametrize("off", [-0.3, -0.05, 0.05, 0.4])
def test_a_floor_that_is_off_is_put_to_zero(off):
    joints = stepping() + np.array([0, off, 0])
    assert floor_height(joints, HUMANML3D) == pytest.approx(off - np.clip(off, *FLOOR_BAND), abs=0.002)
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert clean[contacts[:, 1], L_TOE, 1].max() < FLOOR_BAND[1] + 0.005


def test_a_body_in_the_air_is_not_pulled_down():
    joints = stepping() + np.array([0, 1.0, 0])
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert floor_height(joints, HUMANML3D) == 0
    assert np.isfinite(clean).all()
    assert contacts.shape == (120, 4)


def test_still_feet_of_a_body_that_hangs_do_not_stand():
    joints = np.repeat(stepping()[:1], 40, axis=0) + np.array([0, 1.0, 0])
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert not contacts.any()
    np.testing.assert_allclose(clean, joints, atol=1e-6)


def test_a_foot_that_means_to_slide_slides():
    joints = np.tile(HUMANML3D.rest.astype(float), (60, 1, 1))
    joints[..., 2] += np.linspace(0, 0.6, 60)[:, None]  # on ice, 0.2 m/s
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert not contacts[:, [1, 3]].any()
    np.testing.assert_allclose(clean, joints, atol=1e-6)


def test_a_turn_on_the_spot_keeps_the_toe_and_lets_the_heel_turn():
    joints = np.tile(HUMANML3D.rest.astype(float), (40, 1, 1))
    angle = np.linspace(0, 0.5, 40)
    foot = joints[:, [L_ANKLE]] - joints[:, [L_TOE]]
    joints[:, L_ANKLE, 0] = joints[:, L_TOE, 0] - np.sin(angle) * 0.13
    joints[:, L_ANKLE, 2] = joints[:, L_TOE, 2] - np.cos(angle) * 0.13
    assert np.linalg.norm(foot, axis=-1)[0] == pytest.approx(np.hypot(0.13, 0.06), abs=1e-6)
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert contacts[:, 1].all()
    np.testing.assert_allclose(clean[:, L_TOE], clean[:1, L_TOE].repeat(40, 0), atol=1e-9)
    heading = np.arctan2(*(clean[:, L_TOE] - clean[:, L_ANKLE])[:, [0, 2]].T)
    assert np.ptp(heading) == pytest.approx(0.5, abs=0.05)


def test_known_contacts_are_used():
    joints = sliding()
    none, contacts = clean_feet(joints, HUMANML3D, 20, contacts=np.zeros((120, 4), bool))
    assert not contacts.any()
    lift = none - joints
    assert np.abs(lift[..., [0, 2]]).max() < 0.005


def test_a_skeleton_without_feet_is_refused():
    plain = Skeleton("x", ("a", "b"), (-1, 0), np.ones((2, 3), np.float32), (0, 1))
    for refused in (
        lambda: clean_feet(np.zeros((5, 2, 3)), plain, 30),
        lambda: find_contacts(np.zeros((5, 2, 3)), plain, 30),
    ):
        with pytest.raises(InvalidInput, match=r"^x: .*feet"):
            refused()


def test_one_frame_and_other_rigs_are_cleaned():
    for skeleton in (HUMANML3D, SNAPMOGEN):
        clean, contacts = clean_feet(skeleton.rest[None].astype(float), skeleton, 20)
        assert np.isfinite(clean).all()
        assert contacts.shape == (1, 4)


def test_a_long_walker_is_cleaned_like_a_short_one():
    clip = walker(seconds=9.8)
    clean, contacts = clean_feet(clip.joints, HUMANML3D, clip.fps)
    assert skate(clean, contacts, HUMANML3D, clip.fps) < 1e-6


@pytest.mark.parametrize(
    ("mask", "found"),
    [([], []), ([0, 0], []), ([1, 1, 1], [(0, 3)]), ([0, 1, 1, 0, 1], [(1, 3), (4, 5)])],
)
def test_runs_are_found(mask, found):
    assert runs(np.array(mask, bool)) == found


def test_a_curve_between_stretches_meets_the_slopes_at_its_own_ends():
    known = np.zeros(40, bool)
    known[5:15] = known[25:35] = True
    steps = np.arange(40.0)
    values = np.where(steps < 20, 0.1 * (steps - 14) ** 2, 0.2 * (steps - 30) ** 2)[:, None]
    filled = _fill(values, known, 20.0)[:, 0]
    np.testing.assert_array_equal(filled[known], values[known, 0])
    first, second = values[25:28, 0], values[12:15, 0]
    assert filled[25] - filled[24] == pytest.approx(np.diff(first).mean(), abs=0.5)
    assert filled[15] - filled[14] == pytest.approx(np.diff(second).mean(), abs=0.5)


def test_the_floor_is_where_the_lowest_tenth_of_the_frames_stand():
    joints = np.repeat(walker().joints[:1], 100, axis=0).astype(float)
    toes = joints[0, list(HUMANML3D.feet[1::2]), 1].min()
    joints[..., 1] += 0.3 - toes
    joints[15:, :, 1] += 0.1  # on tiptoe for most of the time
    low = floor_height(joints, HUMANML3D)
    joints[:, :, 1] -= 0.3 - toes
    assert low == pytest.approx(0.3 - np.clip(0.3, *FLOOR_BAND))


def test_a_smooth_cover_is_nowhere_below():
    values = np.zeros(50)
    values[[10, 30]] = [1, 0.5]
    cover = smooth_above(values, 3.0)
    assert (cover >= values - 1e-12).all()
    assert np.abs(np.diff(cover)).max() < 0.3


def test_a_leg_that_moved_nowhere_keeps_its_knee_and_one_that_moved_its_bones():
    leg = np.array([[[0, 0.9, 0], [0.02, 0.5, 0.1], [0, 0.1, 0.02]]])
    ahead = np.array([[0, 0, 1.0]])
    np.testing.assert_allclose(two_bone_knee(leg, leg[:, 0], leg[:, 2], ahead), leg[:, 1], atol=1e-12)
    moved = leg[:, 2] + [[0.05, 0.1, 0.2]]
    knee = two_bone_knee(leg, leg[:, 0], moved, ahead)
    for a, b, c in ((leg[:, 0], knee, 1), (knee, moved, 2)):
        assert np.linalg.norm(a - b) == pytest.approx(np.linalg.norm(leg[0, c] - leg[0, c - 1]), abs=1e-9)


def test_a_straight_leg_bends_ahead():
    leg = np.array([[[0, 0.8, 0], [0, 0.4, 0], [0, 0.0, 0]]])
    knee = two_bone_knee(leg, leg[:, 0], np.array([[0, 0.1, 0]]), np.array([[0, 0, 1.0]]))
    assert knee[0, 2] > 0.1


def test_a_gap_beside_a_single_known_frame_stays_near_its_value() -> None:
    """A stretch of one frame has no slope."""
    values, known = np.zeros((60, 1)), np.zeros(60, bool)
    values[20], known[20] = 0.1, True
    values[25:30], known[25:30] = 0.1, True
    filled = _fill(values, known, 20.0)
    assert filled.min() > -0.01
    assert filled.max() < 0.11


def test_a_running_body_stands_in_wider_bounds() -> None:
    joints = np.asarray(runner(4.0), np.float64)
    joints[..., 2] += 0.4 * (np.arange(len(joints)) / 20)[:, None]  # feet that slide a little, as decoded ones
    rule = rule_for(joints, 20.0)
    assert rule.enter_speed > 1.5 * RULE.enter_speed
    assert rule.leave_speed == pytest.approx(2 * rule.enter_speed)
    stands = [find_contacts(joints, HUMANML3D, 20.0, rule=each)[:, 1::2].mean() for each in (RULE, rule)]
    assert stands[0] < 0.05 < stands[1]
    clean, contacts = clean_feet(joints, HUMANML3D, 20.0, rule=rule)
    assert skate(clean, contacts, HUMANML3D, 20.0) < 1e-6
    assert rule_for(np.asarray(walker(seconds=3).joints, np.float64), 20.0) is RULE
    assert rule_for(joints[:1], 20.0) is RULE


def test_a_body_on_knees_and_hands_is_not_let_down_by_its_raised_feet():
    joints = np.repeat(walker().joints[:1].astype(np.float64), 40, axis=0)
    joints[:, KNEES, 1] = 0.05
    joints[:, [*ANKLES, L_TOE, R_TOE], 1] = 0.2
    clean, contacts = clean_feet(joints, HUMANML3D, 20)
    assert not contacts.any()
    np.testing.assert_allclose(clean[:, KNEES, 1], 0.05, atol=0.01)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.sampled_from([1, 2, 3, 4, 9, 25]), min_size=5, max_size=9), st.integers(0, 999))
@example([3, 2, 2, 9, 1, 25, 2, 4, 4], 0)
def test_stretches_are_joined_backwards_as_they_are_forwards(lengths, seed):
    known = np.repeat(np.arange(len(lengths)) % 2 == 0, lengths)
    values = np.random.default_rng(seed).normal(size=(len(known), 2))
    filled, back = _fill(values, known, 20.0), _fill(values[::-1], known[::-1], 20.0)[::-1]
    np.testing.assert_allclose(back, filled, atol=1e-9)


@pytest.mark.parametrize("sigma", [0.2, 0.4, 1.0])
def test_the_narrowest_smooth_cover_reaches_the_frames_beside(sigma):
    values = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    cover = smooth_above(values, sigma)
    assert (cover >= values - 1e-12).all()
    assert cover[4] == cover[6] > 0.5
    np.testing.assert_array_equal(smooth_above(values, 0.1), values)
