"""Constraints on a generated motion, and their only check: root paths, pose keyframes and targets of effectors.

Metres, Y up, in the space of the clip: frame 0 faces +Z at the origin. Frames are frames of the finished clip, at its
own rate. Standard library only: the small client imports it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any, cast

from marey.core.characters import check_text, is_printable
from marey.core.errors import InvalidInput
from marey.core.frame_rates import frames_at_rate

Constraint = dict[str, Any]

ROOT_PATH, POSE_KEYFRAME, EFFECTOR_TARGET = "root_path", "pose_keyframe", "effector_target"
SIDED = ("wrist", "ankle", "foot")
EFFECTORS = (*(f"{side}_{joint}" for joint in SIDED for side in ("left", "right")), "head", "pelvis")
"""Joints that can have a target; `foot` is the joint at the toes."""
MAX_CONSTRAINTS, MAX_POINTS = 64, 2000
MAX_FRAME = 60 * 240
MAX_FILE = 4 * 2**20
"""Bytes of a file of constraints."""
MAX_COORDINATE = 1000.0
"""Metres from the origin."""
FASTEST = 8.0
"""Metres a second between two points of a path."""
HIGHEST, LOWEST = 2.6, -0.1
"""Heights in metres that a body on the floor reaches."""
FARTHEST = 1.2
"""Metres on the floor between a body on its path and what it reaches."""
MAX_JOINTS, MAX_JOINT_NAME = 200, 100
MAX_LICENCE = 200
"""Characters."""
AGREE, NEAR_PATH = 0.03, 0.25
"""Metres: two targets of one joint at one frame are the same up to the first, and a root on a path up to the second."""
UNIT = 0.02
"""Largest difference of a quaternion's length from 1."""


def read_constraints(value: object) -> list[Constraint]:
    """Return checked constraints in their canonical form: JSON values, numbers as floats, frames as whole numbers.

    Raises:
        InvalidInput: with the field in `where`, as `constraints.0.positions_xz.3`.
    """
    given = _items(value, "constraints", "a list of constraints")
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


def parse_constraints(text: str | bytes) -> list[Constraint]:
    """Read constraints from JSON: a list, or an object with the list as `constraints`.

    Raises:
        InvalidInput: not JSON, or as `read_constraints`.
    """
    try:
        value: object = json.loads(text)
    except RecursionError:
        raise InvalidInput("is nested too deeply", where="constraints") from None
    except ValueError as error:
        hint = 'Write {"constraints": [{"type": "root_path", …}]}.'
        raise InvalidInput(f"is not JSON: {error}", where="constraints", hint=hint) from None
    if isinstance(value, Mapping):
        given = cast("Mapping[str, object]", value)
        return read_constraints(given["constraints"] if set(given) == {"constraints"} else given)
    return read_constraints(value)


