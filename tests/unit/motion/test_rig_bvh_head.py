"""The rig of a BVH file takes its hierarchy and first frames: long takes cost no more than short ones."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from marey.core.errors import InvalidFile, TooLarge
from marey.exporters import Coordinates, exporters
from marey.motion.export_options import ExportOptions
from marey.motion.io import rig_bvh
from marey.motion.io.bvh import parse_bvh
from marey.motion.io.rig_bvh import FRAMES, parse_bvh_rig
from tests.support.walker import walker

DATA = exporters()["bvh"].write(walker(seconds=6.0), Coordinates.of(ExportOptions(), "cm", "y"))
MOTION_AT = DATA.index(b"\n", DATA.index(b"Frame Time")) + 1
HEADER, MOTION = DATA[:MOTION_AT], DATA[MOTION_AT:]


def take(mebibytes, motion=MOTION):
    return HEADER + motion * (mebibytes * 2**20 // len(motion))


@pytest.mark.parametrize("motion", [MOTION, MOTION.replace(b"\n", b"\r\n"), MOTION.replace(b"\n", b" ")])
def test_the_rig_of_a_long_take_takes_little_memory(motion):
    """A take of 63 MiB took 746 MiB and four seconds."""
    data, short = take(63, motion), parse_bvh_rig(DATA)
    tracemalloc.start()
    try:
        rig = parse_bvh_rig(data)
        assert tracemalloc.get_traced_memory()[1] < 16 * 2**20
    finally:
        tracemalloc.stop()
    np.testing.assert_allclose(rig.positions, short.positions)
    np.testing.assert_allclose(rig.orientations, short.orientations)
    assert rig.notes == short.notes


@pytest.mark.parametrize("pieces", [1, 3])
def test_only_first_frames_are_read(pieces):
    """Also where a frame takes several lines."""
    lines = take(1).splitlines()
    start = len(HEADER.splitlines())
    frames = [line.split() for line in lines[start:]]
    width = len(frames[0])
    rows = [b" ".join(row[at : at + width // pieces]) for row in frames for at in range(0, width, width // pieces)]
    data = HEADER + b"\n".join(rows) + b"\nno number\n"
    clip = parse_bvh(data, frames=FRAMES, rest_frame="keep")
    whole = parse_bvh(take(1), rest_frame="keep")
    assert len(clip.rotations) == FRAMES
    np.testing.assert_allclose(clip.rotations, whole.rotations[:FRAMES])
    with pytest.raises(InvalidFile, match="`no` is not a number" if pieces == 1 else "numbers"):
        parse_bvh(data)


def test_a_fault_in_the_first_frames_is_found():
    lines = take(1).splitlines(keepends=True)
    lines[len(HEADER.splitlines()) + 5] = b"1 2 3\n"
    with pytest.raises(InvalidFile, match="3 numbers"):
        parse_bvh_rig(b"".join(lines))


def test_a_short_file_is_read_whole(monkeypatch):
    monkeypatch.setattr(rig_bvh, "FRAMES", 10)
    with pytest.raises(InvalidFile, match="`oh` is not a number"):
        parse_bvh_rig(HEADER + b"".join(MOTION.splitlines(keepends=True)[:12]) + b"oh\n")


@pytest.mark.parametrize("motion", [b" " * 2**22, b"1" * 2**22, b"1 " * 2**5])
def test_motions_without_frames_are_refused(motion):
    with pytest.raises(InvalidFile):
        parse_bvh_rig(HEADER + motion)


@pytest.mark.parametrize("line", ["OFFSET 0 0 0\n", "\n", "OFFSET 0 0 0 "])
def test_an_endless_hierarchy_is_refused(line):
    with pytest.raises(TooLarge, match=r"^hero\.bvh, line \d+: .*bytes before its numbers"):
        parse_bvh_rig(b"HIERARCHY\nROOT a\n{\n" + line.encode() * 2**21, "hero.bvh")
