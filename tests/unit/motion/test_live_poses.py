from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.io.bvh import read_bvh, write_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.live_poses import LivePoses, PoseState
from marey.motion.pose import solve_pose
from marey.motion.rotations import IDENTITY, about, angle_between, from_rotvec
from marey.motion.skeleton import HUMANML3D, SKELETONS
from tests.support.motions import dancer, drift
from tests.support.walker import walker

FPS = 20.0


def joints_of(rotations, root, skeleton=HUMANML3D):
    return forward_kinematics(skeleton, rotations, root)


def solve(joints, skeleton=HUMANML3D, fps=FPS):
    live = LivePoses(skeleton, fps)
    return live.run(joints, live.start())[0]


def steps(rotations):
    """Degrees that each joint turns between two frames, (T - 1, J)."""
    return np.degrees(angle_between(rotations[1:], rotations[:-1]))


def in_chunks(joints, sizes, skeleton=HUMANML3D):
    live = LivePoses(skeleton, FPS)
    state, found, at = live.start(), [], 0
    for size in [*sizes, len(joints)]:
        if at < len(joints):
            pose, state = live.run(joints[at : at + size], state)
            found.append(pose)
        at += size
    return np.concatenate([pose.rotations for pose in found]), state


def assert_same_state(one: PoseState, other: PoseState) -> None:
    for field in fields(PoseState):
        np.testing.assert_array_equal(getattr(one, field.name), getattr(other, field.name), err_msg=field.name)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000), st.lists(st.integers(1, 12), max_size=8))
def test_the_size_of_chunks_changes_no_bit(seed, sizes):
    joints = joints_of(*dancer(seed, 40))
    once, end = in_chunks(joints, [])
    chunked, chunked_end = in_chunks(joints, sizes)
    np.testing.assert_array_equal(chunked, once)
    assert_same_state(chunked_end, end)


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 30))
def test_a_frame_depends_on_the_past_alone(seed, cut):
    joints = joints_of(*dancer(seed, 31))
    other = joints.copy()
    other[cut:] += drift(seed, 31 - cut, 66, 0.1).reshape(-1, 22, 3)
    np.testing.assert_array_equal(solve(other).rotations[:cut], solve(joints).rotations[:cut])


def test_streams_side_by_side_are_each_as_if_alone_also_when_they_join_and_leave():
    motions = [joints_of(*dancer(seed, 30)) for seed in range(5)]
    live = LivePoses(HUMANML3D, FPS)
    state, found = live.start(4), [[] for _ in motions]
    who = [0, 1, 2, 3]
    for frame in range(30):
        if frame == 10:
            who, state = [3, 1], state.take([3, 1])
        if frame == 20:
            who, state = [3, 1, 4], PoseState.join([state, live.start()])
        pose, state = live.step(np.stack([motions[k][frame] for k in who]), state)
        for row, k in enumerate(who):
            found[k].append(pose.rotations[row])
    for k, first, last in ((0, 0, 10), (1, 0, 30), (2, 0, 10), (3, 0, 30), (4, 20, 30)):
        np.testing.assert_array_equal(found[k], solve(motions[k][first:last]).rotations)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 90))
def test_joints_of_a_body_come_back_exactly(seed, frames):
    joints = joints_of(*dancer(seed, frames))
    pose = solve(joints)
    np.testing.assert_allclose(forward_kinematics(HUMANML3D, pose.rotations, pose.root), joints, atol=2e-6)
    np.testing.assert_allclose(pose.joints, joints, atol=2e-6)


def test_a_bvh_of_a_stream_puts_the_joints_where_they_were(tmp_path):
    clip = walker(seconds=4.0, turn=0.6)
    pose = solve(clip.joints, clip.skeleton)
    live = MotionClip.of(pose.skeleton, pose.rotations, pose.root, clip.contacts, FPS)
    write_bvh(tmp_path / "live.bvh", live)
    back = read_bvh(tmp_path / "live.bvh")
    order = [back.skeleton.joint_names.index(name) for name in clip.skeleton.joint_names]
    assert np.linalg.norm(back.joints()[:, order] - clip.joints, axis=-1).max() < 1e-3


@pytest.mark.parametrize("seed", range(4))
def test_limbs_twist_as_they_do_in_a_whole_clip_but_a_little_later(seed):
    joints = joints_of(*dancer(seed, 120))
    live, whole = solve(joints), solve_pose(joints, HUMANML3D, measure=False)
    apart = np.degrees(angle_between(live.rotations, whole.rotations))
    assert np.median(apart[10:]) < 1.0
    assert apart[10:].mean() < 5.0
    assert steps(live.rotations).max() < steps(whole.rotations).max() + 15