def named_motions(constraints: Sequence[Mapping[str, Any]]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yield the field and the value of each keyframe's `motion`, as `constraints.0.motion`."""
    for number, each in enumerate(constraints):
        if "motion" in each:
            yield f"constraints.{number}.motion", each["motion"]


def frames_of(constraint: Mapping[str, Any], fps: float) -> list[float]:
    """Return the frames that a constraint names, whole or between two, at the clip's rate."""
    if "times" in constraint:
        return [time * fps for time in constraint["times"]]
    return list(constraint["frames"]) if "frames" in constraint else [constraint["frame"]]


def last_frame(constraints: Sequence[Mapping[str, Any]], fps: float, *, kind: str | None = None) -> float | None:
    """Return the last frame that constraints name, those of one type if it is given; None without any."""
    named = [frames_of(each, fps)[-1] for each in constraints if kind in (None, each["type"])]
    return max(named, default=None)


def ended_with_clip(constraints: Sequence[Mapping[str, Any]], frames: int, fps: float) -> list[dict[str, Any]]:
    """Return constraints whose paths end with the clip where their last time is its length: a clip of 6 s has its last
    frame a frame before 6 s."""
    end = (frames - 1) / fps
    found = [dict(each) for each in constraints]
    for each in found:
        times = each.get("times")
        if times and end < times[-1] <= end + 1 / fps + 1e-6 and (len(times) == 1 or times[-2] < end):
            each["times"] = [*times[:-1], end]
    return found


def frames_to_last(
    constraints: Sequence[Mapping[str, Any]], fps: float, model_fps: float, low: int, high: int
) -> int | None:
    """Return the frames of the model that reach to the last constraint; None without any.

    Args:
        fps: of the clip.
        model_fps: of the model.
        low, high: fewest and most frames that the model generates.

    Raises:
        InvalidInput: they are more than that.
    """
    last = last_frame(constraints, fps)
    if last is None:
        return None
    least = max(math.ceil(last / fps * model_fps - 1e-6) + 1, low)
    if least > high:
        raise InvalidInput(
            f"they take {least / model_fps:g} s; this bundle generates {high / model_fps:g} s", where="constraints"
        )
    return least


def for_clip(
    constraints: Sequence[Mapping[str, Any]], frames: int, model_fps: float, fps: float
) -> tuple[list[dict[str, Any]], int]:
    """Return constraints as they are for a clip, with its number of frames.

    Args:
        frames: of the model.
        model_fps: of the model.
        fps: of the clip.

    Raises:
        InvalidInput: as `check_clip`.
    """
    count = frames_at_rate(frames, model_fps, fps)
    ended = ended_with_clip(constraints, count, fps)
    check_clip(ended, count, fps)
    return ended, count


def check_clip(constraints: Sequence[Mapping[str, Any]], frames: int, fps: float) -> None:
    """Check constraints against the clip they are for: its length, speeds at its rate, and one another.

    Raises:
        InvalidInput: with the field in `where`.
    """
    for number, each in enumerate(constraints):
        where = f"constraints.{number}"
        field = next(name for name in ("frames", "times", "frame") if name in each)
        for point, frame in enumerate(frames_of(each, fps)):
            if frame > frames - 1 + 1e-6:
                place = f"{where}.{field}" if field == "frame" else f"{where}.{field}.{point}"
                said = f"{frame / fps:g} s is" if field == "times" else f"frame {frame:g} is"
                raise InvalidInput(
                    f"{said} beyond the clip, which has {frames} frames at {fps:g} fps, 0 to {frames - 1}",
                    where=place,
                    hint=f"Its last frame is at {(frames - 1) / fps:g} s: end there, or ask for a longer clip.",
                )
    _check_paths(constraints, fps)


def _check_paths(constraints: Sequence[Mapping[str, Any]], fps: float) -> None:
    points = path_points(constraints, fps)
    for (frame, place, where), (after, there, its) in pairwise(points):
        if after - frame < 1e-6:
            raise InvalidInput(f"frame {after:g} stands in {where} too", where=its)
        speed = math.dist(place, there) * fps / (after - frame)
        if speed > FASTEST:
            raise InvalidInput(f"{speed:.1f} m/s from the point before; at most {FASTEST:g} m/s", where=its)
    for number, each in enumerate(constraints):
        if each["type"] == EFFECTOR_TARGET and points:
            _check_reach(each, points, f"constraints.{number}")
        root = each.get("root_position")
        if root is None or not points:
            continue
        there = _path_at(points, each["frame"])
        if there is not None and math.dist(there, (root[0], root[2])) > NEAR_PATH:
            apart = math.dist(there, (root[0], root[2]))
            raise InvalidInput(
                f"is {100 * apart:.0f} cm from the root path at frame {each['frame']}; at most {100 * NEAR_PATH:.0f}",
                where=f"constraints.{number}.root_position",
            )


def _check_reach(
    target: Mapping[str, Any], points: Sequence[tuple[float, tuple[float, float], str]], where: str
) -> None:
    """Check that a body on the path reaches a target."""
    for number, (frame, place) in enumerate(zip(target["frames"], target["positions"], strict=True)):
        there = _path_at(points, frame)
        far = 0.0 if there is None else math.dist(there, (place[0], place[2]))
        if far > FARTHEST:
            raise InvalidInput(
                f"is out of reach: {far:.2f} m from the root path at frame {frame}; at most {FARTHEST:g} m",
                where=f"{where}.positions.{number}",
            )


def path_points(constraints: Sequence[Mapping[str, Any]], fps: float) -> list[tuple[float, tuple[float, float], str]]:
    """Return frame, place (x, z) and field of each point of the root paths, in the order of frames."""
    points = [
        (float(frame), (float(x), float(z)), f"constraints.{number}.positions_xz.{point}")
        for number, each in enumerate(constraints)
        if each["type"] == ROOT_PATH
        for point, (frame, (x, z)) in enumerate(zip(frames_of(each, fps), each["positions_xz"], strict=True))
    ]
    return sorted(points, key=lambda point: point[0])


def _path_at(points: Sequence[tuple[float, tuple[float, float], str]], frame: float) -> tuple[float, float] | None:
    """Return the place on a path at a frame, on straight lines between its points; None before and after it."""
    for (begin, a, _), (end, b, _) in pairwise(points):
        if begin <= frame <= end:
            share = (frame - begin) / (end - begin)
            return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])
    return next((place for at, place, _ in points if at == frame), None)


