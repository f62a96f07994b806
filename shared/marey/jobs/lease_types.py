"""Data types of claims, heartbeats, commits and sweeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from uuid import UUID

from marey.items.item import ItemSpec
from marey.jobs.states import ItemStage, ItemState
from marey.jobs.types import Edits, FailureReason, JsonObject
from marey.vocabulary.scope import ScopePolicy


@dataclass(frozen=True, kw_only=True)
class ClaimedItem(ItemSpec):
    """An item as its worker receives it."""

    id: UUID
    position: int
    index: int
    variant: int
    model: str
    bundle: str
    text_key: str
    seed: int
    settings: JsonObject
    attempts: int
    scope: JsonObject | None = None
    """Scope of the prompt (`marey.vocabulary.scope.Scope.as_json`); None = not examined."""
    edits: Edits | None = None
    """Operations on stored motions; None = the motion is generated."""


@dataclass(frozen=True)
class Claim:
    """A batch under one lease: items of one job, one stage and one batch key, in input order."""

    lease_token: UUID
    tenant: str
    job: UUID
    queue: str
    stage: ItemStage
    batch_key: str
    bundle: str
    solo: bool
    """True if the single item of this claim was in a batch whose lease was lost; losing this one costs it an
    attempt."""
    items: tuple[ClaimedItem, ...]
    traceparent: str | None = None
    """`traceparent` of the submitting request."""
    scope: ScopePolicy = "ignore"
    """The job's treatment of prompts with unknown actions."""


@dataclass(frozen=True)
class HeartbeatReply:
    """The database's answer to a worker's heartbeat."""

    lost: bool
    """The lease is gone (expired and swept, or all its items cancelled): stop, and discard the batch."""
    gone: frozenset[UUID]
    """Requested items that are no longer under the lease: cancelled. Drop their rows."""


@dataclass(frozen=True)
class WorkerHeartbeat:
    """A worker's sign of life."""

    id: str
    queue: str
    host: str
    pid: int
    device: str
    bundle: str | None = None
    """Loaded bundle."""
    batch_key: str | None = None


@dataclass(frozen=True)
class WorkerRow:
    """A known worker."""

    id: str
    queue: str
    host: str
    pid: int
    device: str
    bundle: str | None
    started: datetime
    seen: datetime
    live: bool


@dataclass(frozen=True)
class SchedulerRow:
    """A known scheduler.

    Attributes:
        seen: time of the last progress of all its components; `silence`: seconds since then, by the database's
            clock.
        live: True if that was recently.
    """

    id: str
    host: str
    pid: int
    seen: datetime
    silence: float
    live: bool


@dataclass(frozen=True)
class AssetDigest:
    """Digest and size of content to store."""

    sha256: str
    size: int
    media_type: str = "application/octet-stream"


@dataclass(frozen=True)
class NewMotion:
    """A finished item; its files are in the asset store already."""

    item: UUID
    files: Mapping[str, AssetDigest]
    """By format ("npz", "bvh")."""
    frames: int
    fps: float
    licence: str
    """SPDX name or short text of the licence of the weights."""
    elapsed: float
    """Seconds of computation."""
    metadata: JsonObject = field(default_factory=dict[str, object])


@dataclass(frozen=True)
class PromptScope:
    """The encoder's verdict on the scope of a prompt, under its key (`marey.text.keys.scope_key`)."""

    key: str
    scope: JsonObject


@dataclass(frozen=True)
class NewText:
    """Text features of one item's prompt."""

    item: UUID
    key: str
    blob: bytes
    scope: PromptScope | None = None
    """The encoder's verdict; None = the words decided."""


@dataclass(frozen=True)
class ItemFailure:
    """An item that failed."""

    item: UUID
    problem: FailureReason
    retryable: bool


@dataclass(frozen=True)
class Committed:
    """Result of a write under a lease."""

    items: tuple[UUID, ...]
    """Written by this call."""
    lost: tuple[UUID, ...]
    """No longer under the lease (lost, cancelled, or committed before): the results are discarded."""
    states: Mapping[UUID, ItemState] = field(default_factory=dict[UUID, ItemState])
    """New state of failed items: `failed`, `dead`, or `ready` for a retry."""


@dataclass(frozen=True)
class SweepReport:
    """Result of a sweep."""

    leases_lost: int = 0
    items_returned: int = 0
    items_dead: int = 0
    items_due: int = 0
    """Items whose `run_after` has passed."""
    stale_assets: int = 0
    """Assets still `writing` an hour after their lease ended; `collect_garbage` removes them."""
