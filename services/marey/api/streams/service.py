"""Operations of routes and sockets on streams: create, read, command."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa
import structlog

from marey.api.audit import note
from marey.api.catalogue import Catalogue
from marey.api.context import Context
from marey.api.stream_hub import Hub
from marey.api.streams.schemas import BundleFacts, NewStreamBody, StreamDetailView
from marey.bundles import named_by
from marey.core.errors import Conflict, InvalidBundle, InvalidInput, NotFound, Refused, Unreachable
from marey.db import transaction
from marey.items.item import Item, read_item
from marey.items.values import MAX_SEED
from marey.jobs.generators import GeneratorCapabilities
from marey.registry import find_model, streaming_models
from marey.streams import NewStream, StreamRow, create_stream, end_stream, get_stream, prompts_with_rewrites
from marey.streams.control import ControlQueue, StreamControl
from marey.streams.notifier import StreamNotifier
from marey.streams.states import OPEN_STREAMS
from marey.tenants import ApiKey

log = structlog.get_logger(__name__)

STOPPED = "stopped"
NEVER_TAKEN = 0
"""Fence of a stream without a worker so far: leases count from 1."""


def hub_of(shared: Context) -> Hub:
    """Return the hub of the frames' Redis.

    Raises:
        Unreachable: no Redis is configured.
    """
    if shared.streams is None:
        raise Unreachable(
            "live streams need Redis, and none is configured",
            where="MAREY_QUEUE_URL",
            hint="Set it, or MAREY_STREAMS_URL.",
            public="this server has no live streams",
        )
    return shared.streams


def begin(shared: Context, key: ApiKey, body: NewStreamBody) -> StreamDetailView:
    """Create a stream that waits for a worker.

    Raises:
        InvalidInput: an invalid prompt, name, seed or setting, or a model that cannot stream.
        Busy: the key has reached its limit.
    """
    hub = hub_of(shared)
    new = _new_stream(key, body, shared.catalogue)
    with transaction(shared.engine) as conn:
        stream = create_stream(conn, new, limit=shared.config.streams_per_key)
        note(conn, key, "stream.begin", stream, bundle=new.bundle)
        view = detail(conn, shared, get_stream(conn, key.tenant, stream))
    try:
        StreamNotifier(hub.redis).notify()
    except Unreachable as error:  # workers find the row without it
        log.warning("not_rung", stream=str(stream), error=error.message)
    return view


def detail(conn: sa.Connection, shared: Context, row: StreamRow) -> StreamDetailView:
    """Return a stream with its prompts and skeleton."""
    return StreamDetailView.detail(row, made_by(shared, row), prompts_with_rewrites(conn, row.id))


def made_by(shared: Context, row: StreamRow) -> BundleFacts:
    """Return the data of a stream's bundle, if it still exists: an ended stream outlives its bundle."""
    try:
        return BundleFacts.by(shared.catalogue.capabilities(row.bundle).bundle)
    except (NotFound, InvalidBundle, Refused):
        return BundleFacts()


def made_by_each(shared: Context, rows: Sequence[StreamRow]) -> list[BundleFacts]:
    """Return `made_by` of each row; each bundle is read once."""
    found = {row.bundle: row for row in rows}
    views = {name: made_by(shared, row) for name, row in found.items()}
    return [views[row.bundle] for row in rows]


def is_over(row: StreamRow) -> bool:
    """Return True if the stream produces no more frames."""
    return row.state not in OPEN_STREAMS


def command(shared: Context, key: ApiKey, stream: UUID, control: StreamControl) -> None:
    """Send a control message to an open stream. Steers are frequent, and are recorded with the stream itself.

    Raises:
        NotFound: the tenant has no such stream.
        Conflict: it has ended.
        Unreachable: Redis or the database does not answer.
    """
    with transaction(shared.engine) as conn:
        _need_open(get_stream(conn, key.tenant, stream))
        if control.kind in ("pause", "resume"):
            note(conn, key, f"stream.{control.kind}", stream)
    if control.kind == "stop":
        stop(shared, key, stream)
    else:
        ControlQueue(hub_of(shared).redis, str(stream)).send(control)


