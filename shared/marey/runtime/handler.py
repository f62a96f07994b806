"""The interface between the claim loop and handlers: one protocol and its data types.

A handler turns claimed items into outcomes. It never sees the database, the queue or the store: the loop claims,
renews the lease, stores files, commits, releases and retries. A handler may rely on these rules:

- `run` is called on one thread, one batch at a time; every item of a batch has the same bundle and settings.
- `run` yields one outcome per item, in any order, as soon as it is known; items in `control.dropped()` need none.
- The items of an evaluator's queue come one by one, and their batch has `scoring`: the motions to measure.
- A batch of edits has `editing`: the motions to edit. On the queue of a model its items have text features, too.
- `Done.export` is called once, later, on the store thread, while the next batch runs: decoding, clean-up and file
  formats belong there, not into `run`.
- An exception from `run` concerns every item of the batch without an outcome: a `MareyError` fails them with its
  message (`Unreachable` releases them uncounted), out of memory halves the batch in place, any other is a bug and is
  retried until the attempts are used up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeAlias
from uuid import UUID

from marey.core.errors import MareyError
from marey.jobs.lease_types import Claim, ClaimedItem, PromptScope
from marey.runtime.editing import EditInput
from marey.runtime.export_types import Export, ExportedFile
from marey.runtime.scoring import ScoreInput


@dataclass(frozen=True)
class Batch:
    """Claimed items to run together, all of one bundle and the same settings, with their inputs from the tables."""

    claim: Claim
    items: tuple[ClaimedItem, ...]
    """The items of the claim, or of one bucket of it."""
    features: Mapping[str, bytes]
    """Text features (`TextFeatures.to_blob`) by the items' `text_key`; empty in the text stage."""
    scoring: ScoreInput | None = None
    """Motions of an evaluation, for score items, which have no prompt."""
    editing: EditInput | None = None
    """Stored motions, for edits."""


@dataclass(frozen=True)
class Done:
    """A generated item; `export` makes its files and is called once, on the store thread.

    Raises (from `export`): `MareyError` fails the item; anything else retries it.
    """

    item: UUID
    export: Callable[[], Export]
    elapsed: float
    """Seconds of computation of this item: its batch's time divided by the items in it."""


@dataclass(frozen=True)
class TextDone:
    """A parsed prompt: `blob` (safetensors) goes to `text_features` under `key`; the item moves on to `generate`."""

    item: UUID
    key: str
    blob: bytes
    scope: PromptScope | None = None
    """The encoder's verdict on the prompt; None = the words decided."""


@dataclass(frozen=True)
class Scored:
    """A measured evaluation: `files` (`html`, `json`, `md`) are its report, `summary` its numbers for lists and trends.

    `regressed`: worse than the baseline; None = there was no baseline. `reason` is one sentence for people.
    """

    item: UUID
    files: tuple[ExportedFile, ...]
    summary: Mapping[str, float | None]
    regressed: bool | None
    reason: str


@dataclass(frozen=True)
class Failed:
    """An item without a result. If `retryable`, it runs again after a pause; else it ends as `failed` now."""

    item: UUID
    problem: MareyError
    retryable: bool = False


Outcome: TypeAlias = Done | TextDone | Scored | Failed


class BatchControl(Protocol):
    """Control of a running batch; both methods cost microseconds and may be called at every decode step."""

    def progress(self, done: int, total: int) -> None:
        """Report progress: `done` of `total` steps. A batch silent for 120 s loses its lease."""
        ...

    def dropped(self) -> frozenset[UUID]:
        """Return items whose result is no longer wanted: cancelled ones, or all of them when the lease is lost or the
        worker stops. Leave their rows out of the next step; return when none is left."""
        ...


class Handler(Protocol):
    """The work of one queue. Created in the worker's child; the parent never imports its module."""

    queue: str
    """`hgm3`, `text`: the queue it claims from."""
    batch_size: int
    """Maximum items of one claim."""

    def load(self, bundle: str) -> None:
        """Load `bundle`; may take minutes (its lease is kept alive). Called when the bundle changes.

        Raises: `InvalidBundle`, `NotFound`: every claimed item of that bundle fails with the message.
        """
        ...

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Order and group the items of a claim for `run`: one forward pass per group, every item once."""
        ...

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Run one bucket (`batch.items`) and yield an outcome for each item that was not dropped."""
        ...


HandlerFactory: TypeAlias = Callable[[], Handler]


@dataclass(frozen=True)
class Role:
    """The handlers of one worker process, served in turns by its one child.

    `handlers` maps a queue to `module:attribute` of a `HandlerFactory`, a string, so that only the child imports it.
    """

    name: str
    handlers: Mapping[str, str]
    preload: Mapping[str, str] = field(default_factory=dict[str, str])
    """Bundle to load before the worker is ready, by queue."""
