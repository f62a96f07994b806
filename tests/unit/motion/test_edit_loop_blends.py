"""Blends of loops: slower, changed, and where the source begins too late."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion import MotionClip, edit
from marey.motion.edits.loop_bars import Bars, Fault, in_place
from marey.motion.edits.loop_blend import closed
from marey.motion.edits.loop_ease import eased, smoothed
from marey.motion.edits.loop_feet import stands
from marey.motion.edits.loop_search import cycles
from marey.motion.kinematics import forward_kinematics
from marey.motion.pose import solve_pose
from marey.motion.rotations import from_rotvec, multiply
from marey.motion.skeleton import HUMANML3D
from tests.support import bodies
from tests.support.loops import LOOP, idle, run, swaying, thrice, walked


@pytest.fixture(scope="module")
def walk() -> MotionClip:
    return walked()


def test_a_slower_blend_moves_a_runner_less_and_meets_the_source_at_both_ends():
    clip = run()
    cycle = next(each for each in cycles(clip, clip.contacts, 6, 100) if each.first >= 6)
    usual, slower = (closed(clip, clip.contacts, cycle, 6, frames) for frames in (0.0, 0.25))
    places = [forward_kinematics(clip.skeleton, each.rotations, each.root) for each in (usual, slower)]
    np.testing.assert_allclose(places[1][:-6], places[0][:-6])
    np.testing.assert_allclose(places[1][-1], slower.travel.places(places[1][0]), atol=1e-6)
    way = [np.linalg.norm(np.diff(each[:, 0], axis=0), axis=-1) for each in places]
    assert 0.88 < way[1][-5:-1].mean() / way[0][-5:-1].mean() < 0.97
    assert way[1][[-6, -1]] == pytest.approx(way[0][[-6, -1]], rel=0.03)


def test_slower_blends_are_tried_before_a_motion_is_refused(monkeypatch):
    asked: list[float] = []

    def noted(*given):
        asked.append(given[4])
        return closed(*given)

    monkeypatch.setattr("marey.motion.edits.loop.closed", noted)
    monkeypatch.setattr(Bars, "best", lambda *_: Fault(2.0, "a joint jumps"))
    with pytest.raises(InvalidInput, match="a joint jumps"):
        edit(walked(), [LOOP])
    assert asked == sorted(asked)
    assert set(asked) == {0.0, 0.04 * 6}


@pytest.mark.parametrize("speed", [1.0, 1.6])
def test_a_short_walk_loops_by_a_blend_that_is_changed(speed, monkeypatch):
    """Two gait cycles leave few candidates, and each misses a bar by some percent."""
    clip = swaying(bodies.Body(1.8, speed=lambda t: speed + 0 * t, duty=0.6, cadence=1.8))
    (loop,) = edit(clip, [LOOP])
    blend, played = loop.manifest["loop"]["blend_frames"], thrice(loop).joints
    own = slice(loop.frames - 1 - blend["last"], loop.frames - 1 + blend["first"])
    for number in (1, 2):
        source, found = (np.linalg.norm(np.diff(joints, number, axis=0), axis=-1) for joints in (clip.joints, played))
        assert (found[own].max(axis=0) <= 1.1 * source.max(axis=0) + 2e-4).all()
    monkeypatch.setattr("marey.motion.edits.loop.eased", lambda *_: Fault(2.0, "it stays as it is"))
    with pytest.raises(InvalidInput, match=r"\d mm (in the blend|at the seam), "):
        edit(clip, [LOOP])


def sinking() -> MotionClip:
    """A body that stands for 2.5 s on straight legs; first a hand comes to rest, then the hips begin to come down."""
    clip = idle(2.5)
    time = np.arange(clip.frames) / clip.fps
    joints = clip.joints.astype(np.float64)
    down = 0.045 * np.clip((time - 1.2) / 1.3, 0.0, 1.0) ** 2
    upper = [joint for joint, name in enumerate(HUMANML3D.joint_names) if "ankle" not in name and "foot" not in name]
    joints[:, upper, 1] -= down[:, None]
    knees = [HUMANML3D.index(name) for name in ("L_knee", "R_knee")]
    joints[:, knees, 2] += np.sqrt(down)[:, None] * 0.3
    pose = solve_pose(joints, HUMANML3D, fps=clip.fps)
    arm = HUMANML3D.index("L_elbow")
    rotations = pose.rotations.copy()
    turn = from_rotvec(np.outer(0.5 * np.exp(-4 * time), [0.0, 0.0, 1.0]))
    rotations[:, arm] = multiply(rotations[:, arm], turn)
    return MotionClip.of(pose.skeleton, rotations, pose.root, clip.contacts, clip.fps)


def test_a_short_clip_of_a_standing_body_loops_although_it_ends_lower():
    """No cycle of 2 s begins late enough for frames of the source before a blend of more than half a second."""
    clip = sinking()
    (loop,) = edit(clip, [LOOP])
    blend = loop.manifest["loop"]["blend_frames"]
    assert loop.manifest["loop"]["source_frames"][0] + blend["first"] < sum(blend.values())
    played = thrice(loop).joints.astype(np.float64)
    knees = [HUMANML3D.index(name) for name in ("L_knee", "R_knee")]
    own, source = (np.linalg.norm(np.diff(each[:, knees], 2, axis=0), axis=-1) for each in (played, clip.joints))
    assert own.max() <= 1.1 * source.max() + 5e-4


def test_a_blend_at_the_beginning_of_the_source_goes_on_with_its_first_movement(walk):
    cycle = next(each for each in cycles(walk, walk.contacts, 6, 10_000, 0) if each.first < 2)
    loop = closed(walk, walk.contacts, cycle, 6)
    joints = forward_kinematics(walk.skeleton, loop.rotations, loop.root)
    np.testing.assert_allclose(joints[:-6], walk.joints[cycle.first : cycle.last - 5], atol=1e-5)
    after = loop.travel.places(joints[1])
    into, out = joints[-1] - joints[-2], after - joints[-1]
    usual = np.linalg.norm(np.diff(walk.joints, 2, axis=0), axis=-1).max(axis=0)
    assert (np.linalg.norm(out - into, axis=-1) <= 1.2 * usual + 1e-3).all()
    late = closed(walk, walk.contacts, cycle, 6, 0.25)
    slow = forward_kinematics(walk.skeleton, late.rotations, late.root)
    assert np.linalg.norm(np.diff(slow[-6:, 0], axis=0)) < np.linalg.norm(np.diff(joints[-6:, 0], axis=0))


def test_a_smoothed_blend_keeps_its_ends_and_standing_feet(walk):
    cycle = next(each for each in cycles(walk, walk.contacts, 6, 100) if each.first >= 6)
    plain = closed(walk, walk.contacts, cycle, 6)
    after = smoothed(walk, plain, np.array([2.0, 2.0, 2.0, 0.0]))
    was, now = (forward_kinematics(walk.skeleton, each.rotations, each.root) for each in (plain, after))
    np.testing.assert_allclose(now[:-6], was[:-6], atol=1e-9)
    np.testing.assert_allclose(now[-1], was[-1], atol=1e-9)
    wrists = [walk.skeleton.index(name) for name in ("R_wrist", "L_wrist")]
    bend = [np.linalg.norm(np.diff(each[-7:, wrists[0]], 2, axis=0), axis=-1) for each in (was, now)]
    assert bend[1].max() < bend[0].max()
    free = walk.skeleton.index("L_elbow")  # strength 0
    np.testing.assert_allclose(after.rotations[:, free], plain.rotations[:, free], atol=1e-9)
    held = np.repeat(stands(plain.contacts), 2, axis=1)[-6:-1]
    moved = np.linalg.norm((now - was)[-6:-1][:, list(walk.skeleton.feet)], axis=-1)
    assert held.any()
    assert moved[held].max() < 2e-3
    assert np.linalg.norm((now - was)[-6:-1], axis=-1).max() > 5e-3


def test_a_loop_that_misses_a_bar_by_far_is_judged_once(walk):
    cycle = next(iter(cycles(walk, walk.contacts, 6, 100)))
    asked: list[object] = []
    assert eased(walk, walk.contacts, cycle, 6, lambda loop: asked.append(loop) or Fault(3.0, "far")) == Fault(3, "far")
    assert len(asked) == 1


def test_the_reason_of_a_refusal_is_the_bar_that_is_missed_most(walk):
    """Of two bars that are missed, the smaller miss would say that the motion is nearly a loop."""
    bars = Bars(walk)
    faults = 0
    for cycle in cycles(walk, walk.contacts, 6, 60):
        begun = cycle.first + 5, cycle.last  # no whole gaits: its blend hurries
        found = bars.best(closed(walk, walk.contacts, replace(cycle, first=begun[0], last=begun[1]), 6))
        if isinstance(found, Fault) and "in the blend" in found.reason:
            faults += 1
            assert found.excess > 1.5
    assert faults > 10


@pytest.mark.parametrize("window", [10**6, 40, 6])
def test_a_blend_is_as_long_as_asked_but_leaves_the_first_frame_of_the_cycle(walk, window):
    cycle = next(iter(cycles(walk, walk.contacts, 6, 100)))
    whole = cycle.last - cycle.first
    made = closed(walk, walk.contacts, cycle, window)
    assert made.blend == min(window, whole - 1)
    np.testing.assert_allclose(made.rotations[0], walk.rotations[cycle.first], atol=1e-6)


def test_a_body_in_place_has_its_root_over_the_origin_at_its_height(walk):
    there = in_place(walk.joints)
    assert not there[:, 0, [0, 2]].any()
    np.testing.assert_allclose(there[..., 1], walk.joints[..., 1])
    np.testing.assert_allclose(there - there[:, :1], walk.joints - walk.joints[:, :1], atol=1e-6)
