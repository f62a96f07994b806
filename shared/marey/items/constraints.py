"""Constraints on a generated motion, and their only check: root paths, pose keyframes and targets of effectors.

Metres, Y up, in the space of the clip: frame 0 faces +Z at the origin. Frames are frames of the finished clip, at its
own rate. Standard library only: the small client imports it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, cast

from marey.core.documents import json_problem, unique_object
from marey.core.errors import InvalidInput
from marey.core.suggestions import did_you_mean
from marey.items.constraint_values import (
    MAX_POINTS,
    check_same_length,
    read_frame,
    read_heading,
    read_height,
    read_licence,
    read_list,
    read_motion,
    read_number,
    read_object,
    read_place,
    read_points,
    read_quaternion,
    read_rising,
    read_rotations,
    read_time,
)

Constraint = dict[str, Any]

ROOT_PATH, POSE_KEYFRAME, EFFECTOR_TARGET = "root_path", "pose_keyframe", "effector_target"
SIDED = ("wrist", "ankle", "foot")
EFFECTORS = (*(f"{side}_{joint}" for joint in SIDED for side in ("left", "right")), "head", "pelvis")
"""Joints that can have a target; `foot` is the joint at the toes."""
POSE_FIELDS = ("motion", "joint_rotations", "root_height", "licence")
"""Of a pose keyframe, those that say nothing of its time and place."""
MAX_CONSTRAINTS = 64
FASTEST = 8.0
"""Metres a second between two points of a path."""
AGREE = 0.03
"""Metres: two targets of one joint at one frame are the same up to this."""


def read_constraints(value: object) -> list[Constraint]:
    """Return checked constraints in their canonical form: JSON values, numbers as floats, frames as whole numbers.

    Raises:
        InvalidInput: with the field in `where`, as `constraints.0.positions_xz.3`.
    """
    given = read_list(value, "constraints", "a list of constraints")
    if not given:
        raise InvalidInput("is an empty list", where="constraints", hint="Leave it out, or name a constraint.")
    if len(given) > MAX_CONSTRAINTS:
        raise InvalidInput(f"{len(given)} constraints; at most {MAX_CONSTRAINTS}", where="constraints")
    read = [_constraint(each, f"constraints.{number}") for number, each in enumerate(given)]
    points = sum(len(each.get("frames", each.get("times", ()))) for each in read)
    if points > MAX_POINTS:
        raise InvalidInput(f"{points:,} points in all; at most {MAX_POINTS:,}", where="constraints")
    _check_targets(read)
    return read


def read_pose(value: object, where: str) -> Constraint:
    """Return a checked pose: the fields of a pose keyframe without its frame and place.

    Raises:
        InvalidInput: with the field in `where`.
    """
    given = read_object(value, where)
    for name in given:
        if name not in POSE_FIELDS:
            raise _unknown("a pose", name, POSE_FIELDS, where)
    pose = _pose_keyframe({**{name: each for name, each in given.items() if each is not None}, "frame": 0}, where)
    del pose["frame"]
    return pose


def parse_constraints(text: str | bytes) -> list[Constraint]:
    """Read constraints from JSON: a list, or an object with the list as `constraints`.

    Raises:
        InvalidInput: not JSON, or as `read_constraints`.
    """
    try:
        value: object = json.loads(text, object_pairs_hook=unique_object)
    except (ValueError, RecursionError) as error:
        hint = 'Write {"constraints": [{"type": "root_path", …}]}.'
        raise InvalidInput(json_problem(error), where="constraints", hint=hint) from None
    if isinstance(value, Mapping):
        given = cast("Mapping[str, object]", value)
        return read_constraints(given["constraints"] if set(given) == {"constraints"} else given)
    return read_constraints(value)


def named_motions(constraints: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the field and the value of each keyframe's `motion`, as `constraints.0.motion`."""
    for number, each in enumerate(constraints):
        if "motion" in each:
            yield f"constraints.{number}.motion", each["motion"]


def _unknown(what: str, name: object, known: Iterable[str], where: str) -> InvalidInput:
    message = f"unknown field of {what}{did_you_mean(str(name), known)}; known: {', '.join(known)}"
    return InvalidInput(message, where=f"{where}.{ascii(name)[1:-1][:40]}")


def _constraint(value: object, where: str) -> Constraint:
    given = read_object(value, where)
    kind = given.get("type")
    if not isinstance(kind, str) or kind not in _READERS:
        known = ", ".join(_READERS)
        said = "is missing" if kind is None else f"unknown type {str(kind)[:40]!r}"
        raise InvalidInput(f"{said}; known: {known}", where=f"{where}.type")
    allowed, read = _READERS[kind]
    for name in given:
        if name != "type" and name not in allowed:
            raise _unknown(repr(kind), name, allowed, where)
    return {"type": kind, **read({name: each for name, each in given.items() if each is not None}, where)}


