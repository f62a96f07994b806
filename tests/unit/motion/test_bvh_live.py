"""The BVH that grows: whole at every moment, and the same numbers as a clip written at once."""

from __future__ import annotations

import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marey.core.errors import Conflict, InvalidInput, TooLarge
from marey.motion.clip import MotionClip
from marey.motion.io import bvh_live
from marey.motion.io.bvh import format_bvh, parse_bvh, read_bvh
from marey.motion.io.bvh_live import COUNT_WIDTH, PAGE, LiveBVH
from marey.motion.rotations import angle_between, slerp
from marey.motion.skeleton import HUMANML3D, SKELETONS
from tests.support.exported import tumbling
from tests.support.motions import dancer
from tests.support.walker import walker

REPOSITORY = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("fps", [0.0, -20.0, float("nan"), float("inf")])
def test_a_rate_that_cannot_be_is_refused_and_nothing_is_written(tmp_path: Path, fps: float) -> None:
    with pytest.raises(InvalidInput, match=r"a\.bvh: .*frames per second is out of range"):
        LiveBVH(tmp_path / "a.bvh", HUMANML3D, fps)
    assert list(tmp_path.iterdir()) == []


@dataclass(frozen=True)
class Write:
    """One write to the file."""

    at: int
    data: bytes


class Recorded(bvh_live.FileIO):
    """The file, with what was written to it."""

    writes: list[Write]

    def write(self, data) -> int:
        self.writes.append(Write(self.tell(), bytes(data)))
        return super().write(data)


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> list[Write]:
    writes: list[Write] = []
    monkeypatch.setattr(bvh_live, "FileIO", type("Recording", (Recorded,), {"writes": writes}))
    return writes


