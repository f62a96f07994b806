"""Constraints of a motion: their canonical form, and what is refused, with the field."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.items.constraint_frames import check_clip, last_frame
from marey.items.constraints import EFFECTORS, FASTEST, named_motions, parse_constraints, read_constraints
from marey.items.item import read_item

PATH = {"type": "root_path", "frames": [0, 10, 20], "positions_xz": [[0, 0], [0, 0.5], [0.2, 1]]}
POSE = {"type": "pose_keyframe", "frame": 20, "joint_rotations": {"pelvis": [1, 0, 0, 0]}}
HAND = {"type": "effector_target", "joint": "left_wrist", "frames": [5, 9], "positions": [[0.3, 1.2, 0.4], [0.3, 1, 1]]}
FAST = {"type": "root_path", "times": [0, 1], "positions_xz": [[0, 0], [0, 20]]}
MOTION = {"type": "pose_keyframe", "frame": 3, "motion": {"file": "pose.npz", "frame": 0}}


@st.composite
def constraints(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Constraints of one clip that contradict nothing: each names frames of its own."""
    number, frame, found = st.floats(-3, 3, allow_nan=False), 0, list[dict[str, Any]]()
    for kind in draw(
        st.lists(st.sampled_from(("root_path", "pose_keyframe", "effector_target")), min_size=1, max_size=6)
    ):
        frames = [frame := frame + draw(st.integers(30, 60)) for _ in range(draw(st.integers(1, 4)))]
        if kind == "root_path":
            x, z = draw(number), draw(number)
            found.append({"type": kind, "frames": frames, "positions_xz": [[x, z] for _ in frames]})
            if draw(st.booleans()):
                found[-1]["heading_radians"] = [draw(number) for _ in frames]
        elif kind == "pose_keyframe":
            found.append({"type": kind, "frame": frames[0], "joint_rotations": {"head": [1.0, 0.0, 0.0, 0.0]}})
        else:
            height = draw(st.floats(0, 2))
            places = [[draw(number), height, draw(number)] for _ in frames]
            found.append(
                {"type": kind, "joint": draw(st.sampled_from(EFFECTORS)), "frames": frames, "positions": places}
            )
    return found


@given(constraints())
def test_what_was_read_reads_as_itself(given: list[dict[str, Any]]) -> None:
    read = read_constraints(given)
    assert read_constraints(read) == read == parse_constraints(json.dumps({"constraints": read}))
    with pytest.raises(InvalidInput, match="constraints: gives 'frame' twice"):
        parse_constraints('[{"type": "pose_keyframe", "frame": 1, "frame": 5}]')
    assert [each["type"] for each in read] == [each["type"] for each in given]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from([*PATH, *POSE, *HAND]), inner),
    max_leaves=12,
)


@given(
    st.lists(
        JSON
        | st.builds(
            lambda base, changes: {**base, **changes},
            st.sampled_from([PATH, POSE, HAND]),
            st.dictionaries(st.sampled_from([*PATH, *POSE, *HAND]), JSON, max_size=2),
        ),
        max_size=3,
    )
)
def test_any_json_is_read_or_refused_with_a_field(value: list[Any]) -> None:
    try:
        read = read_constraints(value)
    except InvalidInput as error:
        refused = error.where or ""
    else:
        refused = "constraints"
        assert read_constraints(read) == read
        assert "\0" not in json.dumps(read, ensure_ascii=False).encode().decode()  # what a database can hold
    assert refused.startswith("constraints")


def changed(base: dict[str, Any], **changes: Any) -> dict[str, Any]:
    return {**base, **changes}


def target(joint: str, frame: int, *place: float) -> dict[str, Any]:
    return {"type": "effector_target", "joint": joint, "frames": [frame], "positions": [place]}


