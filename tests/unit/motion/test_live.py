from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.body import standard_body
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.kinematics import forward_kinematics
from marey.motion.live import MEMORY, LiveMotion, LiveState
from marey.motion.live_features import LiveDecoder
from marey.motion.rotations import angle_between
from marey.motion.skeleton import HUMANML3D, Skeleton
from tests.support.motions import drift
from tests.support.stepping import TOES, sliding

BODY = standard_body(HUMANML3D).skeleton


def features_of(seed=0):
    """Features of a person that walks with feet that slide, and a decoder's noise on the joints."""
    layout = HUMANML3D_263.with_facing(sigma=10.0)
    features = layout.encode(sliding(0.02, seed)).astype(float)
    noise = drift(seed, len(features), 63, 0.002)
    features[:, layout.slices["positions"]] += noise
    return features


def run(motions):
    """Frames of several streams side by side: rotations, root, joints, contacts, each (T, S, ...)."""
    live = LiveMotion(HUMANML3D_263)
    state, found = live.start(len(motions)), []
    for frame in np.stack(motions, axis=1):
        frames, state = live.step(frame, state)
        found.append(frames)
    return [np.stack([getattr(f, name) for f in found]) for name in ("rotations", "root", "joints", "contacts")]


def test_rotations_and_root_put_the_joints_of_a_fixed_skeleton_where_they_are_said_to_be():
    rotations, root, joints, _ = run([features_of()])
    again = forward_kinematics(BODY, rotations[:, 0], root[:, 0])
    assert np.linalg.norm(again - joints[:, 0], axis=-1).max() < 1e-4


def test_feet_stand_still_in_what_a_client_draws():
    rotations, root, _, contacts = run([features_of()])
    drawn = forward_kinematics(BODY, rotations[:, 0], root[:, 0])
    both = contacts[1:, 0, 1::2] & contacts[:-1, 0, 1::2]
    assert both.mean() > 0.3
    assert np.linalg.norm(np.diff(drawn[:, TOES], axis=0)[..., [0, 2]], axis=-1)[both].max() < 2e-5  # float32


def test_the_stream_is_the_clip_but_for_what_a_clip_knows_of_the_future():
    features = features_of()
    rotations, _, joints, _ = run([features])
    clip = finish_motion(features, HUMANML3D_263)
    apart = np.linalg.norm(joints[:, 0] - clip.joints, axis=-1)
    assert apart.mean() < 0.02
    assert np.degrees(angle_between(rotations[:, 0].astype(float), clip.rotations.astype(float))).mean() < 6


def test_no_joint_jumps():
    _, _, joints, _ = run([features_of(1)])
    decoded = HUMANML3D_263.decode(features_of(1))
    most = [np.linalg.norm(np.diff(j, 2, axis=0), axis=-1).max() for j in (joints[:, 0], decoded)]
    assert most[0] < 1.5 * most[1]


def test_streams_join_and_leave_without_a_trace_on_the_others():
    motions = [features_of(seed)[:40] for seed in range(3)]
    alone = [run([motion]) for motion in motions]
    live = LiveMotion(HUMANML3D_263)
    state = live.start(2)
    for frame in range(20):
        frames, state = live.step(np.stack([motions[0][frame], motions[1][frame]]), state)
        np.testing.assert_array_equal(frames.rotations, np.stack([alone[k][0][frame, 0] for k in (0, 1)]))
    state = LiveState.join([live.start(), state.take([1])])
    for frame in range(20):
        frames, state = live.step(np.stack([motions[2][frame], motions[1][20 + frame]]), state)
        np.testing.assert_array_equal(frames.rotations[0], alone[2][0][frame, 0])
        np.testing.assert_array_equal(frames.rotations[1], alone[1][0][20 + frame, 0])


@pytest.mark.parametrize("streams", [3, 8])
def test_no_bit_of_a_stream_depends_on_how_many_are_beside_it(streams):
    motions = [features_of(seed)[:40] for seed in range(streams)]
    live = LiveMotion(HUMANML3D_263)
    together, alone = live.start(streams), [live.start() for _ in motions]
    for frame in np.stack(motions, axis=1):
        _, together = live.step(frame, together)
        alone = [live.step(frame[[k]], state)[1] for k, state in enumerate(alone)]
    for part in ("root", "feet", "poses"):
        states = [getattr(state, part) for state in alone]
        for field in fields(states[0]):
            rows = np.concatenate([getattr(state, field.name) for state in states])
            np.testing.assert_array_equal(getattr(getattr(together, part), field.name), rows, err_msg=field.name)


def test_a_skeleton_without_feet_is_refused():
    plain = Skeleton("x", ("a", "b"), (-1, 0), np.ones((2, 3), np.float32), (0, 1))
    with pytest.raises(InvalidInput, match="feet"):
        LiveMotion(replace(HUMANML3D_263, skeleton=plain))


def test_a_stream_of_minutes_is_gone_on_with_without_posing_all_of_it(monkeypatch):
    posed = []
    step = LiveDecoder.step
    monkeypatch.setattr(LiveDecoder, "step", lambda self, *args: posed.append(1) or step(self, *args))
    LiveMotion(HUMANML3D_263).after(np.tile(features_of(), (50, 1)))
    assert len(posed) == MEMORY
