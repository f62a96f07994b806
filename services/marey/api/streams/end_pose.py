"""The pose that a stream is ended on: checked, read from a stored motion, in the order of the stream's joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any
from uuid import UUID

from fastapi.concurrency import run_in_threadpool

from marey.api.context import Context
from marey.api.jobs.poses import NamedPoses, read_poses
from marey.bundles.body import body_of
from marey.core.errors import InvalidInput
from marey.db import transaction
from marey.items.constraints import POSE_KEYFRAME, read_pose
from marey.items.problems import InvalidItems, Problem
from marey.motion.edits.licences import terms_with
from marey.motion.keyframes import ordered_rotations, with_pose
from marey.streams import get_stream
from marey.tenants import ApiKey

DIGITS = 6
"""Digits of rotations: a millionth of a turn's quaternion."""
ITEM, FIELD = "constraints.0", "pose"
"""Prefixes of fields: of the keyframe that the pose is read as, and of the request."""


async def read_end_pose(shared: Context, key: ApiKey, stream: UUID, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a pose as `marey.streams.control.StreamControl` has it.

    Raises:
        NotFound: the tenant has no such stream, or its bundle is gone.
        InvalidInput: a pose that cannot be read, of another skeleton, or under terms that exclude those of the
            weights; with the field in `where`.
        Busy, Unreachable: as `read_poses`.
    """
    pose = read_pose(given, FIELD)
    named = NamedPoses()
    keyframe = {"type": POSE_KEYFRAME, "frame": 0, **pose}
    _refuse_first(list(named.add([keyframe], None)))
    try:
        poses = await read_poses(shared, key, named)
    except InvalidItems as error:
        _refuse_first(error.problems)
        raise
    for found in poses.values():
        pose = with_pose(pose, found)
    return await run_in_threadpool(_ordered, shared, key, stream, pose)


def _refuse_first(problems: Sequence[Problem]) -> None:
    """Raise the first problem of the keyframe as one of the pose, if there is one."""
    if problems:
        raise InvalidInput(problems[0].message, where=str(problems[0].field).replace(ITEM, FIELD, 1))


def _ordered(shared: Context, key: ApiKey, stream: UUID, pose: Mapping[str, Any]) -> dict[str, Any]:
    with transaction(shared.engine) as conn:
        row = get_stream(conn, key.tenant, stream)
    manifest = shared.catalogue.capabilities(row.bundle).bundle.manifest
    try:
        terms_with(manifest.licence, [pose])
    except InvalidInput as error:
        raise InvalidInput(error.message, where=f"{FIELD}.licence", hint=error.hint) from None
    turns = ordered_rotations(pose["joint_rotations"], body_of(manifest).skeleton, f"{FIELD}.joint_rotations")
    return {**pose, "joint_rotations": [[round(float(x), DIGITS) for x in turn] for turn in turns]}