def test_quaternions_do_not_change_sign_between_frames():
    rotations, root = dancer(2, 120)
    rotations[:, 0] = about("Y", np.linspace(0, 9 * np.pi, 120))
    pose = solve(joints_of(rotations, root))
    assert np.einsum("tji,tji->tj", pose.rotations[1:], pose.rotations[:-1]).min() > 0.5


@pytest.mark.parametrize("joint", ["L_elbow", "R_elbow", "L_knee"])
def test_a_limb_that_is_straight_for_a_while_does_not_spin(joint):
    rotations, root = dancer(4, 100)
    bend = np.clip(np.abs(np.linspace(-1.5, 1.5, 100)) - 0.4, 0, None)  # bent, straight for a second, bent
    axis = {"L_elbow": [0, -1.0, 0], "R_elbow": [0, 1.0, 0], "L_knee": [1.0, 0, 0]}[joint]
    rotations[:, HUMANML3D.index(joint)] = from_rotvec(bend[:, None] * np.array(axis))
    noise = drift(9, 100, 66, 0.001).reshape(100, 22, 3)
    assert steps(solve(joints_of(rotations, root) + noise).rotations).max() < steps(rotations).max() + 15


@pytest.mark.parametrize("rate", [0.25, 1.0])
def test_a_spine_that_turns_past_half_a_turn_does_not_jump_and_unwinds(rate):
    frames = round(60 / rate) + 100
    rotations, root = np.tile(IDENTITY, (frames, 22, 1)), np.tile([0.0, 0.94, 0.0], (frames, 1))
    angle = np.radians(200) * np.clip(np.arange(frames) * rate / 60, 0, 1)
    rotations[:, HUMANML3D.index("spine3")] = about("Y", angle)
    found = solve(joints_of(rotations, root)).rotations
    chain = [HUMANML3D.index(name) for name in ("spine1", "spine2", "spine3")]
    assert steps(found)[:, chain].max() < 25  # 120 degrees a joint would be the jump
    assert (
        np.degrees(angle_between(found[-1, chain], IDENTITY)).max() < 55
    )  # 160 degrees the short way, shared by three


def test_another_frame_rate_has_the_same_delay_in_seconds():
    fast = dancer(3, 480)
    joints = joints_of(*fast)
    slow, quick = solve(joints[::4], fps=20), solve(joints, fps=80)
    apart = np.degrees(angle_between(slow.rotations, quick.rotations[::4]))
    assert apart[20:].mean() < 4


def test_snapmogens_rig_is_solved_too():
    skeleton = SKELETONS["snapmogen"]
    rotations = from_rotvec(drift(2, 50, 72, 0.25).reshape(50, 24, 3))
    rotations[:, [0, 15]] = [1, 0, 0, 0]
    joints = joints_of(rotations, np.zeros((50, 3)), skeleton)
    assert np.linalg.norm(solve(joints, skeleton).joints - joints, axis=-1).max() < 1e-3


def test_a_state_is_not_changed_by_a_step():
    joints = joints_of(*dancer(0, 12))
    live = LivePoses(HUMANML3D, FPS)
    state = live.run(joints[:11], live.start())[1]
    first, second = live.step(joints[11:], state)[0], live.step(joints[11:], state)[0]
    np.testing.assert_array_equal(first.rotations, second.rotations)


@pytest.mark.parametrize("bad", [np.zeros((1, 21, 3)), np.zeros((0, 22, 3)), np.full((1, 22, 3), np.nan)])
def test_joints_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInput):
        solve(bad)


def test_a_state_of_other_streams_is_refused():
    live = LivePoses(HUMANML3D, FPS)
    with pytest.raises(InvalidInput, match=r"^live poses: 2 frames for the 3 streams"):
        live.step(np.zeros((2, 22, 3)), live.start(3))


def test_joints_all_in_one_place_are_solved_without_nan():
    assert np.isfinite(solve(np.zeros((5, 22, 3))).rotations).all()


def test_quaternions_of_a_first_frame_have_a_positive_real_part() -> None:
    rotations, root = dancer(3)
    first = solve(joints_of(rotations, root)).rotations[0]
    assert (first[..., 0] >= 0).all()
