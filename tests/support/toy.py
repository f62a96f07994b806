"""A model that does nothing, for tests of the loop, chaos and the overhead benchmark: a real `Handler` of queue `toy`.

What it does to an item stands in the item's prompt (a word of `Deed`) and settings (`steps`, `step_seconds`).
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator, Sequence
from enum import StrEnum

from marey.core.errors import InvalidInput, NotFound, Unreachable
from marey.jobs import ClaimedItem
from marey.runtime.export_types import Export, ExportedFile
from marey.runtime.handler import Batch, BatchControl, Done, Failed, Outcome, TextDone

QUEUE = "toy"
REFERENCE = "tests.support.toy:ToyHandler"
TEXT_REFERENCE = "tests.support.toy:ToyTextHandler"
FITS = 4  # items of `Deed.MEMORY` that fit into one batch


class Deed(StrEnum):
    """First word of a prompt: what its item does to the worker."""

    WALK = "walk"
    KILL = "kill"
    """SIGKILL to its own process: a segfault, an OOM kill."""
    HANG = "hang"
    """No step and no outcome, for a day."""
    BUG = "bug"
    """An unexpected exception out of `run`."""
    REFUSE = "refuse"
    """A permanent error of this item alone."""
    ONCE = "once"
    """A retryable error at the first attempt."""
    MEMORY = "memory"
    """MemoryError in a batch of more than `FITS`."""
    AWAY = "away"
    """Something the handler needs does not answer."""
    SILENT = "silent"
    """No outcome at all."""
    BAD_EXPORT = "bad-export"
    """An unexpected exception while the files are made."""
    REFUSED_EXPORT = "refused-export"
    """A permanent error while the files are made."""


class ToyHandler:
    """See the module."""

    queue = QUEUE
    batch_size = 32

    def __init__(self) -> None:
        self.loaded: list[str] = []
        self.batches: list[int] = []

    def load(self, bundle: str) -> None:
        if bundle.startswith("missing"):
            raise NotFound(f"there is no bundle {bundle!r}", hint="Choose another.")
        self.loaded.append(bundle)

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        return [batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        self.batches.append(len(batch.items))
        started = time.monotonic()
        settings = batch.items[0].settings
        steps, pause = int(str(settings.get("steps", 1))), float(str(settings.get("step_seconds", 0.0)))
        for step in range(steps):
            if len(control.dropped() & {item.id for item in batch.items}) == len(batch.items):
                return
            time.sleep(pause)
            control.progress(step + 1, steps)
        memory = [item for item in batch.items if deed(item) is Deed.MEMORY]
        if len(memory) > FITS:
            raise MemoryError
        for item in batch.items:
            if item.id in control.dropped():
                continue
            outcome = self._outcome(item, (time.monotonic() - started) / len(batch.items))
            if outcome is not None:
                yield outcome

    def _outcome(self, item: ClaimedItem, elapsed: float) -> Outcome | None:
        match deed(item):
            case Deed.KILL:
                os.kill(os.getpid(), signal.SIGKILL)
            case Deed.HANG:
                time.sleep(86_400)
            case Deed.BUG:
                raise RuntimeError("a bug")
            case Deed.REFUSE:
                return Failed(item.id, InvalidInput("this cannot be danced"))
            case Deed.ONCE if item.attempts == 0:
                return Failed(item.id, InvalidInput("not this time"), retryable=True)
            case Deed.AWAY:
                raise Unreachable("what the toy needs does not answer")
            case Deed.SILENT:
                return None
            case _:
                pass
        return Done(item.id, lambda: export(item), elapsed)


class ToyTextHandler:
    """Reads no prompt: its features are the same for all."""

    queue = "text"
    batch_size = 64

    def load(self, bundle: str) -> None:
        pass

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        return [batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        for item in batch.items:
            yield TextDone(item.id, item.text_key, b"toy")


def deed(item: ClaimedItem) -> Deed:
    """Behaviour that the prompt asks for."""
    word = item.prompt.split()[0]
    return Deed(word) if word in set(Deed) else Deed.WALK


def export(item: ClaimedItem) -> Export:
    """Files that belong to this item alone."""
    if deed(item) is Deed.BAD_EXPORT:
        raise RuntimeError("a bug in the export")
    if deed(item) is Deed.REFUSED_EXPORT:
        raise InvalidInput("this motion cannot be written")
    content = f"{item.id} {item.seed}".encode()
    return Export(
        files=(ExportedFile("npz", b"npz " + content), ExportedFile("bvh", b"bvh " + content)),
        frames=item.seed,
        fps=20.0,
        licence="CC0-1.0",
        manifest={"seed": item.seed},
    )
