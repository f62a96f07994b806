"""Cuts of long captures at still moments."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import Conflict, InvalidInput
from marey.data.index import parse_index
from marey.data.segment import SegmentRule, effectors, find_troughs, mean_speed, segment, stillness
from marey.data.segment_files import segment_files
from marey.motion.clip import MotionClip
from marey.motion.kinematics import forward_kinematics
from marey.motion.skeleton import HUMANML3D, KIT, SNAPMOGEN, Skeleton
from tests.support.motions import dancer

FPS = 30.0


@lru_cache(maxsize=8)
def capture(seconds: float, seed: int = 0):
    """Joints of a dancer who stands still for a second in every five."""
    rotations, root = dancer(seed, round(seconds * FPS))
    time = np.arange(len(root)) / FPS
    pace = np.clip(np.abs((time % 5.0) - 2.5) < 2.0, 0.0, 1.0)
    passed = np.minimum((np.cumsum(pace)).astype(int), len(root) - 1)
    return forward_kinematics(HUMANML3D, rotations[passed], root[passed])


def clip_of(seconds: float, seed: int = 0) -> MotionClip:
    rotations, root = dancer(seed, round(seconds * FPS))
    return MotionClip.of(HUMANML3D, rotations, root, np.zeros((len(root), 4), bool), FPS)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 1500), st.integers(0, 20), st.floats(0, 1), st.floats(0.1, 4), st.floats(2, 4))
def test_every_piece_has_an_allowed_length_and_all_together_the_capture(frames, seed, share, shortest, times):
    joints = capture(50)[:frames]
    rule = SegmentRule(shortest, shortest * times, share, seed=seed)
    found = segment(joints, HUMANML3D, FPS, rule, name="a")
    longest = max(int(shortest * times * FPS), 1)
    least = max(min(int(np.ceil(shortest * FPS)), longest // 2), 1)
    if len(joints) < least:
        assert found.pieces == ()
        return
    assert found.pieces[0][0] == 0
    assert found.pieces[-1][1] == len(joints)
    for (first, end), (after, _) in zip(found.pieces, (*found.pieces[1:], (len(joints), 0)), strict=True):
        assert end == after
        assert least <= end - first <= longest


def test_drawn_cuts_are_troughs_and_still_moments_are_preferred():
    joints = np.concatenate([capture(200, seed) for seed in range(3)])
    found = segment(joints, HUMANML3D, FPS, SegmentRule(), name="a")
    drawn = [cut for cut in found.cuts if cut not in found.forced]
    assert set(drawn) <= set(found.troughs)
    stillness_at = dict(zip(found.troughs, found.rho.tolist(), strict=True))
    assert len(drawn) > 20
    assert np.mean([stillness_at[cut] for cut in drawn]) > found.rho.mean()
    assert 5 < np.mean([end - first for first, end in found.pieces]) / FPS < 10


def test_the_longest_may_be_twice_the_shortest_at_any_rate():
    for frames in range(200, 240):
        rule = SegmentRule(1.001, 2.002, share=0.0)
        found = segment(capture(50)[:frames], HUMANML3D, 100.0, rule, name="a")
        assert all(100 <= end - first <= 200 for first, end in found.pieces)


def test_without_draws_the_stillest_frames_within_the_longest_are_cut():
    joints = capture(40)
    found = segment(joints, HUMANML3D, FPS, SegmentRule(share=0.0), name="a")
    assert found.forced == frozenset(found.cuts)
    first = found.cuts[0]
    assert found.speed[first] == found.speed[120:361].min()


def test_the_seed_and_the_name_decide_the_cuts():
    joints = capture(120)
    cuts = {
        (seed, name): segment(joints, HUMANML3D, FPS, SegmentRule(seed=seed), name=name).cuts
        for seed, name in ((0, "a"), (1, "a"), (0, "b"))
    }
    assert cuts[0, "a"] == segment(joints, HUMANML3D, FPS, SegmentRule(), name="a").cuts
    assert len(set(cuts.values())) == 3


def test_stillness_is_one_at_the_lowest_trough():
    np.testing.assert_allclose(stillness(np.array([0.2, 0.5, 0.1])), [0.75, 0.0, 1.0])
    np.testing.assert_allclose(stillness(np.array([0.2, 0.2])), 1.0)
    assert stillness(np.zeros(0)).shape == (0,)


def test_troughs_are_inner_minima_and_the_middle_of_flat_ones():
    assert find_troughs(np.array([0.0, 2, 1, 3, 1, 1, 1, 5, 4])).tolist() == [2, 5]
    assert find_troughs(np.array([3.0, 2, 1])).tolist() == []
    assert find_troughs(np.ones(5)).tolist() == []


def test_speed_is_in_metres_a_second_and_smoothed():
    joints = np.zeros((90, 2, 3))
    joints[:, 0, 0] = 0.05 * np.arange(90)
    np.testing.assert_allclose(mean_speed(joints, 30, 0.25), 0.75, atol=1e-9)
    noise = np.random.default_rng(0).normal(size=(300, 1, 3))
    assert mean_speed(noise, 30, 0.25).std() < 0.4 * mean_speed(noise, 30, 0.0).std()


@pytest.mark.parametrize(
    ("skeleton", "names"),
    [
        (HUMANML3D, {"pelvis", "L_foot", "R_foot", "head", "L_wrist", "R_wrist"}),
        (KIT, {"root", "LF", "RF", "BUN", "LW", "RW"}),
        (
            SNAPMOGEN,
            {"ROOT", "C_head_bind_JNT", *(f"{s}_{j}_bind_JNT" for s in "LR" for j in ("hand0001", "foot0002"))},
        ),
    ],
    ids=lambda each: getattr(each, "name", ""),
)
def test_hip_head_hands_and_feet_are_measured(skeleton, names):
    assert {skeleton.joint_names[j] for j in effectors(skeleton)} == names


def test_fingers_count_as_one_hand():
    names = (*HUMANML3D.joint_names, *(f"L_finger{k}{part}" for k in range(5) for part in (1, 2)))
    parents = [*HUMANML3D.parents]
    offsets = [*HUMANML3D.offsets]
    for k in range(5):
        parents += [HUMANML3D.index("L_wrist"), len(parents)]
        offsets += [np.array([0.08, 0, 0.02 * k], np.float32), np.array([0.04, 0, 0], np.float32)]
    body = Skeleton("hands", names, tuple(parents), np.array(offsets, np.float32), tuple(range(len(names))))
    assert effectors(body) == effectors(HUMANML3D)


@pytest.mark.parametrize(
    "values",
    [
        {"shortest": 0},
        {"shortest": 7, "longest": 12},
        {"longest": float("inf")},
        {"share": 1.5},
        {"sigma": -1},
        {"sigma": float("nan")},
    ],
)
def test_parameters_out_of_bounds_are_refused(values):
    with pytest.raises(InvalidInput):
        SegmentRule(**values)


def test_the_command_line_writes_an_index_and_pictures(tmp_path):
    clip_of(40).save_npz(tmp_path / "long.npz")
    clip_of(2).save_npz(tmp_path / "short.npz")
    files = [str(tmp_path / name) for name in ("long.npz", "short.npz")]
    run = CliRunner().invoke(app, ["data", "segment", *files, "-o", str(tmp_path / "out"), "--seed", "3"])
    assert run.exit_code == 0, run.output
    assert "shorter than 4 s, left out" in run.output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["index.csv", "long.png", "short.png"]
    rows = parse_index((tmp_path / "out" / "index.csv").read_text(), {}, "index.csv")
    found = segment(clip_of(40).joints, HUMANML3D, FPS, SegmentRule(seed=3), name="long")
    assert [(row.start, row.end) for row in rows] == list(found.pieces)
    assert {row.stem for row in rows} == {"long.npz"}
    with Image.open(tmp_path / "out" / "long.png") as image:
        colours = {colour for _, colour in image.convert("RGB").getcolors(2**20) or []}
    assert {(56, 134, 214), (236, 122, 48)} & colours, "cuts are drawn"


def test_a_broken_file_or_two_of_one_name_leave_nothing(tmp_path):
    clip_of(5).save_npz(tmp_path / "a.npz")
    (tmp_path / "a.bvh").write_text("HIERARCHY\n")
    with pytest.raises(InvalidInput, match="two files are called a"):
        segment_files([tmp_path / "a.npz", tmp_path / "a.bvh"], tmp_path / "out", SegmentRule())
    (tmp_path / "b.npz").write_bytes(b"no")
    with pytest.raises(Exception, match=r"b\.npz"):
        segment_files([tmp_path / "a.npz", tmp_path / "b.npz"], tmp_path / "out", SegmentRule())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bvh", "a.npz", "b.npz"]
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("mine")
    with pytest.raises(Conflict):
        segment_files([tmp_path / "a.npz"], tmp_path / "out", SegmentRule())
