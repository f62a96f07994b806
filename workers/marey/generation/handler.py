"""Handler of a generator's queue: turns claimed items into motions."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Generic
from uuid import UUID

from marey.core.errors import MareyError
from marey.core.settings import Settings
from marey.editing.handler import edited
from marey.exporters import exporters
from marey.generation.candidates import best_clips, split_settings
from marey.generation.constraints.draw import constrained_clips
from marey.generation.export import finish
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, MotionFeatures, Request, S
from marey.generation.requests import request_of
from marey.generation.shots.dispatch import bucket_of, generate_any
from marey.generation.shots.editor import EditModel
from marey.jobs import ClaimedItem
from marey.motion.edits.licences import LICENCE
from marey.runtime.editing import EditInput
from marey.runtime.export_types import Export
from marey.runtime.exporting import export_clip
from marey.runtime.handler import Batch, BatchControl, Done, Failed, Outcome
from marey.streams.recording import StreamRecording
from marey.text.features import TextFeatures
from marey.text.several import SeveralTexts


class GeneratorHandler(Generic[S]):
    """Generate motions with one loaded bundle."""

    def __init__(self, queue: str, load: Callable[..., Generator[S]], batch_size: int, chosen: Settings) -> None:
        """Create the handler; `load` loads the bundle.

        Args:
            queue: the model's name, which is also the queue's.
            load: function from a bundle's reference to its generator; takes `device` and `threads`.
            batch_size: largest number of items of a claim.
            chosen: device and threads.

        Raises:
            PluginError: an export format cannot be loaded; checked here, before an item fails because of it.
        """
        exporters()
        self.queue = queue
        self.batch_size = batch_size
        self._load = load
        self._device = chosen.device
        self._threads = chosen.threads
        self._generator: Generator[S] | None = None
        self._requests: dict[UUID, Request | MareyError] = {}

    @property
    def generator(self) -> Generator[S]:
        """The loaded bundle; the loop calls `load` before `run`."""
        assert self._generator is not None
        return self._generator

    def load(self, bundle: str) -> None:
        """Load `bundle`; the previous one is released first, so that memory never holds both.

        Raises:
            NotFound, InvalidBundle, Refused: see `find_bundle`.
            InvalidInput: unknown device.
        """
        self._generator = None
        self._generator = self._load(bundle, device=self._device, threads=self._threads)

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Group items by padded length, shortest first: a forward pass holds one bucket."""
        if batch.editing is not None:
            return [[item] for item in batch.items]
        self._requests = {}
        buckets: dict[int, list[ClaimedItem]] = defaultdict(list)
        for item in batch.items:
            try:
                request = self._request(item, batch.features[item.text_key])
                self._requests[item.id] = request
                buckets[bucket_of(self.generator, request)].append(item)
            except MareyError as error:
                self._requests[item.id] = error
                buckets[0].append(item)
        return [bucket for _, bucket in sorted(buckets.items())]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Generate one bucket; decoding to joints, clean-up and files are left to the exports."""
        if batch.editing is not None:
            yield from self._edited(batch, batch.editing, control)
            return
        started = time.monotonic()
        items: list[ClaimedItem] = []
        requests: list[Request] = []
        for item in batch.items:
            request = self._requests[item.id]
            if isinstance(request, MareyError):
                yield Failed(item.id, request)
            else:
                items.append(item)
                requests.append(request)
        if not items:
            return
        exports = self._exports(items, requests, _Rows(items, control))
        elapsed = (time.monotonic() - started) / len(items)
        for item, export in zip(items, exports, strict=True):
            if export is not None:
                yield Done(item.id, export, elapsed)

    def _edited(self, batch: Batch, given: EditInput, control: BatchControl) -> Iterator[Outcome]:
        """Edit a stored motion with frames of the model."""
        (item,) = batch.items
        assert item.edits is not None  # all items of a claim are edits, or none is
        started = time.monotonic()
        texts = {text.prompt: text for text in SeveralTexts.from_blob(batch.features[item.text_key]).texts}
        model = EditModel.of(self.generator, item.settings, texts.__getitem__, control=_Rows([item], control))
        try:
            export = edited(item.edits, given, model)
        except MareyError as error:
            if item.id not in control.dropped():
                yield Failed(item.id, error)
            return
        yield Done(item.id, export, time.monotonic() - started)

    def _exports(
        self, items: Sequence[ClaimedItem], requests: Sequence[Request], control: GenerationControl
    ) -> Sequence[Callable[[], Export] | None]:
        """Generate, and return how each motion is exported later; None for dropped ones."""
        made: list[Callable[[], Export] | None] = [None] * len(items)
        free = [row for row, item in enumerate(items) if not item.constraints]
        bound = [row for row, item in enumerate(items) if item.constraints]
        for rows, before, generate in ((free, 0, self._free_exports), (bound, len(free), self._constrained_exports)):
            if rows:
                watched = PassControl(control, rows, before, len(items))
                part = generate([items[row] for row in rows], [requests[row] for row in rows], watched)
                for row, export in zip(rows, part, strict=True):
                    made[row] = export
        return made

    def _constrained_exports(
        self, items: Sequence[ClaimedItem], requests: Sequence[Request], control: GenerationControl
    ) -> Sequence[Callable[[], Export] | None]:
        """Generate motions with constraints."""
        values, plan = split_settings(items[0].settings)
        settings = self.generator.settings(values)
        asked = [item.constraints or () for item in items]
        clips = constrained_clips(self.generator, requests, asked, settings, plan, control=control)
        return [None if clip is None else partial(export_clip, clip, str(clip.manifest[LICENCE])) for clip in clips]

    def _free_exports(
        self, items: Sequence[ClaimedItem], requests: Sequence[Request], control: GenerationControl
    ) -> Sequence[Callable[[], Export] | None]:
        """Generate motions without constraints."""
        values, plan = split_settings(items[0].settings)  # the same for the whole batch
        settings = self.generator.settings(values)
        if plan.is_single:
            made = generate_any(self.generator, requests, settings, control=control)
            return [
                None if generated is None else partial(_export, self.generator, request, generated, settings, plan.fps)
                for request, generated in zip(requests, made, strict=True)
            ]
        licence = self.generator.bundle.manifest.licence
        clips = best_clips(self.generator, requests, settings, plan, control=control)
        return [None if clip is None else partial(export_clip, clip, licence) for clip in clips]

    def _request(self, item: ClaimedItem, blob: bytes) -> Request:
        if item.timeline is not None:
            return request_of(self.generator, item, SeveralTexts.from_blob(blob).texts, item.scope)
        recording = StreamRecording.from_blob(blob)
        text = TextFeatures.from_blob(blob) if recording is None else recording.text
        return request_of(self.generator, item, [text], item.scope, recording)


class _Rows:
    """Adapter between the rows of the generator and the items of the loop."""

    def __init__(self, items: Sequence[ClaimedItem], control: BatchControl) -> None:
        self._rows = {item.id: row for row, item in enumerate(items)}
        self._control = control

    def progress(self, done: int, total: int) -> None:
        """Report a finished decode step."""
        self._control.progress(done, total)

    def dropped(self) -> set[int]:
        """Return the rows of cancelled items."""
        return {self._rows[item] for item in self._control.dropped() if item in self._rows}


def _export(
    generator: Generator[S], request: Request, generated: MotionFeatures, settings: S, fps: float | None
) -> Export:
    return export_clip(finish(generator, request, generated, settings, fps=fps), generator.bundle.manifest.licence)
