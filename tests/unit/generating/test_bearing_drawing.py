"""Bearings that are drawn on motions: where hands, head and trunk are, and what stays."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.bearing import BorneSpan
from marey.generation.bearing_drawing import arms_of, borne
from marey.generation.port import MotionFeatures
from marey.motion.skeleton import HUMANML3D
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import DRAWN_AS, StatedBearing, load_bearings
from tests.support.bearings import (
    FPS,
    HEAD,
    LAYOUT,
    NECK,
    PELVIS,
    SHOULDERS,
    TOES,
    WRISTS,
    OnceMade,
    drawn,
    named,
    pitch,
    standing,
)
from tests.support.bodies import walker


def test_without_spans_a_motion_stays() -> None:
    made: MotionFeatures = OnceMade(standing())
    assert borne(made, LAYOUT, []) is made.features


def test_a_stooped_body_leans_and_its_feet_stay() -> None:
    before, after = drawn(walker()), drawn(walker(), named("stooped"))
    assert (pitch(after) - pitch(before)).min() > 18
    np.testing.assert_allclose(after[:, TOES], before[:, TOES], atol=0.02)


def test_manners_lean_together_as_far_as_one_of_them_and_the_arm_on_a_cane_stays() -> None:
    joints = drawn(standing(), *map(named, ("stooped", "cane", "old", "foot-dragging")))
    assert 22 < np.median(pitch(joints)) < 34
    assert joints[-1, 21, 1] > 0.8, "the hand on the cane"
    assert np.median(pitch(drawn(standing(), named("stooped"), named("old")))) < 34


def test_a_hand_that_salutes_comes_to_the_brow_once_and_goes_down_again() -> None:
    joints = drawn(standing(), named("salute"))
    away = np.linalg.norm(joints[:, 21] - joints[:, HEAD], axis=1)
    assert away.min() < 0.22
    assert away[0] > 0.45
    assert away[-1] > 0.45
    raised = away < 0.3
    assert 1.0 < raised.sum() / FPS < 2.5
    assert np.abs(np.diff(raised.astype(int))).sum() == 2
    other = np.linalg.norm(joints[:, 20] - joints[:, HEAD], axis=1)
    assert other.min() > 0.45


def test_the_side_that_a_prompt_names_acts() -> None:
    joints = drawn(standing(), named("salute", "left"))
    assert np.linalg.norm(joints[:, 20] - joints[:, HEAD], axis=1).min() < 0.22
    assert set(arms_of(named("salute", "left"))) == {"left"}
    assert set(arms_of(named("hands-on-hips", "right"))) == {"right"}
    both = load_bearings()["thinking"].arms
    assert arms_of(named("thinking", "left")) == {"left": both["right"], "right": both["left"]}
    assert arms_of(named("thinking", "right")) == both


def test_crossed_arms_are_held_all_along_in_front_of_the_chest() -> None:
    joints = drawn(walker(), named("arms-crossed"))
    middle = joints[:, SHOULDERS].mean(1)
    hands = joints[:, WRISTS] - middle[:, None]
    assert hands[..., 2].min() > 0.08
    left, right = hands[:, 0, 0], hands[:, 1, 0]
    assert left.max() < 0.03  # over the middle, to the other side
    assert right.min() > -0.03


def test_a_phone_comes_to_the_ear_and_goes_down_when_the_call_ends() -> None:
    words = "answers a phone call, talks, and hangs up"
    joints = drawn(standing(6.0), StatedBearing("phone-call", words=words))
    away = np.linalg.norm(joints[:, 21] - joints[:, HEAD], axis=1)
    assert away.min() < 0.22
    assert min(away[0], away[-1]) > 0.45
    held = drawn(standing(6.0), StatedBearing("phone-call", words="talking on the phone"))
    assert np.linalg.norm(held[:, 21] - held[:, HEAD], axis=1).max() < 0.25


def test_a_suitcase_hangs_from_a_straight_arm_and_the_trunk_leans_away() -> None:
    for side, wrist, elbow, shoulder in (("right", 21, 19, 17), ("left", 20, 18, 16)):
        before, after = drawn(standing()), drawn(standing(), named("bag-carried", side))
        bones = np.linalg.norm(after[:, [elbow, wrist]] - after[:, [shoulder, elbow]], axis=-1).sum(1)
        assert (np.linalg.norm(after[:, wrist] - after[:, shoulder], axis=1) / bones).min() > 0.97
        aside = (after[:, NECK, 0] - before[:, NECK, 0]).mean()
        assert (aside > 0.02) if side == "right" else (aside < -0.02)  # +X is the left


def test_a_box_is_held_before_the_belly_by_both_hands() -> None:
    joints = drawn(walker(), named("box-carried"))
    hands = joints[:, WRISTS] - joints[:, [PELVIS]]
    assert hands[..., 1].min() > 0.1
    assert hands[..., 1].max() < 0.32
    assert hands[..., 2].min() > 0.15


def test_fingers_type_and_do_not_sweep() -> None:
    joints = drawn(standing(), named("typing"))
    hands = joints[:, WRISTS] - joints[:, [PELVIS]]
    assert 0.01 < np.ptp(hands[20:], axis=0).max() < 0.06


def test_sobs_heave_the_shoulders() -> None:
    joints = drawn(standing(), named("face-covered"))
    lifted = joints[:, SHOULDERS, 1].mean(1) - joints[:, NECK, 1]
    assert np.ptp(lifted) > 0.02


def test_what_is_worked_at_on_the_knees_begins_on_them() -> None:
    made: MotionFeatures = OnceMade(standing(6.0))
    spans = [BorneSpan(0, len(made.features), (named("lace-tying"),), action="kneel", seed=3)]
    lean = pitch(LAYOUT.decode(borne(made, LAYOUT, spans)))
    assert lean[:40].max() < 10
    assert lean[80:].min() > 25


def test_the_legs_of_who_kneels_stay_as_they_are() -> None:
    joints = standing()
    joints[:, 4, 0] += 0.05  # a knee beside the line that a solved one is on
    made: MotionFeatures = OnceMade(joints)
    spans = [BorneSpan(0, len(made.features), (named("rifle-aimed"),), action="kneel", seed=3)]
    after = LAYOUT.decode(borne(made, LAYOUT, spans))
    np.testing.assert_allclose(after[:, 4], LAYOUT.decode(made.features)[:, 4], atol=1e-3)


def test_two_gestures_share_the_time() -> None:
    joints = drawn(standing(6.0), named("salute"), named("shrug"))
    brow = np.linalg.norm(joints[:, 21] - joints[:, HEAD], axis=1)
    lifted = joints[:, SHOULDERS, 1].mean(1) - joints[:, NECK, 1]
    assert brow.argmin() < len(joints) / 2 < lifted.argmax()


def test_a_bearing_of_a_part_leaves_the_rest() -> None:
    before, after = drawn(standing(6.0)), drawn(standing(6.0), named("stooped"), begin=60)
    assert np.abs(pitch(after) - pitch(before))[:40].max() < 1
    assert (pitch(after) - pitch(before))[80:].min() > 18
    assert np.abs(np.diff(pitch(after))).max() * FPS < 120  # degrees a second


@pytest.mark.parametrize("name", sorted(name for name, each in load_bearings().items() if not each.moves))
def test_every_bearing_moves_a_walk_smoothly_and_keeps_its_bones(name: str) -> None:
    bearing = load_bearings()[name]
    joints = standing(5.0) if bearing.gait in ("foot-tap", "weight-shift") else walker(5.0)
    before, after = drawn(joints), drawn(joints, named(name))
    assert np.isfinite(after).all()
    if not bearing.gait:  # a trunk that is twisted in the first frame turns the axes of the whole motion
        gone = [np.linalg.norm(each[:, TOES], axis=-1) for each in (before, after)]
        assert np.abs(gone[1] - gone[0]).max() < 0.03
    assert np.linalg.norm(after - before, axis=-1).max() > 0.02
    lengths = np.linalg.norm(after - after[:, [max(p, 0) for p in HUMANML3D.parents]], axis=-1)
    assert np.ptp(lengths, axis=0).max() < 0.01
    speed = np.linalg.norm(np.diff(after - after[:, [PELVIS]], axis=0), axis=-1) * FPS
    sudden = bearing.keys or name in {*DRAWN_AS.values(), "mouth-covered", "fist-shaken"}
    assert speed[:, WRISTS].max() < (9 if sudden else 4.5)


def strokes(joints: np.ndarray, joint: int, axis: int, least: float = 0.04) -> int:
    """Return how often a joint goes along an axis and comes back by `least` metres at least."""
    at = joints[:, joint, axis] - joints[0, joint, axis]
    found, low, high, goes = 0, at[0], at[0], False
    for each in at:
        low, high = min(low, each), max(high, each)
        if not goes and each > low + least:
            goes, high = True, each
        elif goes and each < high - least:
            goes, low, found = False, each, found + 1
    return found


@pytest.mark.parametrize(
    ("prompt", "joint", "axis"),
    [
        ("she raps and knocks on the hatch {}", 21, 2),
        ("he slams his fist on the counter {}", 21, 1),
        ("shovels snow, {}", 21, 1),
        ("a girl stamps her right foot {}", 11, 1),
        ("he shakes his fist {}", 21, 1),
    ],
)
@pytest.mark.parametrize(("words", "times"), [("three times", 3), ("twice", 2), ("4x", 4), ("five strokes", 5)])
def test_a_stated_number_is_done_exactly_and_ends_at_rest(
    prompt: str, joint: int, axis: int, words: str, times: int
) -> None:
    (stated,) = stated_bearings(prompt.format(words))
    assert stated.times == times
    before, after = standing(18.0), drawn(standing(18.0), stated)
    rises = joint == 21 and axis == 1 and "fist" not in prompt
    expected = times + (1 if "slams" in prompt or rises else 0)
    assert strokes(after, joint, axis) == expected
    for frame in (0, -1):
        here = [(each - each[:, [PELVIS]])[frame, WRISTS] for each in (before, after)]
        assert np.abs(here[1] - here[0]).max() < 0.06


@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_knocks_of_no_number_are_whole(seed: int) -> None:
    spans = [BorneSpan(0, 80, (named("knock"),), action="walk", seed=seed)]
    joints = LAYOUT.decode(borne(OnceMade(standing()), LAYOUT, spans)).astype(np.float64)
    assert 3 <= strokes(joints, 21, 2) <= 5
    assert np.abs(joints[-1, WRISTS] - joints[0, WRISTS]).max() < 0.06


def test_work_is_done_over_and_over() -> None:
    joints = drawn(standing(6.0), named("hammering"))
    height = joints[:, 21, 1] - joints[:, 17, 1]
    blows = np.flatnonzero((height[:-1] > -0.1) & (height[1:] <= -0.1))
    assert 4 <= len(blows) <= 7
    assert np.ptp(np.diff(blows)) <= 2  # frames: at one pace
    assert height.max() > 0.0
    still = joints[:, 20] - joints[:, [16, 17]].mean(1)
    assert np.ptp(still, axis=0).max() < 0.12  # the other hand holds the nail


def test_a_golfer_swings_once_from_one_side_to_the_other() -> None:
    joints = drawn(standing(5.0), named("golf-swing"))
    hands = joints[:, WRISTS].mean(1) - joints[:, [PELVIS]].mean(1)
    aside = hands[:, 0]  # to the left of a body that faces +Z
    assert aside.argmin() < aside.argmax()
    assert aside.min() < -0.15
    assert aside.max() > 0.15
    low = hands[aside.argmin() : aside.argmax(), 1].min()
    assert low < hands[[aside.argmin(), aside.argmax()], 1].min() - 0.3
    mirrored = drawn(standing(5.0), named("golf-swing", "left"))
    left = (mirrored[:, WRISTS].mean(1) - mirrored[:, PELVIS])[:, 0]
    assert left.argmax() < left.argmin()


def test_who_leans_on_a_wall_has_the_feet_ahead_of_hips_and_head() -> None:
    joints = drawn(standing(), StatedBearing("wall-lean"))
    ankles = joints[40, [7, 8], 2].mean()
    assert ankles - joints[40, PELVIS, 2] > 0.12
    assert ankles - joints[40, HEAD, 2] > 0.12
    assert np.ptp(joints[:, TOES, 2]) < 0.02


def test_a_sword_is_drawn_from_the_other_hip_and_brought_back_to_it() -> None:
    for name, first in (("sword-drawn", True), ("sword-sheathed", False)):
        joints = drawn(standing(4.0), named(name))
        hand = joints[:, 21] - joints[:, PELVIS]
        at_hip, out = hand[:, 0].argmax(), hand[:, 1].argmax()  # to the left of a body that faces +Z
        assert hand[at_hip, 0] > 0.08
        assert hand[at_hip, 1] < 0.25
        assert hand[out, 1] > hand[at_hip, 1] + 0.15
        assert (at_hip < out) == first


@pytest.mark.parametrize(
    ("name", "side", "wrist", "joint", "near"),
    [
        ("shoulder-rubbed", "", 21, 16, 0.2),
        ("shoulder-rubbed", "left", 21, 16, 0.2),
        ("shoulder-rubbed", "right", 20, 17, 0.2),
        ("eyes-shaded", "left", 20, 15, 0.2),
        ("head-back-scratch", "", 21, 15, 0.18),
        ("listen", "left", 20, 15, 0.2),
        ("knee-rubbed", "", 21, 5, 0.25),
        ("knee-rubbed", "left", 20, 4, 0.25),
    ],
)
def test_a_hand_comes_to_the_part_that_hurts(name: str, side: str, wrist: int, joint: int, near: float) -> None:
    joints = drawn(standing(5.0), named(name, side), action="idle")
    away = np.linalg.norm(joints[:, wrist] - joints[:, joint], axis=1)
    assert away.min() < near < away[0]
    assert (away < near + 0.05).sum() > 1.5 * FPS
    other = np.linalg.norm(joints[:, 41 - wrist] - joints[:, joint], axis=1)
    assert other.min() > near


@pytest.mark.parametrize(
    ("name", "side", "wrist", "joint", "near"),
    [
        ("shoulder-held", "left", 21, 16, 0.2),
        ("arm-held", "left", 21, 18, 0.2),
        ("arm-held", "right", 20, 19, 0.2),
        ("side-held", "left", 20, 0, 0.28),
        ("side-held", "right", 21, 0, 0.28),
    ],
)
def test_a_hand_stays_at_the_part_that_hurts_on_the_way(
    name: str, side: str, wrist: int, joint: int, near: float
) -> None:
    joints = drawn(walker(4.0), named(name, side))
    assert np.linalg.norm(joints[:, wrist] - joints[:, joint], axis=1)[10:-10].max() < near
    assert np.linalg.norm(joints[:, 41 - wrist] - joints[:, joint], axis=1)[10:-10].min() > near - 0.05


def test_hands_that_tie_a_shoe_are_at_one_foot() -> None:
    joints = drawn(standing(5.0), named("lace-tying"), action="idle")
    apart = np.linalg.norm(joints[:, 20] - joints[:, 21], axis=1)
    assert apart[len(joints) // 2 :].max() < 0.25
    assert joints[len(joints) // 2 :, WRISTS, 1].max() < 0.72  # of a body that stands


def test_arms_of_victory_stand_away_from_the_head_in_a_v() -> None:
    joints = drawn(standing(4.0), named("victory"))
    top = int(joints[:, WRISTS, 1].mean(1).argmax())
    assert joints[top, WRISTS, 1].min() > joints[top, HEAD, 1] + 0.2
    assert np.linalg.norm(joints[top, WRISTS] - joints[top, HEAD], axis=1).min() > 0.35


def test_a_shrug_raises_the_shoulders() -> None:
    joints = drawn(standing(4.0), named("shrug"))
    assert (joints[:, SHOULDERS, 1] - joints[0, SHOULDERS, 1]).max(0).min() > 0.035


def test_both_hands_of_a_conductor_go_round_in_curves() -> None:
    joints = drawn(standing(6.0), named("conducting"))
    for wrist in WRISTS:
        way = joints[:, wrist] - joints[:, PELVIS]
        assert np.ptp(way[:, 1]) > 0.25
        assert np.ptp(way[:, 0]) > 0.2
        assert (np.linalg.norm(np.diff(way, axis=0), axis=1) * FPS > 0.05).mean() > 0.95


def test_a_hand_on_a_cane_stands_while_the_other_foot_does() -> None:
    walk = walker(4.0)
    cane = drawn(walk, named("cane", "right"))
    wrist, foot = cane[:, 21], cane[:, 7]
    stands = np.linalg.norm(np.gradient(foot, axis=0), axis=-1) * FPS < 0.15
    speed = np.linalg.norm(np.gradient(wrist, axis=0)[:, [0, 2]], axis=-1) * FPS
    assert stands.sum() > 10
    assert speed[stands].mean() < 0.6 * speed[~stands].mean()


def test_arms_that_are_out_to_the_sides_stay_there_in_a_spin() -> None:
    stated = stated_bearings("she spins around with both arms out")
    assert [each.name for each in stated] == ["arms-wide"]
    assert stated[0].shown_in("spin") == "body"
    joints = drawn(standing(), *stated)
    for wrist, shoulder in zip(WRISTS, SHOULDERS, strict=True):
        away = joints[20:-20, wrist] - joints[20:-20, shoulder]
        assert np.abs(away[:, 0]).min() > 0.4
        assert np.abs(away[:, 1:]).max() < 0.2