def stop_on(shared: Context, key: ApiKey, stream: UUID, pose: Mapping[str, Any]) -> StreamRow:
    """Ask a stream to end on a pose, and return its new state; as `stop`.

    Raises:
        NotFound: the tenant has no such stream.
        Conflict: it has ended.
        Unreachable: Redis or the database does not answer.
    """
    with transaction(shared.engine) as conn:
        _need_open(get_stream(conn, key.tenant, stream))
    return stop(shared, key, stream, StreamControl("stop", pose=pose))


def current(shared: Context, row: StreamRow) -> StreamDetailView:
    """Return `detail` in a transaction of its own."""
    with transaction(shared.engine) as conn:
        return detail(conn, shared, row)


def _need_open(row: StreamRow) -> None:
    if is_over(row):
        raise Conflict(f"the stream has ended: {row.reason}", where=f"stream {row.id}")


def stop(
    shared: Context,
    key: ApiKey,
    stream: UUID,
    control: StreamControl = StreamControl("stop"),
) -> StreamRow:
    """Ask a stream to end, and return its new state. A waiting one ends at once; one that has ended stays so.

    A worker may take the stream at the same moment. Both lock its row, and check again under the lock: if this
    transaction is first, the worker finds the stream ended and takes nothing; if the worker is first, the row has
    its lease number, nothing is ended here, and the worker reads the message, which stays in the queue.

    Raises:
        NotFound: the tenant has no such stream.
        Unreachable: Redis or the database does not answer.
    """
    with transaction(shared.engine) as conn:
        get_stream(conn, key.tenant, stream)
        note(conn, key, "stream.stop", stream)
        end_stream(conn, stream, NEVER_TAKEN, STOPPED)
        row = get_stream(conn, key.tenant, stream)
    if not is_over(row):
        ControlQueue(hub_of(shared).redis, str(stream)).send(control)
    return row


def _new_stream(key: ApiKey, body: NewStreamBody, catalogue: Catalogue) -> NewStream:
    item = _checked(body)
    generator = _generator(item, catalogue)
    manifest = generator.bundle.manifest
    fps = manifest.fps or 0.0  # generator capabilities always include one
    return NewStream(
        tenant=key.tenant,
        key=key.id,
        prompt=item.prompt,
        model=manifest.model,
        bundle=generator.bundle.reference,
        seed=secrets.randbelow(MAX_SEED + 1) if item.seed is None else item.seed,
        max_frames=round(body.seconds * fps),
        name=item.name,
    )


def _checked(body: NewStreamBody) -> Item:
    """Validate the fields that a stream shares with an item."""
    item, problems = read_item(body.model_dump(exclude={"seconds"}, exclude_unset=True))
    if item is None or problems:
        message = "; ".join(str(problem) for problem in problems)
        raise InvalidInput(message, where=", ".join(dict.fromkeys(str(problem.field) for problem in problems)))
    return item


def _generator(item: Item, catalogue: Catalogue) -> GeneratorCapabilities:
    """Return the capabilities of the stream's bundle."""
    try:
        with named_by("model"):
            generator = catalogue.capabilities(item.model) if item.model else catalogue.live_capabilities()
    except NotFound as error:  # the problem is a field's, not the path's
        raise InvalidInput(error.message, where=error.where, hint=error.hint) from error
    manifest = generator.bundle.manifest
    spec = find_model(manifest.model)
    if spec is None or spec.live is None:
        live = streaming_models()
        raise InvalidInput(
            f"{manifest.name} is a bundle of {manifest.model}, which cannot make motion frame by frame",
            where="model",
            hint=f"Bundles of {', '.join(live) or 'no model that is installed here'} can.",
        )
    return generator
