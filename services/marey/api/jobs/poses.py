"""Poses of stored motions that the constraints of a submit name: found, read in a child process, put in their place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any
from uuid import UUID

from fastapi.concurrency import run_in_threadpool

from marey.api.context import Context
from marey.core.errors import Conflict, InvalidFile, InvalidInput, MareyError, NotFound, TooLarge
from marey.db import transaction
from marey.exporters.registry import CANONICAL
from marey.items.constraints import named_motions
from marey.items.item import Item
from marey.items.problems import InvalidItems, Problem
from marey.jobs import MotionRow, asset_key, find_motions, missing_motion
from marey.motion.edits.licences import LICENCE, terms_with
from marey.motion.keyframes import beyond, with_pose
from marey.tenants import ApiKey

MOST_MOTIONS, MOST_FRAMES = 16, 256
"""Different motions that the poses of one job name, and different frames of them."""
MOST_KEYFRAMES = 10_000
"""Keyframes of one job that name motions: each becomes the rotations of all joints."""
Poses = Mapping[tuple[UUID, int], Mapping[str, Any]]
"""Poses (`pose_of`) by motion and frame, with the terms of the motion."""
Place = tuple[int | None, str]
"""Line and field that name a frame first, as `constraints.0.motion`."""


@dataclass(frozen=True)
class PosedItem:
    """An item whose constraints name motions.

    Attributes:
        line: of the body.
        model: as the item names it.
        constraints: the fields of each that decide its terms.
    """

    line: int | None
    model: str | None
    constraints: Sequence[Mapping[str, Any]]


class NamedPoses:
    """The frames of stored motions that a body names, and the items that name them."""

    def __init__(self) -> None:
        self.frames: dict[UUID, dict[int, Place]] = {}
        self.items: list[PosedItem] = []
        self._keyframes = self._frames = 0
        self._refused: set[str] = set()

    def add(
        self, constraints: Sequence[Mapping[str, Any]], line: int | None, model: str | None = None
    ) -> Iterator[Problem]:
        """Note the frames that the checked constraints of an item name, and yield the problems with them; a limit is
        reported once."""
        motions = [*named_motions(constraints)]
        if motions and self._keyframes < MOST_KEYFRAMES:
            terms = [{name: each[name] for name in ("motion", LICENCE) if name in each} for each in constraints]
            self.items.append(PosedItem(line, model, terms))
        for where, named in motions:
            if "file" in named:
                hint = "write the `id` of a stored motion, or `joint_rotations`"
                yield Problem(line, f"{where}.file", f"a server reads no files: {hint}")
                continue
            try:
                motion = UUID(named["id"])
            except ValueError:
                yield Problem(
                    line, f"{where}.id", "is not the id of a motion: `marey motions list --full-ids` shows them"
                )
                continue
            message = self._note(motion, named["frame"], (line, where))
            if message is not None and message not in self._refused:
                self._refused.add(message)
                yield Problem(line, f"{where}.id", message)

    def _note(self, motion: UUID, frame: int, place: Place) -> str | None:
        """Note one frame; return the message about a limit that it is beyond."""
        self._keyframes += 1
        if self._keyframes > MOST_KEYFRAMES:
            return f"over {MOST_KEYFRAMES:,} keyframes name motions; submit them as several jobs"
        if motion not in self.frames and len(self.frames) == MOST_MOTIONS:
            return f"the poses of a job are of {MOST_MOTIONS} motions at most; submit them as several jobs"
        frames = self.frames.setdefault(motion, {})
        if frame not in frames:
            if self._frames == MOST_FRAMES:
                return f"the poses of a job are {MOST_FRAMES} different frames at most; submit them as several jobs"
            self._frames += 1
            frames[frame] = place
        return None


async def read_poses(shared: Context, key: ApiKey, named: NamedPoses) -> Poses:
    """Return the poses that a body names; each motion is read once.

    Raises:
        InvalidItems: motions that the tenant does not have, frames beyond them, or files that cannot be read.
        Busy: too many files are waiting to be made or read.
        Unreachable: the store or the database does not answer.
    """
    if not named.frames:
        return {}
    rows = await run_in_threadpool(_find, shared, key, named)
    poses: dict[tuple[UUID, int], Mapping[str, Any]] = {}
    problems: list[Problem] = []
    for motion, frames in named.frames.items():
        try:
            data = await run_in_threadpool(_npz, shared, rows[motion])
            found = await shared.maker.poses(key, [*frames], data, f"motion {motion}")
        except (NotFound, InvalidInput, InvalidFile, TooLarge, Conflict) as error:
            line, where = next(iter(frames.values()))
            problems.append(Problem(line, f"{where}.id", _said(error)))
            continue
        terms = {LICENCE: rows[motion].licence} if rows[motion].licence else {}
        poses |= {(motion, frame): {**pose, **terms} for frame, pose in zip(frames, found, strict=True)}
    if problems:
        raise InvalidItems(problems)
    return poses


def posed(item: Item, poses: Poses) -> Item:
    """Return an item in which no keyframe names a motion."""
    if not any(named_motions(item.constraints or ())):
        return item
    filled = [_filled(each, poses) for each in item.constraints or ()]
    return replace(item, constraints=filled)


def check_terms(item: PosedItem, poses: Poses, licence: str | None) -> None:
    """Check the terms of the poses that an item names against those of the weights.

    Raises:
        InvalidInput: no licence satisfies both; with the field in `where`.
    """
    terms_with(licence, [_filled(each, poses) for each in item.constraints])


def _filled(constraint: Mapping[str, Any], poses: Poses) -> Mapping[str, Any]:
    named = constraint.get("motion")
    return constraint if named is None else with_pose(constraint, poses[UUID(named["id"]), named["frame"]])


def _find(shared: Context, key: ApiKey, named: NamedPoses) -> Mapping[UUID, MotionRow]:
    """Return the motions that are named.

    Raises:
        InvalidItems: with each that the tenant does not have, and each frame beyond its motion.
    """
    with transaction(shared.engine) as conn:
        rows = find_motions(conn, key.tenant, named.frames)
        missing = {each: missing_motion(conn, key.tenant, each) for each in named.frames if each not in rows}
    problems: list[Problem] = []
    for motion, frames in named.frames.items():
        row = rows.get(motion)
        if row is None:
            line, where = next(iter(frames.values()))
            problems.append(Problem(line, f"{where}.id", missing[motion].on_a_line))
            continue
        late = [(place, frame) for frame, place in frames.items() if frame >= row.frames]
        problems += [Problem(line, f"{where}.frame", beyond(frame, row.frames)) for (line, where), frame in late]
    if problems:
        raise InvalidItems(problems)
    return rows


def _npz(shared: Context, row: MotionRow) -> bytes:
    """Return the npz of a motion.

    Raises:
        Conflict: it has none: its prompt is being erased.
        NotFound: it was deleted since.
    """
    file = row.file(CANONICAL)
    if file is None:
        raise Conflict(f"the motion has no {CANONICAL} to read", hint="If its prompt is being erased, wait a moment.")
    return shared.store.get(asset_key(row.tenant, file.sha256))


def _said(error: MareyError) -> str:
    if isinstance(error, NotFound):
        return "the motion was deleted, or its prompt is being erased: try again"
    return error.on_a_line
