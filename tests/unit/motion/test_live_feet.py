from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.feet import RELEASE, find_contacts
from marey.motion.kinematics import bone_lengths
from marey.motion.legs import two_bone_knee
from marey.motion.live_feet import STRAY, FeetState, LiveFeet
from marey.motion.skeleton import HUMANML3D, SKELETONS, Skeleton
from tests.support.motions import drift
from tests.support.stepping import ANKLES, HIPS, KNEES, TOES, sliding, stepping

FPS = 20.0
slides = st.tuples(st.floats(0.0, 0.06), st.integers(0, 1000))


def clean(joints, fps=FPS, skeleton=HUMANML3D):
    live = LiveFeet(skeleton, fps)
    return live.run(joints, live.start())[:2]


def steps(places):
    """Metres in the floor plane from each frame to the next."""
    return np.linalg.norm(np.diff(places, axis=0)[..., [0, 2]], axis=-1)


def acceleration(joints, fps=FPS):
    return np.linalg.norm(np.diff(joints, 2, axis=0), axis=-1) * fps**2


def still(frames=60):
    return np.tile(HUMANML3D.rest.astype(float), (frames, 1, 1))


@settings(max_examples=10, deadline=None)
@given(slides)
def test_locked_feet_do_not_slide(slide):
    joints = sliding(*slide)
    cleaned, contacts = clean(joints)
    both = contacts[1:, 1::2] & contacts[:-1, 1::2]
    assert both.mean() > 0.3
    assert steps(cleaned[:, TOES])[both].max() < 2e-7


@settings(max_examples=10, deadline=None)
@given(slides)
def test_no_toe_goes_farther_in_a_frame_than_its_input_and_the_blend(slide):
    joints = sliding(*slide)
    cleaned, _ = clean(joints)
    blend = 1.5 / (RELEASE * FPS) * STRAY  # an ease curve is at most 1.5 times as steep as a straight line
    own = steps(joints[:, TOES]) + steps(joints[:, HIPS])  # a leg at its full length takes the foot along with the hip
    assert (steps(cleaned[:, TOES]) <= own + blend + 1e-6).all()


@settings(max_examples=8, deadline=None)
@given(slides, st.lists(st.integers(1, 40), max_size=8))
def test_the_size_of_chunks_changes_no_bit(slide, sizes):
    joints = sliding(*slide)
    live = LiveFeet(HUMANML3D, FPS)
    once, contacts, end = live.run(joints, live.start())
    state, at = live.start(), 0
    for size in [*sizes, len(joints)]:
        chunk = joints[at : at + size]
        if len(chunk):
            found, stands, state = live.run(chunk, state)
            np.testing.assert_array_equal(found, once[at : at + size])
            np.testing.assert_array_equal(stands, contacts[at : at + size])
        at += size
    for field in fields(FeetState):
        np.testing.assert_array_equal(getattr(state, field.name), getattr(end, field.name), err_msg=field.name)


@settings(max_examples=6, deadline=None)
@given(slides, st.integers(1, 119))
def test_a_frame_depends_on_the_past_alone(slide, cut):
    joints = sliding(*slide)
    other = joints.copy()
    other[cut:] += drift(3, len(joints) - cut, 66, 0.1).reshape(-1, 22, 3)
    for one, two in zip(clean(joints), clean(other), strict=True):
        np.testing.assert_array_equal(one[:cut], two[:cut])


def test_streams_side_by_side_are_each_as_if_alone():
    motions = np.stack([sliding(0.03, seed) for seed in range(3)])
    live = LiveFeet(HUMANML3D, FPS)
    state, found = live.start(3), []
    for frame in range(60):
        rows = [0, 1, 2] if frame < 25 else [2, 0, 1]
        if frame == 25:
            state = state.take(rows)
        joints, _, state = live.step(motions[rows, frame], state)
        found.append(joints[np.argsort(rows)])
    for k, motion in enumerate(motions):
        np.testing.assert_array_equal(np.stack(found)[:, k], clean(motion[:60])[0])


@pytest.mark.parametrize("seed", range(4))
def test_cleaning_makes_no_pops_and_moves_the_legs_alone(seed):
    joints = sliding(seed=seed)
    cleaned, _ = clean(joints)
    was, now = acceleration(joints), acceleration(cleaned)
    assert now.max() < 1.3 * was.max()
    assert np.sqrt((now**2).mean()) < 1.1 * np.sqrt((was**2).mean())
    upper = [j for j in range(22) if j not in KNEES + ANKLES + TOES]
    np.testing.assert_array_equal(cleaned[:, upper], joints[:, upper])


def test_every_bone_keeps_its_length():
    joints = sliding(0.04)
    np.testing.assert_allclose(bone_lengths(clean(joints)[0], HUMANML3D), bone_lengths(joints, HUMANML3D), atol=1e-6)


def test_contacts_are_those_of_a_whole_clip_but_for_a_frame_or_two():
    joints = sliding()
    live, whole = clean(joints)[1], find_contacts(joints, HUMANML3D, FPS)
    assert (live == whole).mean() > 0.9


def test_motion_whose_feet_stand_already_is_left_alone():
    joints = stepping()
    np.testing.assert_allclose(clean(joints)[0], joints, atol=1e-9)


