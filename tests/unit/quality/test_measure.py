"""Measures and flags: good synthetic motions pass, the same motions with one defect each have its flag."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.capsules import segment_distance
from marey.motion.resample import frame_times, interpolate
from marey.quality.limits import Expected, assess, expected_by_prompts, expected_of
from marey.quality.measure import measure
from marey.quality.record import Flag, MotionQuality, read_quality
from tests.support.bodies import FPS, Body, bower, raiser, runner, walker, waver

FEET = Expected()
GOOD = {
    "walk": walker,
    "run": runner,
    "bow": bower,
    "wave": lambda: waver("left"),
    "raise": lambda: raiser("right"),
    "stand": lambda: Body(4.0).joints(),
}


def flags(joints, expected=FEET, fps=FPS):
    return assess(joints, fps, expected).flags


@pytest.mark.parametrize("name", GOOD)
def test_good_motions_have_no_flag(name):
    quality = assess(GOOD[name](), FPS, FEET)
    assert (quality.flags, quality.ok) == ([], True), quality


def floating(joints):
    joints[..., 1] += (
        0.2 * np.clip(np.minimum(np.arange(len(joints)) - 15, 45 - np.arange(len(joints))) / 6, 0, 1)[:, None]
    )
    return joints


def sliding(joints):
    joints[..., 0] += np.linspace(0, len(joints) / FPS * 1.0, len(joints))[:, None]
    return joints


def popping(joints):
    joints[30:, :] += [0.3, 0, 0]
    return joints


def sunk(joints):
    joints[10:30, :, 1] -= 0.08
    return joints


def knee_bent_backwards(joints):
    joints[10:20, 4, 2] -= 0.2
    return joints


def arm_through_the_trunk(joints):
    for wrist, elbow in ((20, 18), (21, 19)):
        joints[10:40, wrist] = joints[10:40, 6]
        joints[10:40, elbow] = joints[10:40, 6] + [0.25, 0.0, 0.0]
    return joints


DEFECTS = {
    floating: Flag.FLOATING,
    sliding: Flag.SKATING,
    popping: Flag.POPPING,
    sunk: Flag.UNDER_FLOOR,
    knee_bent_backwards: Flag.JOINT_RANGE,
    arm_through_the_trunk: Flag.SELF_CONTACT,
}


@pytest.mark.parametrize("spoil", DEFECTS, ids=lambda spoil: spoil.__name__)
def test_each_defect_of_a_standing_body_has_its_flag(spoil):
    quality = assess(spoil(Body(4.0).joints()), FPS, FEET)
    assert DEFECTS[spoil] in quality.flags
    assert not quality.ok


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0])
@pytest.mark.parametrize("spoil", [None, floating, popping, sliding], ids=lambda s: getattr(s, "__name__", "good"))
def test_flags_do_not_depend_on_the_frame_rate(spoil, fps):
    joints = Body(4.0).joints()
    joints = interpolate(joints, frame_times(len(joints), FPS, 60.0))
    if spoil is not None:
        defect = spoil(Body(4.0).joints()) - Body(4.0).joints()
        joints = joints + interpolate(defect, frame_times(len(defect), FPS, 60.0))
    joints = interpolate(joints, frame_times(len(joints), 60.0, fps))
    found = flags(joints, fps=fps)
    assert ([] if spoil is None else [DEFECTS[spoil]]) == found


def test_the_flight_of_an_action_is_no_floating():
    joints = floating(Body(4.0).joints())  # 1.2 s in the air
    assert flags(joints, Expected(flight_s=1.4)) == []
    assert flags(joints, expected_of(["walk"])) == [Flag.FLOATING]
    assert flags(joints, expected_of(["climb-ladder"])) == []  # what it stands on is not known


def test_a_prompt_names_what_its_motion_rests_on():
    assert expected_by_prompts(["a person climbs a ladder"]).supports == ("raised",)
    assert expected_by_prompts(["a person walks, then jumps"]).flight_s == 0.8
    assert "whole-body" in expected_by_prompts(["a goalkeeper dives to the left"]).supports
    assert expected_by_prompts(["asdf qwer zxcv"]) == expected_by_prompts([]) == FEET
    assert set(expected_by_prompts(["he walks", "he lies down"]).supports) == {"feet", "whole-body"}


def test_a_single_jump_of_one_hand_is_a_pop_and_a_fast_punch_is_none():
    joints = Body(4.0).joints()
    joints[40:, 21, 0] -= 0.25
    assert measure(joints, FPS).pops == 1
    reach = 0.3 * np.sin(np.clip((np.arange(80) / FPS - 2) * 2 * np.pi * 2.5, 0, np.pi))
    joints = Body(4.0).joints()
    joints[:, 21, 2] += reach
    assert measure(joints, FPS).pops == 0


@settings(deadline=None)
@given(st.integers(4, 60), st.integers(0, 2**32 - 1))
def test_measures_are_finite_and_do_not_depend_on_place_or_heading(frames, seed):
    rng = np.random.default_rng(seed)
    joints = np.cumsum(rng.normal(0, 0.02, (frames, 22, 3)), axis=0) + Body(1.0).joints()[0]
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    moved = joints @ turn.T + [rng.normal(), 0, rng.normal()]
    before, after = (vars(measure(each, FPS)) for each in (joints, moved))
    assert all(np.isfinite(value) and value >= 0 for value in before.values())
    assert {name: pytest.approx(value, abs=0.11) for name, value in before.items()} == after


@given(st.integers(0, 2**32 - 1))
def test_the_distance_of_segments_is_that_of_their_nearest_points(seed):
    p1, q1, p2, q2 = np.random.default_rng(seed).normal(size=(4, 3))
    grid = np.linspace(0, 1, 60)[:, None]
    sampled = np.linalg.norm((p1 + grid * (q1 - p1))[:, None] - (p2 + grid * (q2 - p2))[None], axis=-1).min()
    assert sampled - 0.1 <= segment_distance(p1, q1, p2, q2) <= sampled + 1e-9


@pytest.mark.parametrize("shape", [(3, 22, 3), (10, 21, 3), (10, 22), (10, 22, 2)])
def test_other_shapes_are_refused(shape):
    with pytest.raises(InvalidInput, match="joints have shape"):
        measure(np.zeros(shape), FPS)
    joints = Body(1.0).joints()
    joints[3, 2, 1] = np.nan
    with pytest.raises(InvalidInput, match="not finite"):
        measure(joints, FPS)


def test_a_record_survives_json_and_other_versions_are_not_read():
    quality = assess(walker(), FPS, FEET)
    record = quality.model_dump(mode="json")
    assert read_quality({"quality": record}) == quality
    assert MotionQuality.model_validate(record) == quality
    assert read_quality({"quality": {**record, "version": 2}}) is None
    assert read_quality({}) is None
