"""Bearings that are drawn on motions: where hands, head and trunk are, and what stays."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.bundles import Bundle
from marey.generation.bearing import BorneSpan, arms_of, borne, borne_spans, fitting, with_bearing
from marey.generation.export import finish
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
from marey.generation.port import MotionFeatures, Request
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.motion.capsules import depth
from marey.motion.courses import course_of
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts
from marey.motion.skeleton import HUMANML3D
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import DRAWN_AS, StatedBearing, load_bearings
from tests.support.bodies import Body, walker
from tests.unit.generating.test_timelines import load, text_of

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, HEAD, NECK = 0, 15, 12
SHOULDERS, WRISTS, TOES = [16, 17], [20, 21], [10, 11]
CONTACTS = [list(HUMANML3D.feet).index(toe) for toe in TOES]


class OnceMade:
    """A motion of a model."""

    def __init__(self, joints: np.ndarray) -> None:
        self.features = LAYOUT.encode(joints)


def drawn(joints: np.ndarray, *stated: StatedBearing, begin: int = 0, end: int | None = None) -> np.ndarray:
    """Return the joints of a motion with bearings from `begin` on; the toes are where they were in frame 0."""
    made: MotionFeatures = OnceMade(joints)
    spans = [BorneSpan(begin, len(made.features) if end is None else end, stated, action="walk", seed=3)]
    joints = LAYOUT.decode(borne(made, LAYOUT, spans)).astype(np.float64)
    return joints - joints[:1, TOES].mean(1, keepdims=True) * [1, 0, 1]


def standing(seconds: float = 4.0) -> np.ndarray:
    return Body(seconds).joints()


def named(name: str, side: str = "") -> StatedBearing:
    return StatedBearing(name, side)  # type: ignore[arg-type]


def pitch(joints: np.ndarray) -> np.ndarray:
    """Return degrees (T,) by which the trunk leans forward, of a body that faces +Z."""
    trunk = joints[:, NECK] - joints[:, PELVIS]
    return np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))


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


def test_who_carries_has_the_load_that_is_named_or_one_before_the_belly() -> None:
    for prompt, name in (
        ("a person walks with a load", "load"),
        ("he carries a sack over his shoulder", "sack-carried"),
    ):
        request = Request(text=text_of(prompt, 8), seed=3)
        (span,) = borne_spans(request, FPS, 80)
        assert [each.name for each in span.stated] == [name]


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


def test_the_manifest_says_what_is_drawn() -> None:
    spans = [BorneSpan(0, 40, (named("limp", "left"), named("old")), "walk", 3)]
    record = [{"name": "limp", "side": "left"}, {"name": "old"}]
    assert with_bearing({"seed": 1}, spans, FPS) == {"seed": 1, "bearing": record}
    assert with_bearing({"seed": 1}, [], FPS) == {"seed": 1}
    rows = [{"start": 0.0, "end": 2.0}, {"start": 2.0, "end": 5.0}]
    second = [replace(spans[0], begin=40, end=100)]
    timeline = with_bearing({"timeline": {"rows": rows}}, second, FPS)["timeline"]
    assert timeline["rows"] == [rows[0], {**rows[1], "bearing": record}]


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    """A generator whose bundle reads prompts behind their plain action."""
    made = load("hgm3", tmp_path_factory.mktemp("models"))
    manifest = made.bundle.manifest
    text = manifest.text.model_copy(update={"plain_action": True, "movements": True})
    made.bundle = Bundle(made.bundle.path, manifest.model_copy(update={"text": text}))
    return made


def asked(generator: Any, prompt: str, rewritten: str) -> Request:
    return Request(replace(text_of(prompt, generator.limits.text_width), rewritten=rewritten), 3, frames=80)


def test_a_finished_motion_has_the_bearing_of_its_prompt_and_says_so(generator: Any) -> None:
    request = asked(generator, "a tired soldier salutes", "a person stands upright")
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    assert clip.manifest["bearing"] == [{"name": "tired"}, {"name": "salute"}]
    plain = finish(generator, asked(generator, "a person stands", "a person stands"), made, generator.settings({}))
    assert "bearing" not in plain.manifest
    assert np.abs(clip.joints - plain.joints).max() > 0.2
    quality, without = (each.manifest["quality"]["match"] for each in (clip, plain))
    assert quality == without  # the motion as it was made


def test_a_bearing_that_does_not_fit_the_action_is_not_drawn(generator: Any) -> None:
    request = asked(generator, "a limping soldier punches", "a person punches, a limping soldier punches")
    assert borne_spans(request, FPS, 80) == []
    assert borne_spans(replace(request, free=True), FPS, 80) == []


def test_a_blow_to_a_part_of_the_body_is_drawn_whole_and_not_as_a_bearing(generator: Any) -> None:
    flinches = "a person stands upright, breathing calmly, until hit"
    (span,) = borne_spans(asked(generator, "gets hit", flinches), FPS, 80)
    assert [each.name for each in span.stated] == ["flinch"]
    assert borne_spans(asked(generator, "gets hit in the stomach and stumbles back", flinches), FPS, 80) == []


def test_a_movement_that_has_a_name_is_drawn_without_a_pose_and_has_no_match(generator: Any) -> None:
    request = asked(generator, "a tired man does burpees", "a person stands upright")
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    assert clip.manifest["bearing"] == [{"name": "burpee"}]
    assert clip.manifest["quality"]["match"]["value"] is None
    assert clip.joints[:, HEAD, 1].min() < 0.8 < 2.0 < clip.joints[:, WRISTS, 1].max()


def test_a_bundle_that_reads_prompts_as_they_are_has_none(generator: Any) -> None:
    request = asked(generator, "a soldier salutes", "a person stands upright")
    (made,) = generate_any(generator, [request])
    manifest = generator.bundle.manifest
    text = manifest.text.model_copy(update={"plain_action": False, "movements": False})
    other = copy(generator)
    other.bundle = Bundle(generator.bundle.path, manifest.model_copy(update={"text": text}))
    assert made is not None
    assert "bearing" not in finish(other, request, made, generator.settings({})).manifest


def test_what_is_said_of_the_person_holds_for_every_row(generator: Any) -> None:
    width = generator.limits.text_width
    rows = (
        replace(text_of("an old man walks in with his arms crossed", width), rewritten="a person walks forward"),
        replace(text_of("salutes", width), rewritten="a person stands upright"),
        replace(text_of("and bows", width), rewritten="a person bows"),
    )
    whole = replace(text_of("an old man walks in with his arms crossed, salutes and bows", width), movements=rows)
    request = resolve_request(generator, Request(whole, 3))
    (made,) = generate_any(generator, [request])
    assert made is not None
    clip = finish(generator, request, made, generator.settings({}))
    drawn = [[each["name"] for each in row.get("bearing", ())] for row in clip.manifest["timeline"]["rows"]]
    assert drawn == [["old", "arms-crossed"], ["old", "salute"], []]


def test_work_ends_with_its_movement(generator: Any) -> None:
    width = generator.limits.text_width
    rows = (
        replace(text_of("an old man hammers a nail", width), rewritten="a person stands upright"),
        replace(text_of("and walks away", width), rewritten="a person walks forward"),
    )
    whole = replace(text_of("an old man hammers a nail and walks away", width), movements=rows)
    request = resolve_request(generator, Request(whole, 3))
    spans = borne_spans(request, FPS, round(20 * FPS))
    assert [[each.name for each in span.stated] for span in spans] == [["old", "hammering"], ["old"]]


def test_gestures_are_in_the_order_of_the_prompt() -> None:
    for prompt in ("yawns and scratches his head", "scratches his head and yawns"):
        names = [each.name for each in fitting(stated_bearings(prompt), "idle")]
        assert names == (["yawn", "head-scratch"] if prompt.startswith("yawns") else ["head-scratch", "yawn"])


def test_who_leans_on_a_wall_has_the_feet_ahead_of_hips_and_head() -> None:
    joints = drawn(standing(), StatedBearing("wall-lean"))
    ankles = joints[40, [7, 8], 2].mean()
    assert ankles - joints[40, PELVIS, 2] > 0.12
    assert ankles - joints[40, HEAD, 2] > 0.12
    assert np.ptp(joints[:, TOES, 2]) < 0.02


def test_a_phone_stays_at_the_ear_of_who_nods() -> None:
    assert StatedBearing("phone-call").shown_in("nod") == "body"


def test_a_sword_is_drawn_from_the_other_hip_and_brought_back_to_it() -> None:
    for name, first in (("sword-drawn", True), ("sword-sheathed", False)):
        joints = drawn(standing(4.0), named(name))
        hand = joints[:, 21] - joints[:, PELVIS]
        at_hip, out = hand[:, 0].argmax(), hand[:, 1].argmax()  # to the left of a body that faces +Z
        assert hand[at_hip, 0] > 0.08
        assert hand[at_hip, 1] < 0.25
        assert hand[out, 1] > hand[at_hip, 1] + 0.15
        assert (at_hip < out) == first


def test_a_restless_body_goes_from_one_foot_to_the_other() -> None:
    before, after = drawn(standing(6.0)), drawn(standing(6.0), named("weight-shift"))
    assert np.ptp(after[:, PELVIS, 0]) > np.ptp(before[:, PELVIS, 0]) + 0.08
    assert np.abs(after[:, TOES] - before[:, TOES]).max() < 0.02


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
    joints = drawn(standing(5.0), named(name, side))
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
    joints = drawn(standing(5.0), named("lace-tying"))
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


def test_feet_on_a_beam_are_on_one_line() -> None:
    walk = walker(4.0)
    beam = drawn(walk, named("beam-walk"))
    across = [np.ptp(each[10:-10, [7, 8], 0].mean(axis=0)) for each in (walk, beam)]
    assert across[1] < 0.45 * across[0]
    assert (beam[20:-20, [20, 21], 1] > beam[20:-20, [16, 17], 1] - 0.25).all()


def test_arms_that_are_out_to_the_sides_stay_there_in_a_spin() -> None:
    stated = stated_bearings("she spins around with both arms out")
    assert [each.name for each in stated] == ["arms-wide"]
    assert stated[0].shown_in("spin") == "body"
    joints = drawn(standing(), *stated)
    for wrist, shoulder in zip(WRISTS, SHOULDERS, strict=True):
        away = joints[20:-20, wrist] - joints[20:-20, shoulder]
        assert np.abs(away[:, 0]).min() > 0.4
        assert np.abs(away[:, 1:]).max() < 0.2
