"""Validation of rigs: the file is read in a child process before it is kept."""

from __future__ import annotations

from typing import Any, BinaryIO

from fastapi.concurrency import run_in_threadpool

from marey.api.context import Context
from marey.core.documents import parse_json
from marey.core.errors import InvalidInput, TooLarge
from marey.http.bodies import KeptBody
from marey.motion.export_options import OWN_BODIES, REFERENCE_RIGS
from marey.takes import AddedRig, NewRig, add_rig
from marey.tenants import Actor, ApiKey


async def add(shared: Context, key: ApiKey, name: str, format: str, rig_map: str | None, body: KeptBody) -> AddedRig:
    """Read a rig, and keep it under its name.

    Args:
        format: ending of the file's name.
        rig_map: JSON of the map of its joints.

    Raises:
        InvalidInput, InvalidFile, TooLarge: name, map or file cannot be used.
        Conflict, QuotaUsedUp, Busy: the tenant has as many rigs, bytes or waiting requests as it may.
        Unreachable: the store or the database does not answer.
    """
    if name in OWN_BODIES:
        kind = "a reference rig" if name in REFERENCE_RIGS else "Marey's own body"
        raise InvalidInput(f"{name!r} is {kind}", where="name", hint="Choose another name.")
    given = _map_of(rig_map)
    data = await body.run(_read, body.file, shared.config.rig_bytes)
    report = await shared.maker.report(key, name, format, given, data)
    new = NewRig(key.tenant, name, format, data, given, report)
    limit = shared.config.rigs_per_tenant
    return await run_in_threadpool(add_rig, shared.engine, shared.store, new, Actor(key.name, key.id), limit=limit)


def _map_of(text: str | None) -> Any:
    """Return the JSON value of a map; None for an empty one. The process that reads the rig checks what it says."""
    given = None if text is None else parse_json(text, "map", unique=True)
    return None if given == {} else given


def _read(file: BinaryIO, limit: int) -> bytes:
    data = file.read(limit + 1)
    if len(data) > limit:
        hint = "Export the skeleton without the scene."
        raise TooLarge(f"is over the limit of {limit / 2**20:g} MiB", where="body", hint=hint)
    return data