def _constraint(value: object, where: str) -> Constraint:
    given = _object(value, where)
    kind = given.get("type")
    if not isinstance(kind, str) or kind not in _READERS:
        known = ", ".join(_READERS)
        said = "is missing" if kind is None else f"unknown type {str(kind)[:40]!r}"
        raise InvalidInput(f"{said}; known: {known}", where=f"{where}.type")
    allowed, read = _READERS[kind]
    for name in given:
        if name != "type" and name not in allowed:
            raise InvalidInput(
                f"unknown field of a {kind}; known: {', '.join(allowed)}", where=f"{where}.{ascii(name)[1:-1][:40]}"
            )
    return {"type": kind, **read({name: each for name, each in given.items() if each is not None}, where)}


def _root_path(given: Mapping[str, object], where: str) -> Constraint:
    read: Constraint = {}
    if ("frames" in given) == ("times" in given):
        raise InvalidInput("needs either `frames` or `times`", where=where)
    name = "frames" if "frames" in given else "times"
    read[name] = _rising(given[name], f"{where}.{name}", _frame if name == "frames" else _time)
    read["positions_xz"] = _rows(given.get("positions_xz"), f"{where}.positions_xz", 2, len(read[name]), name)
    if "heading_radians" in given:
        values = _items(given["heading_radians"], f"{where}.heading_radians", "a list of numbers")
        _same_length(values, len(read[name]), f"{where}.heading_radians", name)
        read["heading_radians"] = [_number(v, f"{where}.heading_radians.{k}") for k, v in enumerate(values)]
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
    read: Constraint = {"frame": _frame(given.get("frame"), f"{where}.frame")}
    if ("motion" in given) == ("joint_rotations" in given):
        raise InvalidInput("needs either `motion` or `joint_rotations`", where=where)
    if "motion" in given:
        read["motion"] = _motion(given["motion"], f"{where}.motion")
    else:
        read["joint_rotations"] = _rotations(given["joint_rotations"], f"{where}.joint_rotations")
    if "root_position" in given:
        read["root_position"] = _place(given["root_position"], f"{where}.root_position")
    if "root_height" in given:
        read["root_height"] = _height(_number(given["root_height"], f"{where}.root_height"), f"{where}.root_height")
    if "licence" in given:
        read["licence"] = _licence(given["licence"], f"{where}.licence")
    return read


def _effector_target(given: Mapping[str, object], where: str) -> Constraint:
    joint = given.get("joint")
    if joint not in EFFECTORS:
        said = "is missing" if joint is None else f"unknown joint {str(joint)[:40]!r}"
        raise InvalidInput(f"{said}; known: {', '.join(EFFECTORS)}", where=f"{where}.joint")
    frames = _rising(given.get("frames"), f"{where}.frames", _frame)
    rows = _rows(given.get("positions"), f"{where}.positions", 3, len(frames), "frames")
    for point, (_, height, _) in enumerate(rows):
        _height(height, f"{where}.positions.{point}")
    read: Constraint = {"joint": joint, "frames": frames, "positions": rows}
    if "rotations" in given:
        turns = _items(given["rotations"], f"{where}.rotations", "a list of quaternions [w, x, y, z]")
        _same_length(turns, len(frames), f"{where}.rotations", "frames")
        read["rotations"] = [_quaternion(turn, f"{where}.rotations.{k}") for k, turn in enumerate(turns)]
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


def _licence(value: object, where: str) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= MAX_LICENCE or not value.isprintable():
        raise InvalidInput(f"is not the name of a licence: 1 to {MAX_LICENCE} printable characters", where=where)
    return value


def _motion(value: object, where: str) -> dict[str, Any]:
    given = _object(value, where)
    named = [name for name in ("id", "file") if given.get(name) is not None]
    if len(named) != 1 or set(given) - {"id", "file", "frame"}:
        raise InvalidInput(
            'is not a frame of a motion: write {"id": "…", "frame": 0} or {"file": "pose.npz", "frame": 0}', where=where
        )
    name = given[named[0]]
    if not isinstance(name, str) or not 0 < len(name) <= 1024:
        raise InvalidInput("is not a name", where=f"{where}.{named[0]}")
    check_text(name, where=f"{where}.{named[0]}")
    return {named[0]: name, "frame": _frame(given.get("frame"), f"{where}.frame")}


