from __future__ import annotations

import numpy as np
import pytest

from marey.checks.kinematics import gait
from marey.core.errors import InvalidFile
from marey.data.dataset import known_set
from marey.data.floor import on_floor
from marey.data.retarget import read_source, resample_points, retarget
from marey.motion.io.bvh import parse_bvh
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import LENGTH, Body, bandai_bvh, lift, steady, walker, waver

(BANDAI_NAMCO,) = known_set("bandai-namco").rigs
(ICLONE,) = known_set("cmu-iclone").rigs


def retargeted(joints, **options):
    clip = parse_bvh(bandai_bvh(joints, **options))
    return on_floor(retarget(read_source(clip, BANDAI_NAMCO, where="test"), BANDAI_NAMCO), "feet")


@pytest.mark.parametrize("scale", [1.0, 0.8, 1.3])
def test_every_bone_has_the_length_of_the_skeleton_whoever_the_actor_was(scale):
    out = retargeted(walker(), scale=scale, fps=20.0)
    lengths = bone_lengths(out, HUMANML3D)[:, 1:]
    np.testing.assert_allclose(lengths, np.broadcast_to(LENGTH[1:], lengths.shape), atol=1e-6)


def test_travel_scales_with_the_legs():
    small = gait(retargeted(walker(), scale=0.5, fps=20.0), 20.0)
    assert small.along == pytest.approx(gait(walker(), 20.0).along, rel=0.03)


def test_a_standing_foot_does_not_slide():
    source = walker(turn=60, cadence=3.2)  # short steps: legs that reach
    out = retargeted(source, fps=20.0)
    for toe in (10, 11):
        moved = np.linalg.norm(np.diff(source[2:, toe], axis=0), axis=-1)
        slid = np.linalg.norm(np.diff(out[2:, toe], axis=0), axis=-1)
        assert slid[moved < 1e-4].max() < 1e-3
        assert (moved < 1e-4).sum() > 20  # the walk does stand


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_hand_that_waves_is_the_hand_that_waved(side):
    out = retargeted(waver(side), fps=20.0)
    up, down = (20, 21) if side == "left" else (21, 20)
    assert out[:, up, 1].max() > out[:, 15, 1].max() > out[:, down, 1].max()
    assert out[0, 20, 0] > out[0, 0, 0] > out[0, 21, 0]  # facing +Z, the left hand is at +X


def test_it_begins_over_the_origin_facing_z_with_the_feet_on_the_floor():
    turned = walker() @ np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]) + [3.0, 0.4, -2.0]
    out = retargeted(turned, fps=20.0)
    np.testing.assert_allclose(out[0, 0, [0, 2]], 0, atol=1e-9)
    across = out[0, 1] - out[0, 2]
    assert across[0] > 0
    assert abs(across[2]) < 0.02
    assert abs(out[..., 1].min()) < 0.02


def test_thirty_frames_a_second_become_twenty():
    motion = Body(4.0, speed=steady(1.0), left=lift(0.5, 3.5)).joints()
    out = retargeted(motion, fps=30.0)  # the same frames, said to be faster: 80 frames are 2.67 s
    assert len(out) == 53


def test_whole_ratios_pick_frames_and_change_nothing():
    points = np.random.default_rng(0).normal(size=(61, 4, 3))
    np.testing.assert_array_equal(resample_points(points, 60.0, 20.0), points[::3])


def test_resampling_follows_a_curve_to_a_tenth_of_a_millimetre():
    t30, t20 = np.arange(90) / 30, np.arange(60) / 20
    curve = lambda t: 0.3 * np.sin(2 * np.pi * 1.5 * t)[:, None]  # noqa: E731
    error = np.abs(resample_points(curve(t30), 30.0, 20.0) - curve(t20))[3:-3].max()
    assert error < 1e-3 < np.abs(np.interp(t20, t30, curve(t30)[:, 0]) - curve(t20)[:, 0]).max()


def test_another_rig_is_refused_by_the_joint_that_is_missing():
    with pytest.raises(InvalidFile, match="no joint 'CC_Base_Pelvis'"):
        read_source(parse_bvh(bandai_bvh(walker())), ICLONE, where="walk.bvh")
