"""Places of joints that no body can have together: too far apart at one frame, or too fast from one to the next.

Standard library only: the small client imports it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, groupby, pairwise
from typing import Any

from marey.core.errors import InvalidInput
from marey.items.constraints import EFFECTOR_TARGET, FASTEST, POSE_KEYFRAME

TO_PELVIS = {"wrist": 1.10, "ankle": 0.92, "foot": 1.07, "head": 0.63, "pelvis": 0.0}
"""Metres of the bones between a joint and the pelvis, of a body of 1.75 m."""
SHORTER = {("wrist", "wrist"): 1.58, ("head", "wrist"): 1.11}
"""The same between two joints whose bones meet above the pelvis."""
FOOT = 0.14
"""The same between ankle and toe of one foot."""
TALLER = 1.25
"""Bodies of other proportions may be so many times as large."""
FASTEST_JOINT = 25.0
"""Metres a second of hands, feet and head: a thrown ball leaves the hand at less."""


@dataclass(frozen=True)
class _Place:
    joint: str
    frame: int
    place: tuple[float, float, float]
    where: str


def check_bodies(constraints: Sequence[Mapping[str, Any]], fps: float) -> None:
    """Check that a body can have all places of joints.

    Raises:
        InvalidInput: it cannot, with the field in `where`.
    """
    places = sorted(_places(constraints), key=lambda each: each.frame)
    for _, group in groupby(places, key=lambda each: each.frame):
        for first, second in combinations(group, 2):
            _check_apart(first, second)
    for joint in {each.joint for each in places}:
        most = FASTEST if joint == "pelvis" else FASTEST_JOINT
        for first, second in pairwise(each for each in places if each.joint == joint):
            _check_speed(first, second, fps, most)


def _places(constraints: Sequence[Mapping[str, Any]]) -> Iterator[_Place]:
    for number, each in enumerate(constraints):
        if each["type"] == EFFECTOR_TARGET:
            for point, (frame, (x, y, z)) in enumerate(zip(each["frames"], each["positions"], strict=True)):
                yield _Place(each["joint"], frame, (x, y, z), f"constraints.{number}.positions.{point}")
        if each["type"] == POSE_KEYFRAME and "root_position" in each:
            x, y, z = each["root_position"]
            yield _Place("pelvis", each["frame"], (x, y, z), f"constraints.{number}.root_position")


def _check_apart(first: _Place, second: _Place) -> None:
    apart, most = math.dist(first.place, second.place), _span(first.joint, second.joint)
    if apart > most:
        raise InvalidInput(
            f"is {apart:.2f} m from {first.where}, at the same frame {first.frame}; {_named(first.joint)} and "
            f"{_named(second.joint)} of a body are at most {most:.2f} m apart",
            where=second.where,
        )


def _check_speed(first: _Place, second: _Place, fps: float, most: float) -> None:
    frames = second.frame - first.frame
    way = math.dist(first.place, second.place)
    if frames and way * fps / frames > most:
        raise InvalidInput(
            f"{way * fps / frames:.1f} m/s from {first.where}; at most {most:g} m/s for {_named(first.joint)}",
            where=second.where,
        )


def _span(first: str, second: str) -> float:
    """Return how many metres two joints of a body are apart at most."""
    kinds = sorted(name.rpartition("_")[2] for name in (first, second))
    if kinds == ["ankle", "foot"] and first.partition("_")[0] == second.partition("_")[0]:
        return TALLER * FOOT
    if first == second:
        return math.inf  # two places of one joint are compared by `read_constraints`
    return TALLER * SHORTER.get((kinds[0], kinds[1]), sum(TO_PELVIS[kind] for kind in kinds))


def _named(joint: str) -> str:
    return joint.replace("_", " ")
