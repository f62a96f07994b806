from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.features import HUMANML3D_263, KIT_251
from marey.motion.kinematics import forward_kinematics
from marey.motion.live_features import LiveDecoder, RootState
from tests.support.motions import dancer, drift
from tests.support.walker import walker

LAYOUTS = [HUMANML3D_263, KIT_251]


def features_of(layout, seed=0, frames=60):
    """Features of a motion that turns and goes about."""
    rotations, root = dancer(seed, frames + 1, layout.skeleton) if layout is HUMANML3D_263 else _turning(layout, frames)
    root = root + np.cumsum(drift(seed, frames + 1, 3, 0.05) * [1, 0, 1], axis=0)
    return layout.encode(forward_kinematics(layout.skeleton, rotations, root))


def _turning(layout, frames):
    clip = walker(seconds=frames / 20, turn=1.5)
    joints = len(layout.skeleton)
    rotations = np.tile([1.0, 0, 0, 0], (frames + 1, joints, 1))
    rotations[:, 0] = clip.rotations[:, 0]
    return rotations, clip.root.astype(float)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_frame_by_frame_gives_the_joints_of_the_whole(layout):
    features = features_of(layout)
    live = LiveDecoder(layout)
    joints, _ = live.run(features, live.start())
    assert joints.dtype == np.float32
    assert np.ptp(joints[:, 0, [0, 2]], axis=0).max() > 0.3
    np.testing.assert_allclose(joints, layout.decode(features), atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.lists(st.integers(1, 15), max_size=6))
def test_the_size_of_chunks_changes_no_bit(seed, sizes):
    features = features_of(HUMANML3D_263, seed, 40)
    live = LiveDecoder(HUMANML3D_263)
    once, end = live.run(features, live.start())
    state, found, at = live.start(), [], 0
    for size in [*sizes, 40]:
        if at < 40:
            joints, state = live.run(features[at : at + size], state)
            found.append(joints)
        at += size
    np.testing.assert_array_equal(np.concatenate(found), once)
    for name in ("half_yaw", "place", "step"):
        np.testing.assert_array_equal(getattr(state, name), getattr(end, name))


def test_streams_side_by_side_are_each_as_if_alone():
    motions = [features_of(HUMANML3D_263, seed, 20) for seed in range(3)]
    live = LiveDecoder(HUMANML3D_263)
    state, found = live.start(3), []
    for frame in range(20):
        if frame == 8:
            state = RootState.join([state.take([2]), state.take([0, 1])])
        rows = [0, 1, 2] if frame < 8 else [2, 0, 1]
        joints, state = live.step(np.stack([motions[k][frame] for k in rows]), state)
        found.append(joints[np.argsort(rows)])
    for k, motion in enumerate(motions):
        np.testing.assert_array_equal(np.stack(found)[:, k], live.run(motion, live.start())[0])


def test_minutes_of_walking_end_where_the_whole_says():
    features = np.tile(features_of(HUMANML3D_263, 1, 40), (100, 1))
    live = LiveDecoder(HUMANML3D_263)
    joints, _ = live.run(features, live.start())
    np.testing.assert_allclose(joints, HUMANML3D_263.decode(features), atol=1e-6)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.integers(0, 20), st.integers(1, 200))
def test_a_root_that_is_followed_without_joints_ends_where_steps_end(seed, before, frames):
    features = features_of(HUMANML3D_263, seed, before + frames)
    live = LiveDecoder(HUMANML3D_263)
    state = live.run(features[:before], live.start())[1] if before else live.start()
    followed, stepped = live.follow(features[before:], state), live.run(features[before:], state)[1]
    for name in ("half_yaw", "place", "step"):
        found, expected = getattr(followed, name), getattr(stepped, name)
        assert found.shape == expected.shape
        np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("bad", [np.zeros((1, 262)), np.zeros(263), np.zeros((0, 263)), np.zeros((1, 1, 263))])
def test_features_of_another_shape_are_refused(bad):
    live = LiveDecoder(HUMANML3D_263)
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*shape"):
        live.run(bad, live.start())
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*shape"):
        live.follow(bad, live.start())


def test_a_state_of_other_streams_is_refused():
    live = LiveDecoder(HUMANML3D_263)
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*not \(3, 263\)"):
        live.step(np.zeros((2, 263)), live.start(3))
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*2 streams, not of one"):
        live.run(np.zeros((4, 263)), live.start(2))