@pytest.mark.parametrize("speed", [0.1, 0.25])
def test_a_foot_that_means_to_slide_is_let_go_and_not_caught_again_while_it_slides(speed):
    joints = still(100)
    joints[..., 2] += (np.arange(100) * speed / FPS)[:, None]  # on ice
    cleaned, contacts = clean(joints)
    let_go = int(np.argmin(contacts[:, 1]))
    assert let_go == pytest.approx(STRAY / speed * FPS, abs=2)
    assert not contacts[let_go:, [1, 3]].any()
    assert steps(cleaned[:, TOES]).max() < speed / FPS + 1.5 / (RELEASE * FPS) * STRAY
    np.testing.assert_allclose(cleaned[let_go + round(RELEASE * FPS) + 1 :], joints[let_go + 8 :], atol=1e-9)


def test_a_foot_that_slid_stands_again_after_a_step():
    joints = still(100)
    joints[..., 2] += np.minimum(np.arange(100) * 0.25 / FPS, 0.5)[:, None]
    joints[60:70, [7, 10], 1] += 0.15
    _, contacts = clean(joints)
    assert not contacts[50:70, 1].any()
    assert contacts[72:, 1].all()
    assert not contacts[50:, 3].any()


def test_a_toe_that_the_leg_reaches_no_more_is_let_go_without_a_pop():
    joints = still(60)
    joints[:, :, 1] += 0.932 - 0.86  # on the tips of its toes, legs all but straight
    joints[:, TOES] = joints[:, HIPS] * [1, 0, 1]
    joints[:, ANKLES] = joints[:, TOES] + [0, 0.143, 0]
    legs = [joints[:, leg] for leg in zip(HIPS, KNEES, ANKLES, strict=True)]
    for knee, leg in zip(KNEES, legs, strict=True):
        bent = np.tile(HUMANML3D.rest[[1, 4, 7]].astype(float), (60, 1, 1))
        joints[:, knee] = two_bone_knee(bent, leg[:, 0], leg[:, 2], np.tile([0, 0, 1.0], (60, 1)))
    joints[..., 0] += (np.arange(60) * 0.2 / FPS)[:, None]
    cleaned, contacts = clean(joints)
    let_go = int(np.argmin(contacts[:, 1]))
    assert 0.02 < let_go * 0.2 / FPS < 0.8 * STRAY
    assert steps(cleaned[:, TOES]).max() < 0.2 / FPS + 1.5 / (RELEASE * FPS) * STRAY
    np.testing.assert_allclose(cleaned[-5:], joints[-5:], atol=1e-9)


def test_feet_come_out_of_the_floor():
    joints = sliding()
    joints[:, TOES[0], 1] -= 0.02 * (np.arange(len(joints)) % 40 < 10)
    assert joints[:, TOES, 1].min() < -0.01
    assert clean(joints)[0][:, TOES, 1].min() > -0.0021


def test_a_body_in_the_air_is_left_alone():
    joints = stepping() + np.array([0, 1.0, 0])
    cleaned, contacts = clean(joints)
    assert not contacts.any()
    np.testing.assert_allclose(cleaned, joints, atol=1e-9)


def test_the_floor_does_not_rise_with_feet_that_hop():
    joints = still(40)
    joints[15:25, :, 1] += 0.06
    _, contacts = clean(joints)
    assert contacts[:15, 1::2].all()
    assert not contacts[16:25, 1::2].any()
    assert contacts[27:, 1::2].all()


@pytest.mark.parametrize("fps", [12.5, 60.0])
def test_feet_stand_at_another_rate_too(fps):
    joints = stepping(fps)
    joints[:, [KNEES[0], ANKLES[0], TOES[0]]] += drift(1, len(joints), 3, 0.01, fps)[:, None] * [1, 0, 1]
    cleaned, contacts = clean(joints, fps)
    both = contacts[1:, 1::2] & contacts[:-1, 1::2]
    assert both.mean() > 0.35
    assert steps(cleaned[:, TOES])[both].max() < 2e-7


@pytest.mark.parametrize("name", SKELETONS)
def test_other_rigs_are_cleaned(name):
    skeleton = SKELETONS[name]
    joints = np.tile(skeleton.rest.astype(float), (30, 1, 1)) + drift(0, 30, 3, 0.01)[:, None] * [1, 0, 1]
    cleaned, contacts = clean(joints, skeleton=skeleton)
    assert contacts[:, 1::2].all()
    assert steps(cleaned[:, list(skeleton.feet[1::2])]).max() < 2e-7


def test_a_skeleton_without_feet_is_refused():
    plain = Skeleton("x", ("a", "b"), (-1, 0), np.ones((2, 3), np.float32), (0, 1))
    with pytest.raises(InvalidInput, match="feet"):
        LiveFeet(plain, 30)


@pytest.mark.parametrize("bad", [np.zeros((1, 21, 3)), np.full((1, 22, 3), np.nan)])
def test_joints_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInput, match=r"^humanml3d: joints"):
        clean(bad)


def test_a_state_of_other_streams_is_refused():
    live = LiveFeet(HUMANML3D, FPS)
    with pytest.raises(InvalidInput, match=r"^live feet: 2 frames for the 3 streams"):
        live.step(still(2), live.start(3))
