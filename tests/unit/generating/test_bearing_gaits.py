"""Gaits that are drawn on motions: where the feet are, and when they stand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.gaits import (
    limping,
    on_toes,
    over_rope,
    shuffling,
    skipping,
    staggering,
    stomping,
    tapping,
    with_high_knees,
)
from marey.motion.capsules import depth
from marey.motion.courses import course_of
from marey.motion.feet import find_contacts
from marey.motion.skeleton import HUMANML3D
from tests.support.bearings import CONTACTS, FPS, HEAD, LAYOUT, PELVIS, SHOULDERS, TOES, drawn, named, pitch, standing
from tests.support.bodies import walker


def gait(joints: np.ndarray, draws: Any, side: str = "") -> np.ndarray:
    return draws(joints, LAYOUT, 0, len(joints), side, np.random.default_rng(1))


def test_dragged_feet_stay_near_the_floor() -> None:
    before = walker()
    after = gait(before, shuffling)
    assert np.ptp(after[10:-10, TOES, 1], axis=0).max() < 0.4 * np.ptp(before[10:-10, TOES, 1], axis=0).max()
    np.testing.assert_allclose(after[:, PELVIS, [0, 2]], before[:, PELVIS, [0, 2]], atol=1e-6)


def test_who_stomps_lifts_the_knees_and_drops_on_the_feet() -> None:
    before = walker()
    after = gait(before, stomping)
    lifted = [each[:, [4, 5], 1].max(0) for each in (before, after)]
    assert (lifted[1] - lifted[0]).min() > 0.08
    assert (before[:, PELVIS, 1] - after[:, PELVIS, 1]).max() > 0.02


def test_who_stands_stamps_with_the_foot_that_is_named_or_both() -> None:
    before = standing()
    one, both = gait(before, stomping, "left"), gait(before, stomping)
    assert np.ptp(one[:, 7, 1]) > 0.1
    assert np.ptp(one[:, 8, 1]) < 0.02
    assert np.ptp(both[:, [7, 8], 1], axis=0).min() > 0.1
    assert not ((both[:, 7, 1] > 0.25) & (both[:, 8, 1] > 0.25)).any()


def test_who_skips_rope_leaves_the_floor_with_both_feet_over_and_over() -> None:
    before = standing(5.0)
    after = gait(before, over_rope)
    up = (after[:, [7, 8], 1] - before[:, [7, 8], 1]).min(1)
    assert 0.05 < up.max() < 0.15
    leaves = np.flatnonzero((up[:-1] < 0.02) & (up[1:] >= 0.02))
    assert 9 <= len(leaves) <= 13
    np.testing.assert_allclose(after[:, TOES][..., [0, 2]], before[:, TOES][..., [0, 2]], atol=0.01)


def test_who_goes_on_the_toes_is_upright_with_raised_heels() -> None:
    crouched = drawn(walker(), named("sneaking"))
    after = gait(crouched, on_toes)
    heels, toes = after[10:-10, [7, 8], 1], after[10:-10, TOES, 1]
    stands = toes < np.percentile(toes, 30, axis=0) + 0.005
    assert (heels - toes)[stands].min() > (crouched[10:-10, [7, 8], 1] - crouched[10:-10, TOES, 1])[stands].max() + 0.02
    assert (after[:, PELVIS, 1] - crouched[:, PELVIS, 1])[10:-10].min() > 0.1
    assert np.abs(pitch(after)[10:-10]).mean() < 0.4 * pitch(crouched)[10:-10].mean()
    np.testing.assert_allclose(after[:, TOES], crouched[:, TOES], atol=0.02)


def test_who_stands_drunk_sways_on_feet_that_stay() -> None:
    before = standing(6.0)
    after = drawn(before, named("drunk"))
    assert np.ptp(after[:, HEAD, 0]) > 0.15
    assert np.ptp(after[20:-20, TOES][..., [0, 2]], axis=0).max() < 0.05


def test_a_gait_is_drawn_once_on_the_side_that_is_named() -> None:
    once, twice = drawn(walker(), named("limp", "left")), drawn(walker(), named("limp", "left"), named("injured"))
    assert abs(once[:, PELVIS, 1].min() - twice[:, PELVIS, 1].min()) < 0.03


def test_high_knees_come_up_to_the_hips_and_standing_feet_stay() -> None:
    before = LAYOUT.decode(LAYOUT.encode(walker(6.0))).astype(np.float64)
    after = with_high_knees(before, LAYOUT, 0, len(before), "", np.random.default_rng(1))
    for hip, knee in ((1, 4), (2, 5)):
        below = after[10:-10, hip, 1] - after[10:-10, knee, 1]
        assert below.min() < 0.16
        assert (before[10:-10, hip, 1] - before[10:-10, knee, 1]).min() > 0.25
    assert depth(after, "L_thigh", "R_thigh").max() < 0.03
    assert depth(after, "L_thigh", "R_shin").max() < 0.0
    stands = find_contacts(before, HUMANML3D, FPS)[:, CONTACTS] & find_contacts(after, HUMANML3D, FPS)[:, CONTACTS]
    assert stands.mean() > 0.2
    assert np.abs((after - before)[:, TOES][stands]).max() < 0.1


def test_who_skips_leaves_the_floor_in_every_step() -> None:
    joints = LAYOUT.decode(LAYOUT.encode(walker(6.0))).astype(np.float64)
    after = skipping(joints, LAYOUT, 0, len(joints), "", np.random.default_rng(1))
    lowest, before = (each[:, [7, 8, 10, 11], 1].min(1) for each in (after, joints))
    assert before.max() < 0.06
    assert lowest.max() > 0.08
    up = lowest > 0.065
    assert np.sum(up[1:] & ~up[:-1]) >= 6
    falls = np.diff(after[:, PELVIS, 1], 2) * FPS**2
    assert -12.0 < falls.min() < -8.0, "it falls freely"
    assert falls.max() < 24.0, "its legs take up the fall"


def test_a_foot_taps_where_the_body_stands() -> None:
    body = standing(6.0)
    taps = tapping(body, LAYOUT, 0, len(body), "right", np.random.default_rng(1))
    risen = taps[:, TOES, 1] - body[:, TOES, 1]
    assert risen[:, 1].max() > 0.03
    assert np.abs(risen[:, 0]).max() < 0.005
    assert np.abs(taps[:, [7, 8]] - body[:, [7, 8]]).max() < 0.02
    walks = LAYOUT.decode(LAYOUT.encode(walker(6.0))).astype(np.float64)
    assert np.abs(tapping(walks, LAYOUT, 0, len(walks), "", np.random.default_rng(1)) - walks).max() < 0.01


def test_a_limp_hurries_over_the_leg_that_hurts() -> None:
    joints = LAYOUT.decode(LAYOUT.encode(walker(6.0))).astype(np.float64)
    after = limping(joints, LAYOUT, 0, len(joints), "left", np.random.default_rng(1))
    stands = find_contacts(after, HUMANML3D, FPS)
    hurt, sound = (stands[20:-20, toe].mean() for toe in CONTACTS)
    assert hurt < 0.9 * sound
    np.testing.assert_allclose(after[[0, -1], PELVIS, 0::2], joints[[0, -1], PELVIS, 0::2], atol=0.1)
    mirrored = limping(joints, LAYOUT, 0, len(joints), "right", np.random.default_rng(1))
    stands = find_contacts(mirrored, HUMANML3D, FPS)
    sound, hurt = (stands[20:-20, toe].mean() for toe in CONTACTS)
    assert hurt < 0.9 * sound


def test_who_staggers_leaves_the_straight_way_and_comes_back_to_it() -> None:
    joints = LAYOUT.decode(LAYOUT.encode(walker(8.0))).astype(np.float64)
    after = staggering(joints, LAYOUT, 0, len(joints), "", np.random.default_rng(1))
    course = course_of(LAYOUT.encode(after), LAYOUT)
    headings = np.degrees(course.headings - course.headings[0])
    assert np.ptp(headings) > 12
    assert np.ptp(np.degrees(course_of(LAYOUT.encode(joints), LAYOUT).headings)) < 5


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("seconds", [2.6, 4.0])
def test_a_short_stagger_ends_on_the_way_on_which_it_began(seconds: float, seed: int) -> None:
    joints = LAYOUT.decode(LAYOUT.encode(walker(seconds + 2.0))).astype(np.float64)
    after = staggering(joints, LAYOUT, 0, round(seconds * FPS), "", np.random.default_rng(seed))
    way = after[-1, PELVIS] - after[0, PELVIS]
    assert abs(np.degrees(np.arctan2(way[0], way[2]))) < 14
    ends = course_of(LAYOUT.encode(after), LAYOUT)
    assert abs(np.degrees(ends.headings[-1] - ends.headings[0])) < 12


def test_who_swaggers_turns_the_shoulders_with_the_steps() -> None:
    def yaw(joints: np.ndarray) -> np.ndarray:
        across = joints[:, SHOULDERS[0]] - joints[:, SHOULDERS[1]]
        return np.degrees(np.arctan2(across[:, 2], across[:, 0]))

    before, after = yaw(drawn(walker())), yaw(drawn(walker(), named("swagger")))
    assert np.ptp(after[20:-20]) > np.ptp(before[20:-20]) + 12


def test_a_restless_body_goes_from_one_foot_to_the_other() -> None:
    before, after = drawn(standing(6.0)), drawn(standing(6.0), named("weight-shift"))
    assert np.ptp(after[:, PELVIS, 0]) > np.ptp(before[:, PELVIS, 0]) + 0.08
    assert np.abs(after[:, TOES] - before[:, TOES]).max() < 0.02


def test_feet_on_a_beam_are_on_one_line() -> None:
    walk = walker(4.0)
    beam = drawn(walk, named("beam-walk"))
    across = [np.ptp(each[10:-10, [7, 8], 0].mean(axis=0)) for each in (walk, beam)]
    assert across[1] < 0.45 * across[0]
    assert (beam[20:-20, [20, 21], 1] > beam[20:-20, [16, 17], 1] - 0.25).all()