def states(begun: bytes, writes: list[Write]) -> Iterator[bytes]:
    """Every content that the file may be left with by a kill: between two writes, and within one where a page ends."""
    content = bytearray(begun)
    yield bytes(content)
    for write in writes:
        borders = range((write.at // PAGE + 1) * PAGE, write.at + len(write.data), PAGE)
        for cut in [border - write.at for border in borders] + [len(write.data)]:
            torn = bytearray(content)
            torn[write.at : write.at + cut] = write.data[:cut]
            yield bytes(torn)
        content[write.at : write.at + len(write.data)] = write.data


def rows_of(data: bytes) -> list[list[float]]:
    """The rows as Blender reads them: every line that is not blank, each with a number for each channel."""
    text = data.decode()
    lines = text[text.index("Frame Time:") :].splitlines()[1:]
    rows = [[float(word) for word in line.split()] for line in lines if line.split()]
    assert len({len(row) for row in rows}) == 1, "a row is there in part"
    return rows


def counted(data: bytes) -> int:
    return int(data[data.index(b"\nFrames:") :].split()[1])


def add_all(live: LiveBVH, clip: MotionClip) -> None:
    for turns, root in zip(clip.rotations, clip.root, strict=True):
        live.add(turns, root)


def written(path: Path, clip: MotionClip) -> bytes:
    with LiveBVH.open(path, clip.skeleton, clip.fps) as live:
        add_all(live, clip)
    return path.read_bytes()


@pytest.mark.parametrize("clip", [walker(turn=2.0, seconds=8, fps=24000 / 1001), tumbling(HUMANML3D, 20)])
def test_the_numbers_are_those_of_a_clip_that_is_written_at_once(clip: MotionClip, tmp_path: Path) -> None:
    live, whole = written(tmp_path / "a.bvh", clip), format_bvh(clip).encode()
    np.testing.assert_allclose(rows_of(live), rows_of(whole), rtol=0, atol=1.5e-6)
    mended = live.replace(f"Frames: {clip.frames:<7}".encode(), f"Frames: {clip.frames}".encode())
    assert mended.split(b"Frame Time")[0] == whole.split(b"Frame Time")[0]
    assert b"\nFrame Time: 0.0" in live
    assert live.endswith(b"\n")


def test_frames_in_float32_are_written_as_the_same_numbers(tmp_path: Path) -> None:
    clip = tumbling(HUMANML3D, 20)
    frames = [(r.astype(np.float32), p.astype(np.float32)) for r, p in zip(clip.rotations, clip.root, strict=True)]
    for name, numbers in (("single", np.float32), ("double", np.float64)):
        with LiveBVH.open(tmp_path / name, clip.skeleton, clip.fps) as live:
            for rotations, place in frames:
                live.add(rotations.astype(numbers), place.astype(numbers))
    assert (tmp_path / "single").read_bytes() == (tmp_path / "double").read_bytes()


@pytest.mark.parametrize("name", SKELETONS)
def test_it_is_read_back_as_the_same_motion(name: str, tmp_path: Path) -> None:
    clip = tumbling(SKELETONS[name], 20)
    written(tmp_path / "a.bvh", clip)
    read = read_bvh(tmp_path / "a.bvh")
    order = [read.skeleton.joint_names.index(n) for n in clip.skeleton.joint_names]
    assert np.abs(read.joints()[:, order] - clip.joints).max() < 2e-5
    assert (read.fps, read.notes) == (20, ())


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_whenever_it_is_killed_the_file_is_a_whole_bvh(data, recorded: list[Write], tmp_path_factory) -> None:
    recorded.clear()
    path = tmp_path_factory.mktemp("live") / "a.bvh"
    skeleton = SKELETONS[data.draw(st.sampled_from(sorted(SKELETONS)), label="skeleton")]
    name = "r" * data.draw(st.integers(1, 1500), label="length of the root's name")  # shifts all that comes after it
    skeleton = replace(skeleton, joint_names=(name, *skeleton.joint_names[1:]))
    clip = tumbling(skeleton, 20)
    missing = data.draw(st.lists(st.sampled_from([0, 0, 0, 1, 7]), min_size=1, max_size=12), label="missing")
    with LiveBVH.open(path, skeleton, 20) as live:
        for k, lost in enumerate(missing):
            live.add(clip.rotations[k], clip.root[k], missing=lost if k else 0)
            if k == 0:
                begun = path.read_bytes()
    final = rows_of(path.read_bytes())
    seen = list(states(begun, recorded))
    assert seen[-1] == path.read_bytes()
    chosen = data.draw(st.lists(st.sampled_from(range(len(seen))), min_size=1, max_size=8), label="states")
    for state in (seen[k] for k in {*chosen, 0, len(seen) - 1}):
        rows = rows_of(state)
        assert rows == final[: len(rows)]
        assert 1 <= counted(state) <= len(rows), "three.js reads as many rows as are counted"
        assert len(parse_bvh(state, rest_frame="keep").root) == len(rows)
    assert len(final) == live.frames == len(missing) + live.filled


def test_neither_a_row_nor_the_count_lies_across_a_page(recorded: list[Write], tmp_path: Path) -> None:
    clip = walker()
    plain = written(tmp_path / "plain.bvh", clip).index(b"\nFrames: ") + len("\nFrames: ")
    moved = 0
    for shift in range(-8, 9):  # where a page ends, seen from where the count would stand
        name = clip.skeleton.joint_names[0] + "r" * (PAGE - plain + shift)
        skeleton = replace(clip.skeleton, joint_names=(name, *clip.skeleton.joint_names[1:]))
        data = written(tmp_path / f"{shift}.bvh", replace(clip, skeleton=skeleton))
        assert counted(data) == len(rows_of(data)) == clip.frames
        moved += b"\nFrames:  " in data
    assert moved == COUNT_WIDTH - 1
    assert any(write.data.startswith(b" ") for write in recorded), "some rows had to move"
    for write in recorded:
        start = write.at + len(write.data) - len(write.data.lstrip())
        assert start // PAGE == (write.at + len(write.data) - 1) // PAGE


def test_a_process_that_is_killed_leaves_a_whole_file(tmp_path: Path) -> None:
    script = """
import sys
from marey.motion.io.bvh_live import LiveBVH
from tests.support.walker import walker
clip = walker(seconds=20)
with LiveBVH.open(sys.argv[1], clip.skeleton, clip.fps) as live:
    while True:
        for turns, root in zip(clip.rotations, clip.root):
            live.add(turns, root)
"""
    for attempt, longer in enumerate((0.0, 0.05, 0.3)):
        path = tmp_path / f"{attempt}.bvh"
        child = subprocess.Popen([sys.executable, "-c", script, str(path)], cwd=REPOSITORY)
        deadline = time.monotonic() + 60
        while not path.exists():
            assert child.poll() is None
            assert time.monotonic() < deadline
        time.sleep(longer)
        child.kill()
        assert child.wait(30) == -signal.SIGKILL
        data = path.read_bytes()
        assert len(parse_bvh(data, rest_frame="keep").root) == len(rows_of(data)) >= counted(data) >= 1


def test_a_disk_without_room_leaves_the_frames_that_were_there(tmp_path: Path) -> None:
    clip, path = walker(seconds=4), tmp_path / "a.bvh"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    with LiveBVH.open(path, clip.skeleton, clip.fps) as live:
        live.add(clip.rotations[0], clip.root[0])
        resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 3000, hard))
        try:
            with pytest.raises(InvalidInput, match=r"a\.bvh: cannot be written"):
                add_all(live, clip)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        with pytest.raises(InvalidInput, match="closed"):
            live.add(clip.rotations[0], clip.root[0])
    data = path.read_bytes()
    assert len(rows_of(data)) == counted(data) == live.frames > 1


