"""Constraints on the frames of a clip: those that they name, and whether they fit its length, its rate and each other.

Standard library only: the small client imports it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

from marey.core.errors import InvalidInput
from marey.core.frame_rates import frames_at_rate
from marey.items.constraint_bodies import check_bodies
from marey.items.constraints import EFFECTOR_TARGET, FASTEST, ROOT_PATH

NEAR_PATH = 0.25
"""Metres between a root and the path of the root."""
FARTHEST = 1.2
"""Metres on the floor between a body on its path and what it reaches."""


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
    check_bodies(constraints, fps)


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
    """Check that a body on the path reaches a target; the pelvis is the root, and lies on it."""
    most = NEAR_PATH if target["joint"] == "pelvis" else FARTHEST
    for number, (frame, place) in enumerate(zip(target["frames"], target["positions"], strict=True)):
        there = _path_at(points, frame)
        far = 0.0 if there is None else math.dist(there, (place[0], place[2]))
        if far > most:
            raise InvalidInput(
                f"is out of reach: {far:.2f} m from the root path at frame {frame}; at most {most:g} m",
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