def _rotations(value: object, where: str) -> dict[str, list[float]] | list[list[float]]:
    if isinstance(value, Mapping):
        given = cast("Mapping[object, object]", value)
        if not 0 < len(given) <= MAX_JOINTS:
            raise InvalidInput(f"has {len(given)} joints; 1 to {MAX_JOINTS}", where=where)
        return {_joint(name, where): _quaternion(turn, f"{where}.{str(name)[:40]}") for name, turn in given.items()}
    turns = _items(value, where, "quaternions [w, x, y, z] by the name of the joint, or a list of them")
    if not 0 < len(turns) <= MAX_JOINTS:
        raise InvalidInput(f"has {len(turns)} joints; 1 to {MAX_JOINTS}", where=where)
    return [_quaternion(turn, f"{where}.{k}") for k, turn in enumerate(turns)]


def _joint(name: object, where: str) -> str:
    if not isinstance(name, str) or not 0 < len(name) <= MAX_JOINT_NAME or not is_printable(name):
        raise InvalidInput(f"{ascii(name)[:60]} is not the name of a joint", where=where)
    return name


def _quaternion(value: object, where: str) -> list[float]:
    numbers = _vector(value, where, 4)
    size = math.hypot(*numbers)
    if abs(size - 1) > UNIT:
        raise InvalidInput(f"is not a unit quaternion [w, x, y, z]: its length is {size:.3g}", where=where)
    return numbers


def _place(value: object, where: str) -> list[float]:
    place = _vector(value, where, 3)
    _height(place[1], where)
    return place


def _height(value: float, where: str) -> float:
    if not LOWEST <= value <= HIGHEST:
        raise InvalidInput(f"height {value:g} m is out of reach; {LOWEST:g} to {HIGHEST:g} m", where=where)
    return value


def _rows(value: object, where: str, width: int, count: int, beside: str) -> list[list[float]]:
    rows = _items(value, where, f"a list of points of {width} numbers")
    _same_length(rows, count, where, beside)
    return [_vector(row, f"{where}.{k}", width) for k, row in enumerate(rows)]


def _same_length(rows: Sequence[object], count: int, where: str, beside: str) -> None:
    if len(rows) != count:
        raise InvalidInput(f"has {len(rows)} entries, and `{beside}` has {count}", where=where)


def _vector(value: object, where: str, width: int) -> list[float]:
    numbers = _items(value, where, f"{width} numbers")
    if len(numbers) != width:
        raise InvalidInput(f"has {len(numbers)} numbers, not {width}", where=where)
    read = [_number(number, where) for number in numbers]
    if max(map(abs, read)) > MAX_COORDINATE:
        raise InvalidInput(f"is farther than {MAX_COORDINATE:g} m from the origin", where=where)
    return read


def _rising(value: object, where: str, read: Callable[[object, str], Any]) -> list[Any]:
    given = _items(value, where, "a list of numbers")
    if not given:
        raise InvalidInput("is empty", where=where)
    if len(given) > MAX_POINTS:
        raise InvalidInput(f"{len(given):,} points; at most {MAX_POINTS:,}", where=where)
    numbers = [read(number, f"{where}.{k}") for k, number in enumerate(given)]
    for point, (before, after) in enumerate(pairwise(numbers), 1):
        if after <= before:
            raise InvalidInput(f"{after:g} does not come after {before:g}", where=f"{where}.{point}")
    return numbers


def _frame(value: object, where: str) -> int:
    number = _number(value, where)
    if not number.is_integer() or not 0 <= number <= MAX_FRAME:
        raise InvalidInput(f"{number:g} is not a frame: a whole number from 0 to {MAX_FRAME}", where=where)
    return int(number)


def _time(value: object, where: str) -> float:
    number = _number(value, where)
    if not 0 <= number <= 60:
        raise InvalidInput(f"{number:g} s is outside 0 to 60 s", where=where)
    return number


def _number(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        said = "is missing" if value is None else f"is {ascii(value)[:40]}, not a number"
        raise InvalidInput(said, where=where)
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise InvalidInput("is not a finite number", where=where)
    return number


def _items(value: object, where: str, what: str) -> Sequence[object]:
    if not isinstance(value, list | tuple):
        raise InvalidInput("is missing" if value is None else f"is not {what}", where=where)
    return cast("Sequence[object]", value)


def _object(value: object, where: str) -> Mapping[str, object]:
    if not isinstance(value, Mapping):
        raise InvalidInput("is not an object", where=where)
    return cast("Mapping[str, object]", value)
