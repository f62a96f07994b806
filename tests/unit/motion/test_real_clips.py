"""The whole way of a motion, on real captures."""

from __future__ import annotations

import numpy as np
import pytest

from marey.data.dataset import known_set
from marey.data.floor import on_floor
from marey.data.retarget import read_source, retarget
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import skate
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import BvhClip, format_bvh, parse_bvh
from marey.motion.io.convert import clip_from_bvh, steady
from marey.motion.kinematics import bone_lengths, facing
from marey.motion.pose import solve_pose
from marey.motion.rotations import angle_between, normalize
from marey.motion.skeleton import HUMANML3D
from tests.support.archives import first_files

pytestmark = pytest.mark.data

ARCHIVES = {"bandai-namco.tar.xz": 16, "cmu-iclone.tar.xz": 6}


@pytest.fixture(scope="module", params=ARCHIVES)
def archive(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def captured(archive) -> dict[str, BvhClip]:
    return {name: parse_bvh(data, name) for name, data in first_files(archive, ARCHIVES[archive]).items()}


@pytest.fixture(scope="module")
def people(archive, captured) -> dict[str, np.ndarray]:
    """Joints (T, 22, 3) at 20 fps on our skeleton, ten seconds at most."""
    (rig,) = known_set(archive.removesuffix(".tar.xz")).rigs
    made = {name: retarget(read_source(clip, rig, where=name), rig)[:197] for name, clip in captured.items()}
    return {name: on_floor(joints, "feet") for name, joints in made.items()}


def largest_turn(rotations) -> float:
    return float(np.degrees(angle_between(rotations[1:], rotations[:-1])).max())


def test_files_are_read_as_people_who_stand_on_the_floor(captured):
    for name, clip in captured.items():
        joints = clip.joints()
        assert clip.fps in (30, 60), name
        assert -0.3 < joints[..., 1].min() < 0.3, name
        assert 1.2 < np.ptp(joints[..., 1], axis=1).max() < 2.6, name


def test_a_written_file_is_the_same_motion(captured):
    for name, clip in captured.items():
        whole = steady(clip)
        back = parse_bvh(format_bvh(whole).encode(), rest_frame="keep")
        order = [back.skeleton.joint_names.index(n) for n in whole.skeleton.joint_names]
        assert np.abs(back.joints()[:, order] - whole.joints()).max() < 1e-5, name


def test_a_foreign_file_becomes_a_clip_that_faces_z(captured):
    for name, clip in captured.items():
        done = clip_from_bvh(clip, name)
        assert done.skeleton.facing, name
        np.testing.assert_allclose(facing(done.joints[0].astype(float), done.skeleton), [0, 0, 1], atol=1e-4)


def test_features_are_exact(people):
    for name, joints in people.items():
        own = HUMANML3D_263.with_facing(sigma=10.0)
        np.testing.assert_allclose(
            own.decode(own.encode(joints)), own.canonicalize(joints)[:-1], atol=1e-5, err_msg=name
        )


def test_poses_are_within_a_millimetre_and_turn_no_faster_than_the_bones(people):
    for name, joints in people.items():
        pose = solve_pose(joints, HUMANML3D)
        assert np.linalg.norm(pose.joints - joints, axis=-1).mean() < 0.001, name
        bones = joints - joints[:, [max(p, 0) for p in HUMANML3D.parents]]
        bones = normalize(bones[:, 1:])
        fastest = np.degrees(np.arccos(np.clip(np.einsum("tji,tji->tj", bones[1:], bones[:-1]), -1, 1))).max()
        assert largest_turn(pose.rotations) < 2 * fastest + 5, name


@pytest.mark.parametrize("fps", [20, 60])
def test_finished_clips_keep_bones_feet_and_smoothness(people, fps):
    for name, joints in people.items():
        features = HUMANML3D_263.encode(joints)
        raw, clip = (finish_motion(features, HUMANML3D_263, fps=fps, clean=c) for c in (False, True))
        assert np.ptp(bone_lengths(clip.joints, HUMANML3D), axis=0).max() < 1e-4, name
        assert skate(clip.joints, clip.contacts, HUMANML3D, fps) < 1e-3, name
        was, now = (np.linalg.norm(np.diff(c.joints.astype(float), 2, axis=0), axis=-1) for c in (raw, clip))
        assert now.max() < 1.6 * was.max(), name  # a sliding foot that carries is stopped
        assert np.sqrt((now**2).mean()) < 1.1 * np.sqrt((was**2).mean()), name