@pytest.mark.parametrize(
    ("value", "where", "message"),
    [
        ({"type": "root_path"}, "constraints", "not a list"),
        ([], "constraints", "an empty list"),
        ([3], "constraints.0", "not an object"),
        ([{"frames": []}], "constraints.0.type", "missing"),
        ([{"type": "path"}], "constraints.0.type", "unknown type 'path'"),
        ([changed(PATH, speed=3)], "constraints.0.speed", "unknown field"),
        ([changed(PATH, times=[0, 1, 2])], "constraints.0", "either `frames` or `times`"),
        ([changed(PATH, frames=[0, 10])], "constraints.0.positions_xz", "3 entries, and `frames` has 2"),
        ([changed(PATH, frames=[0, 10, 10])], "constraints.0.frames.2", "does not come after"),
        ([changed(PATH, frames=[0, 1.5, 3])], "constraints.0.frames.1", "not a frame"),
        ([changed(PATH, positions_xz=[[0, 0], [0, math.nan], [0, 1]])], "constraints.0.positions_xz.1", "finite"),
        ([changed(PATH, positions_xz=[[0, 0], [0, 1, 2], [0, 1]])], "constraints.0.positions_xz.1", "3 numbers, not 2"),
        ([changed(PATH, heading_radians=[0])], "constraints.0.heading_radians", "1 entries"),
        ([changed(PATH, heading_radians=[0, 1000, -1000.5])], "constraints.0.heading_radians.2", "-1000.5 radians"),
        ([FAST], "constraints.0.positions_xz.1", "20.0 m/s"),
        ([changed(HAND, joint="left_elbow")], "constraints.0.joint", "unknown joint 'left_elbow'"),
        ([changed(HAND, positions=[[0, 1, 0], [0, 3.5, 0]])], "constraints.0.positions.1", "out of reach"),
        ([changed(HAND, rotations=[[1, 0, 0, 0], [1, 1, 0, 0]])], "constraints.0.rotations.1", "unit quaternion"),
        ([HAND, changed(HAND, positions=[[0.3, 1.25, 0.4], [0.3, 1, 1]])], "constraints.1.positions.0", "5 cm from"),
        ([POSE, POSE], "constraints.1.frame", "same frame 20"),
        ([changed(POSE, motion={"file": "x", "frame": 0})], "constraints.0", "either `motion` or"),
        ([changed(MOTION, motion={"file": "x", "id": "y", "frame": 0})], "constraints.0.motion", "not a frame of"),
        ([changed(POSE, joint_rotations={"a\0": [1, 0, 0, 0]})], "constraints.0.joint_rotations", "not the name"),
        ([changed(POSE, joint_rotations={"\ud800": [1, 0, 0, 0]})], "constraints.0.joint_rotations", "not the name"),
        ([changed(POSE, joint_rotations={"a" * 101: [1, 0, 0, 0]})], "constraints.0.joint_rotations", "not the name"),
        ([changed(POSE, joint_rotations={"": [1, 0, 0, 0]})], "constraints.0.joint_rotations", "not the name"),
        ([changed(MOTION, motion={"file": "a\0b", "frame": 0})], "constraints.0.motion.file", "NUL"),
        ([changed(POSE, licence="")], "constraints.0.licence", "not the name of a licence"),
        ([changed(POSE, licence="MIT\n")], "constraints.0.licence", "not the name of a licence"),
        ([POSE] * 65, "constraints", "65 constraints; at most 64"),
        ([changed(PATH, frames=[*range(2001)], positions_xz=[[0, 0]] * 2001)], "constraints.0.frames", "2,001 points"),
    ],
)  # fmt: skip
def test_refused(value: Any, where: str, message: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        read_constraints(value)
    assert refused.value.where == where
    assert message in refused.value.message


@pytest.mark.parametrize(
    ("value", "where", "message"),
    [
        ([changed(PATH, frames=[0, 10, 99])], "constraints.0.frames.2", "beyond the clip"),
        ([changed(POSE, frame=60)], "constraints.0.frame", "0 to 59"),
        ([changed(PATH, positions_xz=[[0, 0], [0, 5], [0, 6]])], "constraints.0.positions_xz.1", "10.0 m/s"),
        ([PATH, changed(POSE, root_position=[0.2, 0.9, 1.5])], "constraints.1.root_position", "50 cm from"),
        ([PATH, changed(HAND, positions=[[3, 1, 0], [0, 1, 0]])], "constraints.1.positions.0", "out of reach"),
        ([PATH, changed(PATH, frames=[20, 30, 40])], "constraints.1.positions_xz.0", "stands in constraints.0"),
        ([PATH, target("pelvis", 10, 0.6, 0.9, 0.5)], "constraints.1.positions.0", "0.60 m from the root path"),
        ([target("left_wrist", 10, 2, 1, 0), target("right_wrist", 10, 0, 1, 0)], "constraints.1.positions.0",
         "2.00 m from constraints.0.positions.0, at the same frame 10; left wrist and right wrist"),
        ([target("head", 10, 0, 0.9, 0), target("left_foot", 10, 0, 0, 2.2)], "constraints.1.positions.0", "2.38 m"),
        ([target("left_foot", 10, 0, 0, 0.3), target("left_ankle", 10, 0, 0.1, 0)], "constraints.1.positions.0",
         "at most 0.18 m apart"),
        ([changed(POSE, root_position=[0, 0.9, 0]), target("head", 20, 2, 1.5, 0)], "constraints.1.positions.0",
         "from constraints.0.root_position"),
        ([changed(HAND, frames=[5, 6], positions=[[-1, 1, 0], [1, 1, 0]])], "constraints.0.positions.1",
         "40.0 m/s from constraints.0.positions.0; at most 25 m/s for left wrist"),
        ([changed(POSE, root_position=[0, 0.9, 0]), changed(POSE, frame=30, root_position=[0, 0.9, 5])],
         "constraints.1.root_position", "10.0 m/s from constraints.0.root_position; at most 8 m/s for pelvis"),
    ],
)  # fmt: skip
def test_refused_for_a_clip(value: Any, where: str, message: str) -> None:
    with pytest.raises(InvalidInput) as refused:
        check_clip(read_constraints(value), 60, 20.0)
    assert refused.value.where == where
    assert message in refused.value.message


def test_places_that_a_stretched_body_has_are_not_refused() -> None:
    arms = [target("left_wrist", 10, 0.78, 1.4, 0), target("right_wrist", 10, -0.78, 1.4, 0)]
    kick = [target("right_foot", 30, 0, 1.1, 1), target("left_foot", 30, 0, 0, 0), target("head", 30, 0, 1.6, -0.2)]
    swing = [changed(HAND, frames=[40, 42], positions=[[-0.5, 1, 0.3], [0.5, 1.8, 0.3]])]
    check_clip(read_constraints([*arms, *kick, *swing]), 60, 20.0)


def test_speed_depends_on_the_rate_of_the_clip() -> None:
    fast = read_constraints([changed(PATH, positions_xz=[[0, 0], [0, 0.9 * FASTEST], [0, 1.8 * FASTEST]])])
    check_clip(fast, 60, 10.0)
    with pytest.raises(InvalidInput, match="m/s"):
        check_clip(fast, 60, 20.0)


def test_names_of_motions_are_found_with_their_fields() -> None:
    assert [*named_motions(read_constraints([POSE]))] == []
    assert [*named_motions(read_constraints([PATH, MOTION]))] == [("constraints.1.motion", MOTION["motion"])]


def test_an_item_names_the_field_of_a_constraint() -> None:
    item, problems = read_item({"prompt": "a person walks", "constraints": [changed(HAND, joint="knee")]})
    assert item is None
    assert [problem.field for problem in problems] == ["constraints.0.joint"]


def test_last_frame() -> None:
    read = read_constraints([{"type": "root_path", "times": [0, 2.5], "positions_xz": [[0, 0], [0, 1]]}, POSE])
    assert last_frame(read, 30.0, kind="root_path") == 75
    assert last_frame(read, 4.0) == 20
    assert last_frame([], 30.0) is None


def test_an_unknown_field_is_told_with_the_type_and_the_known_ones() -> None:
    with pytest.raises(InvalidInput) as told:
        read_constraints([{**HAND, "colour": 1}])
    assert told.value.where == "constraints.0.colour"
    assert told.value.message.startswith("unknown field of 'effector_target'; known: joint, frames")
