"""Checks of the single values of constraints, and their limits: frames, times, points, rotations, names.

Each takes a value of JSON with its field, as `constraints.0.frames.3`, and returns it in its canonical form or raises
`InvalidInput` with the field in `where`. Standard library only: the small client imports it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, cast

from marey.core.characters import check_text, is_printable
from marey.core.errors import InvalidInput

MAX_POINTS = 2000
MAX_FRAME = 60 * 240
MAX_COORDINATE = 1000.0
"""Metres from the origin."""
MAX_HEADING = 1000.0
"""Radians, about 160 turns either way."""
HIGHEST, LOWEST = 2.6, -0.1
"""Heights in metres that a body on the floor reaches."""
MAX_JOINTS, MAX_JOINT_NAME = 200, 100
MAX_LICENCE = 200
"""Characters."""
UNIT = 0.02
"""Largest difference of a quaternion's length from 1."""


def read_licence(value: object, where: str) -> str:
    """Return the name of a licence."""
    if not isinstance(value, str) or not 0 < len(value) <= MAX_LICENCE or not value.isprintable():
        raise InvalidInput(f"is not the name of a licence: 1 to {MAX_LICENCE} printable characters", where=where)
    return value


def read_motion(value: object, where: str) -> dict[str, Any]:
    """Return the frame of a motion that a keyframe names."""
    given = read_object(value, where)
    named = [name for name in ("id", "file") if given.get(name) is not None]
    if len(named) != 1 or set(given) - {"id", "file", "frame"}:
        raise InvalidInput(
            'is not a frame of a motion: write {"id": "…", "frame": 0} or {"file": "pose.npz", "frame": 0}', where=where
        )
    name = given[named[0]]
    if not isinstance(name, str) or not 0 < len(name) <= 1024:
        raise InvalidInput("is not a name", where=f"{where}.{named[0]}")
    check_text(name, where=f"{where}.{named[0]}")
    return {named[0]: name, "frame": read_frame(given.get("frame"), f"{where}.frame")}


def read_rotations(value: object, where: str) -> dict[str, list[float]] | list[list[float]]:
    """Return unit quaternions, by the name of the joint or in a list."""
    if isinstance(value, Mapping):
        given = cast("Mapping[object, object]", value)
        if not 0 < len(given) <= MAX_JOINTS:
            raise InvalidInput(f"has {len(given)} joints; 1 to {MAX_JOINTS}", where=where)
        return {
            read_joint(name, where): read_quaternion(turn, f"{where}.{str(name)[:40]}") for name, turn in given.items()
        }
    turns = read_list(value, where, "quaternions [w, x, y, z] by the name of the joint, or a list of them")
    if not 0 < len(turns) <= MAX_JOINTS:
        raise InvalidInput(f"has {len(turns)} joints; 1 to {MAX_JOINTS}", where=where)
    return [read_quaternion(turn, f"{where}.{k}") for k, turn in enumerate(turns)]


def read_joint(name: object, where: str) -> str:
    """Return the name of a joint."""
    if not isinstance(name, str) or not 0 < len(name) <= MAX_JOINT_NAME or not is_printable(name):
        raise InvalidInput(f"{ascii(name)[:60]} is not the name of a joint", where=where)
    return name


def read_quaternion(value: object, where: str) -> list[float]:
    """Return a unit quaternion [w, x, y, z]."""
    numbers = read_vector(value, where, 4)
    size = math.hypot(*numbers)
    if abs(size - 1) > UNIT:
        raise InvalidInput(f"is not a unit quaternion [w, x, y, z]: its length is {size:.3g}", where=where)
    return numbers


def read_place(value: object, where: str) -> list[float]:
    """Return a place [x, y, z] at a height that a body reaches."""
    place = read_vector(value, where, 3)
    read_height(place[1], where)
    return place


def read_height(value: float, where: str) -> float:
    """Return a height in metres that a body reaches."""
    if not LOWEST <= value <= HIGHEST:
        raise InvalidInput(f"height {value:g} m is out of reach; {LOWEST:g} to {HIGHEST:g} m", where=where)
    return value


def read_heading(value: object, where: str) -> float:
    """Return a heading in radians."""
    heading = read_number(value, where)
    if abs(heading) > MAX_HEADING:
        raise InvalidInput(f"{heading:g} radians are too many; -{MAX_HEADING:,g} to {MAX_HEADING:,g}", where=where)
    return heading


def read_points(value: object, where: str, width: int, count: int, beside: str) -> list[list[float]]:
    """Return points of `width` numbers, as many as the field `beside` has entries."""
    rows = read_list(value, where, f"a list of points of {width} numbers")
    check_same_length(rows, count, where, beside)
    return [read_vector(row, f"{where}.{k}", width) for k, row in enumerate(rows)]


def check_same_length(rows: Sequence[object], count: int, where: str, beside: str) -> None:
    """Validate that there are as many rows as the field `beside` has entries."""
    if len(rows) != count:
        raise InvalidInput(f"has {len(rows)} entries, and `{beside}` has {count}", where=where)


def read_vector(value: object, where: str, width: int) -> list[float]:
    """Return a vector of `width` numbers."""
    numbers = read_list(value, where, f"{width} numbers")
    if len(numbers) != width:
        raise InvalidInput(f"has {len(numbers)} numbers, not {width}", where=where)
    read = [read_number(number, where) for number in numbers]
    if max(map(abs, read)) > MAX_COORDINATE:
        raise InvalidInput(f"is farther than {MAX_COORDINATE:g} m from the origin", where=where)
    return read


def read_rising(value: object, where: str, read: Callable[[object, str], Any]) -> list[Any]:
    """Return numbers that rise, each read by `read`."""
    given = read_list(value, where, "a list of numbers")
    if not given:
        raise InvalidInput("is empty", where=where)
    if len(given) > MAX_POINTS:
        raise InvalidInput(f"{len(given):,} points; at most {MAX_POINTS:,}", where=where)
    numbers = [read(number, f"{where}.{k}") for k, number in enumerate(given)]
    for point, (before, after) in enumerate(pairwise(numbers), 1):
        if after <= before:
            raise InvalidInput(f"{after:g} does not come after {before:g}", where=f"{where}.{point}")
    return numbers


def read_frame(value: object, where: str) -> int:
    """Return the number of a frame."""
    number = read_number(value, where)
    if not number.is_integer() or not 0 <= number <= MAX_FRAME:
        raise InvalidInput(f"{number:g} is not a frame: a whole number from 0 to {MAX_FRAME}", where=where)
    return int(number)


def read_time(value: object, where: str) -> float:
    """Return a time in seconds."""
    number = read_number(value, where)
    if not 0 <= number <= 60:
        raise InvalidInput(f"{number:g} s is outside 0 to 60 s", where=where)
    return number


def read_number(value: object, where: str) -> float:
    """Return a finite number as float."""
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


def read_list(value: object, where: str, what: str) -> Sequence[object]:
    """Return a list; `what` says in the message what it is to hold."""
    if not isinstance(value, list | tuple):
        raise InvalidInput("is missing" if value is None else f"is not {what}", where=where)
    return cast("Sequence[object]", value)


def read_object(value: object, where: str) -> Mapping[str, object]:
    """Return an object."""
    if not isinstance(value, Mapping):
        raise InvalidInput("is not an object", where=where)
    return cast("Mapping[str, object]", value)
