"""Written FBX files have nodes, property types, objects and connections that Maya and MotionBuilder write too."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.io.fbx_nodes import MAGIC
from marey.motion.io.fbx_write import format_fbx
from tests.support.archives import archive
from tests.support.fbx_structure import Structure, joined, structure_of
from tests.support.walker import walker

RECORDED = {
    name: Structure(**rows)
    for name, rows in json.loads(Path(__file__).with_name("fbx_structure.json").read_text(encoding="utf-8")).items()
}
"""Structure of files by other programs, see `tests.support.fbx_structure`."""
KNOWN = joined(list(RECORDED.values()))
CLIP = walker(seconds=0.5)
WRITTEN = {
    "plain": {},
    "body": {"mesh": True, "root_bone": True},
    "metres, Z up": {"unit": "m", "up": "z", "mesh": True},
    "T-pose": {"tpose_frame": True},
    "mixamo": {"rig": "mixamo"},
    "ue4": {"rig": "ue4"},
}


def check(data: bytes) -> None:
    ours = structure_of(data)
    assert ours.top == KNOWN.top
    assert set(ours.nodes) - set(KNOWN.nodes) == set()
    assert set(ours.objects) - set(KNOWN.objects) == set()
    assert set(ours.connections) - set(KNOWN.connections) == set()


@pytest.mark.parametrize("name", WRITTEN)
def test_structure_is_that_of_files_by_maya_and_motionbuilder(name: str) -> None:
    check(exporter_of("fbx").write(CLIP, Coordinates(**WRITTEN[name])))


def test_both_programs_are_recorded_with_bind_poses_skins_and_curves() -> None:
    for program in ("maya", "motionbuilder"):
        kinds = joined([each for name, each in RECORDED.items() if name.startswith(program)])
        assert {"Pose Pose BindPose", "Deformer SubDeformer Cluster"} <= set(kinds.objects)
        assert "OP AnimationCurve/ AnimationCurveNode/ d|X" in kinds.connections
        assert "/Objects/Pose/PoseNode/Matrix d" in kinds.nodes


@pytest.mark.parametrize(
    ("old", "new"),
    [(b"BindPose", b"BindPosf"), (b"NbPoseNodes", b"NbPoseNodez"), (b"d|X", b"d|W"), (b"LimbNode", b"LimbNodf")],
)
def test_another_structure_is_noticed(old: bytes, new: bytes) -> None:
    data = format_fbx(CLIP)
    check(data)
    with pytest.raises(AssertionError):
        check(data.replace(old, new))


@pytest.mark.data
def test_the_record_is_that_of_the_file_by_maya() -> None:
    name = "maya_human_ik_7400_binary.fbx"
    assert structure_of(archive(f"rigs/{name}").read_bytes()) == RECORDED[name]


@pytest.mark.data
def test_nodes_over_a_rig_are_written_as_maya_writes_them() -> None:
    ours = structure_of(exporter_of("fbx").write(CLIP, Coordinates(rig=str(archive("rigs/rig-human.glb")))))
    assert set(ours.nodes) - set(KNOWN.nodes) == set()
    assert set(ours.connections) - set(KNOWN.connections) == {"OP AnimationCurveNode/ Model/Null Lcl Rotation"}


def node_ends(data: bytes, at: int, end: int) -> None:
    """Walk the nodes of a list, which ends in 13 bytes of zero, up to where their parent says that it ends."""
    while True:
        stop, _, size, length = struct.unpack_from("<IIIB", data, at)
        if stop == 0:
            assert data[at : at + 13] == bytes(13)
            assert at + 13 == end or end == 0
            return
        start = at + 13 + length + size
        assert start <= stop
        if start < stop:
            node_ends(data, start, stop)
        at = stop


@pytest.mark.parametrize("name", WRITTEN)
def test_every_list_of_nodes_has_its_end(name: str) -> None:
    data = exporter_of("fbx").write(CLIP, Coordinates(**WRITTEN[name]))
    node_ends(data, len(MAGIC) + 4, 0)
