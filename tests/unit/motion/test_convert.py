"""Clips of files whose roots, or whose bones, move as those of no body."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.io.bvh import BvhClip
from marey.motion.io.convert import steady
from marey.motion.skeleton import HUMANML3D, skeleton_of
from tests.support.walker import walker

WALK = walker(seconds=1.0)
FRAMES = WALK.frames


def rooted(*beside: str, travels: bool) -> BvhClip:
    """The walk under one more root, which travels or stands still; the first frame was a rest pose."""
    names = ("root", *HUMANML3D.joint_names, *beside)
    parents = (-1, 0, *(parent + 1 for parent in HUMANML3D.parents[1:]), *(0 for _ in beside))
    offsets = np.concatenate([np.zeros((1, 3)), HUMANML3D.offsets, np.zeros((len(beside), 3))]).astype(np.float32)
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (FRAMES, len(names), 1))
    rotations[:, 1:23] = WALK.rotations
    positions = np.tile(offsets.astype(np.float64), (FRAMES, 1, 1))
    root = WALK.root.astype(np.float64) * travels
    positions[:, 0], positions[:, 1] = root, WALK.root - root
    skeleton = skeleton_of(names, parents, offsets)
    clip = BvhClip(skeleton, rotations, root, positions, 20.0, np.full((len(names), 3), np.nan))
    return BvhClip(**{**vars(clip), "rest": clip.joints()[0]})


@pytest.mark.parametrize("beside", [(), ("ik_root", "camera")], ids=["one root", "a root with helpers"])
def test_a_root_that_stands_still_over_the_hips_is_left_out(beside: tuple[str, ...]) -> None:
    fixed = steady(rooted(*beside, travels=False))
    assert fixed.skeleton.joint_names == HUMANML3D.joint_names
    np.testing.assert_allclose(fixed.joints(), WALK.joints, atol=1e-5)
    assert fixed.positions is None
    assert fixed.rest is None, "the places are those of other joints"
    assert fixed.ends.shape == (22, 3)
    assert fixed.notes == (("3 joints beside the body are left out",) if beside else ())


def test_hips_that_tremble_under_a_root_that_travels_carry_the_whole_body() -> None:
    """Also where a joint above them moves farther from its parent than they do."""
    clip = rooted(travels=True)
    assert clip.positions is not None
    clip.positions[:, 1, 0] += 4e-4 * (np.arange(FRAMES) % 2)
    clip.positions[:, 1 + HUMANML3D.index("spine1"), 1] += 4e-3 * (np.arange(FRAMES) % 2)
    fixed = steady(clip)
    assert fixed.skeleton.joint_names == HUMANML3D.joint_names
    assert np.linalg.norm(fixed.joints() - WALK.joints, axis=-1).max() < 5e-3
    assert fixed.rest is None
    (note,) = fixed.notes
    assert note.startswith("bones change their length; with constant ones a joint is ")
