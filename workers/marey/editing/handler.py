"""Handler of the queue `edit`: an item is one result of operations on stored motions. Needs no model, and no torch."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from uuid import UUID

from marey.editing.judge import judged
from marey.jobs import EDIT_QUEUE, ClaimedItem, Edits
from marey.motion.clip import parse_npz
from marey.motion.edits.editing import EditSource, FrameModel, edit_steps
from marey.motion.edits.licences import strictest
from marey.motion.edits.steps import read_steps
from marey.runtime.editing import EditInput
from marey.runtime.export_types import Export
from marey.runtime.exporting import export_clip
from marey.runtime.handler import Batch, BatchControl, Done, Handler, Outcome


class EditHandler:
    """Apply operations to stored motions, and judge the results."""

    queue = EDIT_QUEUE
    batch_size = 8

    def load(self, bundle: str) -> None:
        """Load nothing: operations need no model."""

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Return one bucket per item: one that cannot be edited fails alone."""
        return [[item] for item in batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Edit one motion.

        Raises:
            InvalidInput: an operation that the motion does not allow.
            NotFound: a source was deleted.
            InvalidFile: the npz of a source is broken.
            Unreachable: the store does not answer.
        """
        (item,) = batch.items
        assert item.edits is not None  # items of this queue have operations
        assert batch.editing is not None
        began = time.perf_counter()
        export = edited(item.edits, batch.editing)
        yield Done(item.id, export, time.perf_counter() - began)


def edited(edits: Edits, given: EditInput, model: FrameModel | None = None) -> Callable[[], Export]:
    """Apply operations that make one motion, and return the export of the result with its quality record.

    Args:
        edits: of an item.
        given: the stored motions.
        model: generates frames, for operations that need one.

    Raises:
        InvalidInput, NotFound, InvalidFile, Unreachable: see `EditHandler.run`.
    """

    def load(name: str) -> EditSource:
        return _read(UUID(name), given)

    steps = read_steps(edits.ops)
    if edits.asked:
        steps = tuple(replace(step, asked=name) for step, name in zip(steps, edits.asked, strict=True))
    (clip,) = edit_steps(_read(edits.sources[0], given), steps, load=load, model=model)
    terms = [] if model is None else [model.licence]
    licence = strictest([*(given.source(source).licence for source in edits.sources), *terms])
    return partial(export_clip, judged(clip), licence or "")


def _read(motion: UUID, given: EditInput) -> EditSource:
    sha256 = given.source(motion).sha256
    return EditSource(parse_npz(given.read(sha256), f"motion {motion}"), str(motion), sha256)


def create_handler() -> Handler:
    """Create the handler."""
    return EditHandler()
