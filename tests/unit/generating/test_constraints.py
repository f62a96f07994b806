"""Motions with constraints: of tiny bundles with random weights, and the parts of the fit."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.generate.poses import with_poses
from marey.generation.candidates import DrawPlan
from marey.generation.constraints import choose, draw, fit
from marey.generation.constraints.constraint_set import asked_of
from marey.generation.constraints.draw import constrained_clips, constrained_request
from marey.generation.constraints.playing import played
from marey.generation.constraints.timing import NO_JUMPS, Timing, play_times
from marey.generation.port import Request
from marey.generation.shots.dispatch import generate_any
from marey.items.constraints import read_constraints
from marey.motion.arrange import placement_of
from marey.motion.clip import MotionClip
from marey.motion.courses import stand_clock
from marey.motion.curves import fades, smooth_open, through
from marey.motion.edits.licences import terms_with
from marey.motion.feet import clean_feet, find_contacts, skate
from marey.motion.kinematics import forward_kinematics
from marey.motion.pose import solve_pose
from marey.motion.resample import interpolate, interpolate_rotations
from marey.motion.rotations import rotate
from marey.motion.skeleton import HUMANML3D
from marey.quality.record import Flag, read_quality
from marey.registry import get_model, resolve
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from tests.support import bodies
from tests.support.models import random_bundle

FRAMES = 60
AT = [*range(0, FRAMES, 6), FRAMES - 1]


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Any:
    spec = get_model("hgm3")
    assert spec.training is not None
    config = replace(resolve(spec.training.config)("tiny"), max_frames=196)
    bundle = random_bundle("hgm3", tmp_path_factory.mktemp("models") / "hgm3", config=config, seed=0)
    return resolve(spec.load)(bundle, device="cpu", threads=1)


def request(generator: Any, seed: int = 0, prompt: str = "a person walks") -> Request:
    graph = build_graph(prompt, (), max_actions=8, max_specifics=16)
    drawn = np.random.default_rng(int.from_bytes(hashlib.sha256(prompt.encode()).digest()[:4], "little"))
    nodes = drawn.standard_normal((len(graph.nodes), generator.limits.text_width)).astype(np.float16)
    return Request(TextFeatures(prompt, prompt, graph, nodes), seed, FRAMES)


def line(start: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> dict[str, Any]:
    way = np.linspace(0, 2.0, FRAMES)[AT]
    places = [[start[0] + float(np.sin(turn)) * w, start[1] + float(np.cos(turn)) * w] for w in way.tolist()]
    return {"type": "root_path", "frames": AT, "positions_xz": places, "heading_radians": [turn] * len(AT)}


POSE = {"type": "pose_keyframe", "frame": FRAMES - 1, "joint_rotations": [[1.0, 0.0, 0.0, 0.0]] * len(HUMANML3D)}


def hand(clip_frame: int = 30) -> dict[str, Any]:
    return {"type": "effector_target", "joint": "left_wrist", "frames": [clip_frame], "positions": [[0.35, 1.1, 1.3]]}


def make(generator: Any, constraints: list[dict[str, Any]], *seeds: int, fps: float | None = None) -> list[MotionClip]:
    read, plan = read_constraints(constraints), DrawPlan(fps)
    asked = [constrained_request(generator, request(generator, seed), read, 3.0, fps) for seed in seeds]
    made = constrained_clips(generator, asked, [read] * len(asked), generator.settings({}), plan)
    assert all(clip is not None for clip in made)
    return [clip for clip in made if clip is not None]


def in_given_space(clip: MotionClip) -> np.ndarray[Any, Any]:
    turn, shift = placement_of(clip)
    return rotate(turn, clip.joints.astype(np.float64)) + shift


def test_a_path_a_pose_and_a_hand_are_met_at_once(generator: Any) -> None:
    (clip,) = make(generator, [line(), POSE, hand()], 0)
    quality = read_quality(clip.manifest)
    assert quality is not None
    assert quality.constraints is not None
    assert [error.type for error in quality.constraints] == ["root_path", "pose_keyframe", "effector_target"]
    assert not any(error.missed for error in quality.constraints)
    assert Flag.CONSTRAINT_MISSED not in quality.flags
    joints = in_given_space(clip)
    far = np.linalg.norm(joints[AT, 0][:, [0, 2]] - np.array(line()["positions_xz"]), axis=1)
    assert far.mean() < 0.10
    assert np.linalg.norm(joints[30, HUMANML3D.index("L_wrist")] - hand()["positions"][0]) < 0.03
    assert clip.frames == FRAMES
    assert clip.manifest["constraints"] == read_constraints([line(), POSE, hand()])


def test_a_path_elsewhere_is_moved_to_the_origin_and_the_move_is_kept(generator: Any) -> None:
    (clip,) = make(generator, [line((3.0, -2.0), 1.2)], 0)
    assert np.abs(clip.root[0, [0, 2]]).max() < 0.02
    placement = clip.manifest["placement"]
    assert placement["x"] == pytest.approx(3.0, abs=0.05)
    assert placement["z"] == pytest.approx(-2.0, abs=0.05)
    assert placement["heading"] == pytest.approx(1.2, abs=0.3)
    far = in_given_space(clip)[AT, 0][:, [0, 2]] - np.array(line((3.0, -2.0), 1.2)["positions_xz"])
    assert np.linalg.norm(far, axis=1).mean() < 0.10


def test_a_motion_does_not_depend_on_its_batch(generator: Any) -> None:
    together, (alone,) = make(generator, [line(), hand()], 3, 4), make(generator, [line(), hand()], 4)
    assert together[1].to_npz() == alone.to_npz()
    assert together[0].to_npz() != alone.to_npz()


def test_frames_are_those_of_the_output(generator: Any) -> None:
    target = {**hand(60), "frames": [60]}
    (clip,) = make(generator, [target], 0, fps=40.0)
    assert np.linalg.norm(in_given_space(clip)[60, HUMANML3D.index("L_wrist")] - target["positions"][0]) < 0.03


def test_a_missed_constraint_is_flagged(generator: Any) -> None:
    far = {**hand(), "positions": [[0.0, 2.55, 0.0]]}
    (clip,) = make(generator, [line(), far], 0)
    quality = read_quality(clip.manifest)
    assert quality is not None
    assert quality.constraints is not None
    assert Flag.CONSTRAINT_MISSED in quality.flags
    assert quality.constraints[1].max_m > 0.03


def test_the_path_decides_the_length(generator: Any) -> None:
    free = replace(request(generator), frames=100)
    asked = constrained_request(generator, free, read_constraints([line()]), None, None)
    assert asked.frames == FRAMES


def test_a_clip_reaches_to_the_last_constraint(generator: Any) -> None:
    short = replace(request(generator), frames=30)
    pose = {**POSE, "frame": 89}
    assert constrained_request(generator, short, read_constraints([line(), pose]), None, None).frames == 90
    assert constrained_request(generator, short, read_constraints([pose]), None, None).frames == 90
    longer = replace(request(generator), frames=100)
    assert constrained_request(generator, longer, read_constraints([pose]), None, None).frames == 100


def test_a_path_may_end_at_the_length_of_the_clip(generator: Any) -> None:
    timed = {"type": "root_path", "times": [0, 1.5, 3], "positions_xz": [[0, 0], [0, 0.9], [0, 1.8]]}
    (clip,) = make(generator, [timed], 0)
    assert np.abs(in_given_space(clip)[-1, 0, [0, 2]] - [0, 1.8]).max() < 0.25
    late = {**timed, "times": [0, 1.5, 3.1]}
    with pytest.raises(InvalidInput, match="beyond the clip"):
        make(generator, [late], 0)


@pytest.mark.parametrize(
    ("constraint", "where", "message"),
    [
        ({**POSE, "joint_rotations": {"tail": [1, 0, 0, 0]}}, "constraints.0.joint_rotations", "unknown joint 'tail'"),
        ({**POSE, "joint_rotations": {"pelvis": [1, 0, 0, 0]}}, "constraints.0.joint_rotations", "'L_hip' is missing"),
        ({**POSE, "joint_rotations": [[1, 0, 0, 0]] * 21}, "constraints.0.joint_rotations", "21 rotations"),
        ({**POSE, "frame": FRAMES}, "constraints.0.frame", "beyond the clip"),
    ],
)
def test_refused(generator: Any, constraint: dict[str, Any], where: str, message: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        constrained_request(generator, request(generator), read_constraints([constraint]), 3.0, None)
    assert refused.value.where == where
    assert message in refused.value.message


@pytest.mark.parametrize(
    ("place", "target", "far"),
    [
        ({"root_position": [0.0, 0.95, 1.0]}, ("head", [0.25, 0.95, 1.0]), "6"),
        ({"root_height": 0.95}, ("pelvis", [3.0, 0.75, 1.0]), "20 cm"),
        ({}, ("left_foot", [0.0, 1.2, 0.0]), "1"),
    ],
)
def test_a_target_that_the_pose_of_its_frame_contradicts_is_refused(
    generator: Any, place: dict[str, Any], target: tuple[str, list[float]], far: str
) -> None:
    joint, wanted = target
    reach = {"type": "effector_target", "joint": joint, "frames": [FRAMES - 1], "positions": [wanted]}
    earlier = {**reach, "frames": [FRAMES - 21]}
    constrained_request(generator, request(generator), read_constraints([{**POSE, **place}, earlier]), 3.0, None)
    with pytest.raises(InvalidInput, match=rf"is {far}.* from the place that the pose of constraints\.0") as refused:
        constrained_request(generator, request(generator), read_constraints([{**POSE, **place}, reach]), 3.0, None)
    assert refused.value.where == "constraints.1.positions.0"


def test_a_pose_is_read_from_a_motion_file(generator: Any, tmp_path: Path) -> None:
    (clip,) = make(generator, [hand()], 5)
    clip.save_npz(tmp_path / "pose.npz")
    named = {"type": "pose_keyframe", "frame": 59, "motion": {"file": "pose.npz", "frame": 7}}
    (read,) = with_poses(read_constraints([named]), tmp_path)
    assert read["root_height"] == pytest.approx(float(clip.root[7, 1]))
    (posed,) = make(generator, [read], 0)
    quality = read_quality(posed.manifest)
    assert quality is not None
    assert quality.constraints is not None
    assert quality.constraints[0].max_m < 0.05
    for wrong, field in (
        ({"file": "pose.npz", "frame": 600}, "frame"),
        ({"file": "none.npz", "frame": 0}, "file"),
        ({"id": "0199", "frame": 0}, "id"),
    ):
        with pytest.raises(InvalidInput) as refused:
            with_poses(read_constraints([{**named, "motion": wrong}]), tmp_path)
        assert refused.value.where == f"constraints.0.motion.{field}"


def test_a_pose_passes_its_terms_on(generator: Any) -> None:
    closed = {**POSE, "licence": "CC-BY-NC-4.0"}
    plain, bound = make(generator, [POSE], 0)[0], make(generator, [closed], 0)[0]
    assert plain.manifest["licence"] == generator.bundle.manifest.licence
    assert bound.manifest["licence"] == "CC-BY-NC-4.0"
    np.testing.assert_array_equal(plain.joints, bound.joints)


def test_terms_that_exclude_each_other_are_refused(generator: Any) -> None:
    shared, closed = {**POSE, "licence": "CC-BY-SA-4.0"}, {**POSE, "frame": 3, "licence": "CC-BY-NC-4.0"}
    with pytest.raises(InvalidInput, match="no licence satisfies both") as refused:
        constrained_request(generator, request(generator), [shared, closed], None, None)
    assert refused.value.where == "constraints.1.licence"
    assert terms_with("MIT", [line(), shared]) == "CC-BY-SA-4.0"
    assert terms_with("MIT", [line(), POSE]) == "MIT"


def test_the_terms_of_a_file_are_those_of_its_manifest(generator: Any, tmp_path: Path) -> None:
    (clip,) = make(generator, [POSE], 0)
    replace(clip, manifest={**clip.manifest, "licence": "CC-BY-NC-4.0"}).save_npz(tmp_path / "pose.npz")
    named = {"type": "pose_keyframe", "frame": 5, "motion": {"file": "pose.npz", "frame": 7}, "licence": "MIT"}
    (read,) = with_poses(read_constraints([named]), tmp_path)
    assert read["licence"] == "CC-BY-NC-4.0"


def test_smoothing_keeps_both_ends() -> None:
    values = np.random.default_rng(0).standard_normal((50, 2)).cumsum(axis=0)
    smoothed = smooth_open(values, 4.0)
    assert np.allclose(smoothed[[0, -1]], values[[0, -1]])
    assert np.abs(np.diff(smoothed, 2, axis=0)).mean() < 0.3 * np.abs(np.diff(values, 2, axis=0)).mean()


def test_a_curve_passes_through_its_points() -> None:
    frames, values = np.array([0.0, 7.0, 20.0]), np.array([[0.0, 1.0], [2.0, 0.0], [2.5, 4.0]])
    assert np.allclose(through(frames, values, frames), values)
    assert np.allclose(
        through(frames, values, np.array([-1.0]))[0] - values[0],
        values[0] - through(frames, values, np.array([1.0]))[0],
        atol=0.1,
    )


def test_changes_are_whole_at_their_frames_and_fade() -> None:
    changes = fades(np.array([10, 40]), np.array([[1.0], [-2.0]]), np.array([5.0, 5.0]), 60)
    assert changes[[10, 40], 0].tolist() == [1.0, -2.0]
    assert not changes[[0, 5, 16, 34, 46], 0].any()
    near = fades(np.array([10, 14]), np.array([[1.0], [1.0]]), np.array([5.0, 5.0]), 60)
    assert np.allclose(near[10:15], 1.0)


def test_time_is_played_faster_or_cut_where_speeds_ask_for_it() -> None:
    natural = np.concatenate([np.zeros(30), np.full(70, 1.0)])
    asked, weight = np.full(60, 1.0), np.ones(60)
    timing = play_times(natural, asked, weight, 20.0, NO_JUMPS)
    assert timing.times[0] >= 25  # the stand before the walk is cut
    assert (np.diff(timing.times) >= 0).all()
    assert play_times(natural, np.zeros(100), np.zeros(100), 20.0, NO_JUMPS).times.tolist() == [*range(100)]


def test_a_standing_foot_has_one_moment() -> None:
    stands = np.zeros(60, bool)
    stands[10:25], stands[35:50] = True, True
    clock, still = stand_clock(stands, 20.0)
    assert set(clock[10:25]) == {17.0}
    assert set(clock[35:50]) == {42.0}
    assert (np.diff(clock) >= 0).all()
    assert still[10:25].all()
    assert not still[27:33].any()


def test_most_of_a_difference_of_speeds_is_played_faster() -> None:
    timing = play_times(np.full(120, 1.0), np.full(60, 1.5), np.ones(60), 20.0, NO_JUMPS)
    assert 1.15 < np.diff(timing.times)[10:-10].mean() < 1.25


def steady_walk() -> MotionClip:
    """A walk whose standing feet do not move."""
    joints, contacts = clean_feet(bodies.walker(turn=0, cadence=1.8), HUMANML3D, 20.0)
    pose = solve_pose(joints, HUMANML3D, fps=20.0)
    return MotionClip.of(pose.skeleton, pose.rotations, pose.root, contacts, 20.0)


def test_feet_stand_as_still_at_other_moments() -> None:
    clip = steady_walk()
    times = np.linspace(3.0, clip.frames - 4.0, round(1.2 * clip.frames))
    motion = played(clip, Timing(times, (), 0.0))
    turns, root = interpolate_rotations(clip.rotations, times), interpolate(clip.root.astype(float), times)
    by_itself = forward_kinematics(HUMANML3D, turns, root)
    stands = clip.contacts[np.floor(times).astype(int)] & clip.contacts[np.ceil(times).astype(int)]
    speeds = [skate(joints, stands, HUMANML3D, 20.0) for joints in (motion.joints(HUMANML3D), by_itself)]
    assert speeds[0] < 0.002
    assert speeds[0] < 0.6 * speeds[1]


def test_feet_stand_on_a_faster_curve_as_they_do_straight_on(monkeypatch: pytest.MonkeyPatch) -> None:
    clip = steady_walk()
    frames, turn = round(0.8 * clip.frames), 1.5
    radius = float(np.linalg.norm(clip.root[-1, [0, 2]] - clip.root[0, [0, 2]])) / turn
    angle = np.linspace(0.0, turn, frames)
    places = radius * np.stack([1 - np.cos(angle), np.sin(angle)], axis=1)
    at = [*range(0, frames - 1, 5), frames - 1]
    path = {"type": "root_path", "frames": at, "positions_xz": places[at].tolist()}
    asked = asked_of(read_constraints([path]), HUMANML3D, frames, 20.0)

    def speed() -> float:
        joints = fit.fit_clip(clip, asked).joints.astype(np.float64)
        return 100 * skate(joints, find_contacts(joints, HUMANML3D, 20.0), HUMANML3D, 20.0)

    assert speed() < 0.01  # cm/s
    monkeypatch.setattr(fit, "with_locked_feet", lambda motion, *_: motion)
    assert speed() > 0.1


def test_a_candidate_whose_toes_stand_stiller_is_better(generator: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    clip = steady_walk()
    drift = np.outer(np.linspace(0.0, 1.0, clip.frames), [0.0, 0.0, 0.002 * clip.frames])  # 4 cm/s
    drifting = MotionClip.of(clip.skeleton, clip.rotations, clip.root + drift, clip.contacts, clip.fps)
    ranks: list[float] = []
    for made in (clip, drifting):
        monkeypatch.setattr(choose, "fit_clip", lambda *_, made=made: made)
        asked = asked_of((), HUMANML3D, clip.frames, 20.0)
        fitted = choose.fit_candidate(made, request(generator), asked, 0.0)
        sliding = read_quality(fitted.clip.manifest)
        assert sliding is not None
        ranks.append(fitted.rank[3] + choose.SLIDING * sliding.skate)
    assert ranks[0] - ranks[1] == pytest.approx(choose.TOES * 0.04, abs=0.05)


def test_candidates_for_a_path_keep_from_the_longest_motion_of_the_model(
    generator: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[int | None] = []

    def noted(model: Any, requests: list[Request], *given: Any, **more: Any) -> Any:
        asked.extend(each.frames for each in requests)
        return generate_any(model, requests, *given, **more)

    monkeypatch.setattr(draw, "generate_any", noted)
    most = generator.limits.max_frames
    for frames in (most - 8, most):
        asked.clear()
        path = {"type": "root_path", "frames": [0, frames - 1], "positions_xz": [[0, 0], [0, 4]]}
        made = make_frames(generator, [path], frames)
        assert made.frames == frames
        assert asked[0] == frames  # as long as the clip
        assert max(each or 0 for each in asked) == max(round(draw.LONGEST_SHARE * most), frames)


def make_frames(generator: Any, constraints: list[dict[str, Any]], frames: int) -> MotionClip:
    """The motion of so many frames that meets constraints."""
    own = constrained_request(generator, replace(request(generator), frames=frames), constraints, frames / 20, None)
    (clip,) = constrained_clips(generator, [own], [constraints], generator.settings({}), DrawPlan())
    assert clip is not None
    return clip
