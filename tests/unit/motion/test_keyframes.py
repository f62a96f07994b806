"""Poses that constraints name as frames of motions."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput, NotFound, TooLarge
from marey.motion.keyframes import (
    MAX_FILE,
    PoseFiles,
    beyond,
    ordered_rotations,
    plain_name,
    pose_of,
    read_constraints_file,
    with_pose,
)
from marey.motion.skeleton import HUMANML3D
from tests.support.walker import walker

CLIP = replace(walker(seconds=0.5), manifest={"licence": "CC-BY-4.0"})
TURNS: list[list[float]] = [[1.0, 0.0, 0.0, number / 100] for number in range(22)]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    CLIP.save_npz(tmp_path / "pose.npz")
    return tmp_path


def named(frame: int, **fields: Any) -> dict[str, Any]:
    return {"type": "pose_keyframe", "frame": 7, "motion": {"file": "pose.npz", "frame": frame}, **fields}


def test_a_frame_is_the_turns_of_its_joints_its_height_and_its_terms() -> None:
    pose = pose_of(CLIP, 3)
    assert list(pose["joint_rotations"]) == list(HUMANML3D.joint_names)
    np.testing.assert_allclose(list(pose["joint_rotations"].values()), CLIP.rotations[3])
    assert pose["root_height"] == float(CLIP.root[3, 1])
    assert pose["licence"] == "CC-BY-4.0"
    for terms in ({}, {"licence": ""}, {"licence": 3}):
        assert "licence" not in pose_of(replace(CLIP, manifest=terms), 3)
    json.dumps(pose)


def test_a_keyframe_gets_the_pose_and_keeps_a_place_of_its_own() -> None:
    pose = pose_of(CLIP, 3)
    assert with_pose(named(3), pose) == {"type": "pose_keyframe", "frame": 7, **pose}
    for own in ({"root_height": 0.5}, {"root_position": [0.0, 1.0, 2.0]}):
        filled = with_pose(named(3, **own), pose)
        assert {name: filled[name] for name in own} == own
        assert ("root_height" in filled) == ("root_height" in own)
        assert filled["joint_rotations"] == pose["joint_rotations"]


def test_files_are_filled_in_and_ids_are_left(folder: Path) -> None:
    stored = {"type": "pose_keyframe", "frame": 0, "motion": {"id": "00000000-0000-7000-8000-000000000000", "frame": 1}}
    path = {"type": "root_path", "points": []}
    last = CLIP.frames - 1
    found = PoseFiles(folder).fill([stored, named(last), path])
    assert found == [stored, with_pose(named(last), pose_of(CLIP, last)), path]


def test_a_frame_or_a_file_that_is_not_there_is_told_with_its_field(folder: Path) -> None:
    with pytest.raises(InvalidInput) as refused:
        PoseFiles(folder).fill([named(0), named(CLIP.frames)])
    assert (refused.value.where, refused.value.message) == (
        "constraints.1.motion.frame",
        f"frame {CLIP.frames} is beyond the motion, which has {CLIP.frames}",
    )
    assert beyond(CLIP.frames, CLIP.frames) == refused.value.message
    with pytest.raises(InvalidInput, match=r"^constraints\.0\.motion\.file: no such file"):
        PoseFiles(folder / "none").fill([named(0)])


def test_errors_of_a_file_of_constraints_name_it_and_the_field(folder: Path) -> None:
    file = folder / "constraints.json"
    file.write_text(json.dumps([named(2)]))
    assert read_constraints_file(file, json.loads) == [with_pose(named(2), pose_of(CLIP, 2))]
    file.write_text(json.dumps([named(99)]))
    with pytest.raises(
        InvalidInput, match=rf"^{re.escape(str(file))}: constraints\.0\.motion\.frame: frame 99 is beyond"
    ):
        read_constraints_file(file, json.loads)
    file.write_bytes(b" " * (MAX_FILE + 1))
    with pytest.raises(TooLarge):
        read_constraints_file(file, json.loads)
    with pytest.raises(NotFound):
        read_constraints_file(folder / "none.json", json.loads)


def test_the_hint_of_a_constraint_that_is_refused_is_kept(folder: Path) -> None:
    file = folder / "constraints.json"
    file.write_text("[]")

    def read(_: bytes) -> list[dict[str, Any]]:
        raise InvalidInput("is unknown", where="constraints.0.type", hint="Name a `pose_keyframe`.")

    with pytest.raises(InvalidInput) as refused:
        read_constraints_file(file, read)
    assert (refused.value.message, refused.value.where) == ("is unknown", f"{file}: constraints.0.type")
    assert refused.value.hint == "Name a `pose_keyframe`."


def test_turns_are_put_in_the_order_of_the_skeleton_by_either_spelling() -> None:
    long = [
        name.replace("L_", "left_", 1).replace("R_", "right_", 1) if name[1] == "_" else name
        for name in HUMANML3D.joint_names
    ]
    assert [plain_name(name) for name in long] == list(HUMANML3D.joint_names)
    for names in (HUMANML3D.joint_names, long):
        mixed = dict(reversed(list(zip(names, TURNS, strict=True))))
        assert ordered_rotations(mixed, HUMANML3D, "pose") == TURNS
    assert ordered_rotations(TURNS, HUMANML3D, "pose") == TURNS


def test_a_pose_of_another_skeleton_is_refused_with_its_field() -> None:
    by_name = dict(zip(HUMANML3D.joint_names, TURNS, strict=True))
    for given, message in (
        (TURNS[:-1], "21 rotations; the model's skeleton has 22 joints"),
        ([*TURNS, TURNS[0]], "23 rotations; the model's skeleton has 22 joints"),
        (by_name | {"tail": TURNS[0]}, "unknown joint 'tail'"),
        ({name: turn for name, turn in by_name.items() if name != "head"}, "the rotation of 'head' is missing"),
    ):
        with pytest.raises(InvalidInput, match=f"^pose: {message}"):
            ordered_rotations(given, HUMANML3D, "pose")