def _root_path(given: Mapping[str, object], where: str) -> Constraint:
    read: Constraint = {}
    if ("frames" in given) == ("times" in given):
        raise InvalidInput("needs either `frames` or `times`", where=where)
    name = "frames" if "frames" in given else "times"
    read[name] = read_rising(given[name], f"{where}.{name}", read_frame if name == "frames" else read_time)
    read["positions_xz"] = read_points(given.get("positions_xz"), f"{where}.positions_xz", 2, len(read[name]), name)
    if "heading_radians" in given:
        values = read_list(given["heading_radians"], f"{where}.heading_radians", "a list of numbers")
        check_same_length(values, len(read[name]), f"{where}.heading_radians", name)
        read["heading_radians"] = [read_heading(v, f"{where}.heading_radians.{k}") for k, v in enumerate(values)]
    if name == "times":
        steps = pairwise(zip(read["times"], read["positions_xz"], strict=True))
        for point, ((before, a), (after, b)) in enumerate(steps, 1):
            if math.dist(a, b) > FASTEST * (after - before):
                speed = math.dist(a, b) / (after - before)
                raise InvalidInput(
                    f"{speed:.1f} m/s from the point before; at most {FASTEST:g} m/s",
                    where=f"{where}.positions_xz.{point}",
                )
    return read


def _pose_keyframe(given: Mapping[str, object], where: str) -> Constraint:
    read: Constraint = {"frame": read_frame(given.get("frame"), f"{where}.frame")}
    if ("motion" in given) == ("joint_rotations" in given):
        raise InvalidInput("needs either `motion` or `joint_rotations`", where=where)
    if "motion" in given:
        read["motion"] = read_motion(given["motion"], f"{where}.motion")
    else:
        read["joint_rotations"] = read_rotations(given["joint_rotations"], f"{where}.joint_rotations")
    if "root_position" in given:
        read["root_position"] = read_place(given["root_position"], f"{where}.root_position")
    if "root_height" in given:
        field = f"{where}.root_height"
        read["root_height"] = read_height(read_number(given["root_height"], field), field)
    if "licence" in given:
        read["licence"] = read_licence(given["licence"], f"{where}.licence")
    return read


def _effector_target(given: Mapping[str, object], where: str) -> Constraint:
    joint = given.get("joint")
    if joint not in EFFECTORS:
        said = "is missing" if joint is None else f"unknown joint {str(joint)[:40]!r}"
        raise InvalidInput(f"{said}; known: {', '.join(EFFECTORS)}", where=f"{where}.joint")
    frames = read_rising(given.get("frames"), f"{where}.frames", read_frame)
    rows = read_points(given.get("positions"), f"{where}.positions", 3, len(frames), "frames")
    for point, (_, height, _) in enumerate(rows):
        read_height(height, f"{where}.positions.{point}")
    read: Constraint = {"joint": joint, "frames": frames, "positions": rows}
    if "rotations" in given:
        turns = read_list(given["rotations"], f"{where}.rotations", "a list of quaternions [w, x, y, z]")
        check_same_length(turns, len(frames), f"{where}.rotations", "frames")
        read["rotations"] = [read_quaternion(turn, f"{where}.rotations.{k}") for k, turn in enumerate(turns)]
    return read


_READERS: dict[str, tuple[tuple[str, ...], Callable[[Mapping[str, object], str], Constraint]]] = {
    ROOT_PATH: (("frames", "times", "positions_xz", "heading_radians"), _root_path),
    POSE_KEYFRAME: (("frame", "motion", "joint_rotations", "root_position", "root_height", "licence"), _pose_keyframe),
    EFFECTOR_TARGET: (("joint", "frames", "positions", "rotations"), _effector_target),
}


def _check_targets(constraints: Sequence[Constraint]) -> None:
    """Check that no two constraints ask for two places of one joint, or two poses, at one frame."""
    seen: dict[tuple[str, int], tuple[list[float], str]] = {}
    for number, each in enumerate(constraints):
        for joint, frame, place, where in _targets(each, f"constraints.{number}"):
            other = seen.setdefault((joint, frame), (place, where))
            if other[1] != where and math.dist(other[0], place) > AGREE:
                raise InvalidInput(
                    f"is {100 * math.dist(other[0], place):.0f} cm from {other[1]}, at the same frame {frame}; at most "
                    f"{100 * AGREE:.0f}",
                    where=where,
                )


def _targets(each: Constraint, where: str) -> Iterator[tuple[str, int, list[float], str]]:
    if each["type"] == EFFECTOR_TARGET:
        for point, (frame, place) in enumerate(zip(each["frames"], each["positions"], strict=True)):
            yield each["joint"], frame, place, f"{where}.positions.{point}"
    if each["type"] == POSE_KEYFRAME:
        if "root_position" in each:
            yield "pelvis", each["frame"], each["root_position"], f"{where}.root_position"
        number = float(where.rpartition(".")[2])
        yield "pose", each["frame"], [number, 0.0, 0.0], f"{where}.frame"