def test_missing_frames_hold_the_time_line(tmp_path: Path) -> None:
    turns, roots = dancer(frames=20)
    with LiveBVH.open(tmp_path / "a.bvh", HUMANML3D, 20) as live:
        live.add(turns[0], roots[0])
        live.add(turns[4], roots[4], missing=3)
        live.add(turns[5], roots[5])
    assert (live.frames, live.filled) == (6, 3)
    read = read_bvh(tmp_path / "a.bvh", rest_frame="keep")
    order = [read.skeleton.joint_names.index(n) for n in HUMANML3D.joint_names]
    for frame, share in ((1, 0.25), (2, 0.5), (3, 0.75), (4, 1.0)):
        np.testing.assert_allclose(read.root[frame], roots[0] + share * (roots[4] - roots[0]), atol=1e-7)
        between = slerp(turns[0], turns[4], np.array(share))
        assert angle_between(read.rotations[frame][order], between).max() < 1e-6


def test_missing_frames_before_the_first_one_show_the_first_one(tmp_path: Path) -> None:
    turns, roots = dancer(frames=2)
    with LiveBVH.open(tmp_path / "a.bvh", HUMANML3D, 20) as live:
        live.add(turns[1], roots[1], missing=2)
    rows = rows_of((tmp_path / "a.bvh").read_bytes())
    assert len(rows) == 3
    assert rows[0] == rows[1] == rows[2]


def test_channels_do_not_jump_between_frames(tmp_path: Path) -> None:
    rows = np.array(rows_of(written(tmp_path / "a.bvh", walker(turn=2.0, seconds=8))))
    assert max(np.abs(b[3:] - a[3:]).max() for a, b in pairwise(rows)) < 45
    assert np.abs(rows[:, 3:]).max() > 360


def test_a_file_that_is_there_is_refused_or_stays_until_the_first_frame(tmp_path: Path) -> None:
    path, clip = tmp_path / "a.bvh", walker()
    path.write_text("old")
    with pytest.raises(Conflict, match=r"a\.bvh: already exists"):
        LiveBVH.open(path, clip.skeleton, clip.fps)
    with LiveBVH.open(path, clip.skeleton, clip.fps, overwrite=True) as live:
        assert path.read_text() == "old"
        live.add(clip.rotations[0], clip.root[0])
        assert counted(path.read_bytes()) == 1


def test_a_closed_file_takes_no_frame(tmp_path: Path) -> None:
    turns, place = dancer(frames=2)
    with LiveBVH.open(tmp_path / "a.bvh", HUMANML3D, 20) as live:
        live.add(turns[0], place[0])
    with pytest.raises(InvalidInput, match=r"a\.bvh, frame 1: the file is closed"):
        live.add(turns[1], place[1])


def test_without_a_frame_there_is_no_file(tmp_path: Path) -> None:
    with LiveBVH.open(tmp_path / "a.bvh", HUMANML3D, 20):
        pass
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_refused_before_the_first_frame(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match=r"a\.bvh: cannot be written"):
        LiveBVH.open(tmp_path / "none" / "a.bvh", HUMANML3D, 20)
    with pytest.raises(InvalidInput, match=f"^{re.escape(str(tmp_path))}: is a folder"):
        LiveBVH.open(tmp_path, HUMANML3D, 20)


@pytest.mark.parametrize(
    ("turns", "root", "missing", "error", "message"),
    [
        (np.ones((21, 4)), np.zeros(3), 0, InvalidInput, r"\(21, 4\)"),
        (np.ones((22, 4)), np.zeros(2), 0, InvalidInput, r"root \(2,\)"),
        (np.full((22, 4), np.nan), np.zeros(3), 0, InvalidInput, "NaN"),
        (np.ones((22, 4)), np.full(3, np.inf), 0, InvalidInput, "infinite"),
        (np.ones((22, 4)), np.zeros(3), 10**9, TooLarge, "more than 1,000,000 frames"),
        (np.ones((22, 4)), np.zeros(3), -1, InvalidInput, "-1 missing"),
    ],
)
def test_a_frame_that_cannot_be_is_refused_and_the_file_goes_on(turns, root, missing, error, message, tmp_path) -> None:
    good, place = dancer(frames=2)
    with LiveBVH.open(tmp_path / "a.bvh", HUMANML3D, 20) as live:
        live.add(good[0], place[0])
        with pytest.raises(error, match=message) as refused:
            live.add(turns, root, missing=missing)
        assert str(refused.value.where).startswith(str(tmp_path / "a.bvh"))
        live.add(good[1], place[1])
    assert len(rows_of((tmp_path / "a.bvh").read_bytes())) == 2
