"""The work of a generator's queue: claimed items to motions."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Generic
from uuid import UUID

from marey.core.errors import MareyError
from marey.core.settings import Settings as Configuration
from marey.exporters import exporters
from marey.generation.export import export_clip, finish, split_settings
from marey.generation.port import Generated, Generator, Request, S
from marey.jobs import ClaimedItem
from marey.runtime.handler import Batch, BatchControl, Done, Export, Failed, Outcome
from marey.streams.recording import Recording
from marey.text.features import TextFeatures


class GeneratorHandler(Generic[S]):
    """Generates with one loaded bundle."""

    def __init__(self, queue: str, load: Callable[..., Generator[S]], batch_size: int, chosen: Configuration) -> None:
        """Nothing is loaded yet.

        Args:
            queue: the model, which is the queue's name.
            load: a bundle's reference to its generator; takes `device` and `threads`.
            batch_size: items of one claim, at most.
            chosen: device and threads.

        Raises:
            PluginError: an export format cannot be used; found now, before an item fails for it.
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
        """The loaded bundle; the loop loads before it runs."""
        assert self._generator is not None
        return self._generator

    def load(self, bundle: str) -> None:
        """Load `bundle`; the one before is let go first, so that both never stand in memory together.

        Raises:
            NotFound, InvalidBundle, Refused: see `find_bundle`.
            InvalidInput: there is no such device.
        """
        self._generator = None
        self._generator = self._load(bundle, device=self._device, threads=self._threads)

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Items of equal padded length together, short ones first: a forward holds one bucket."""
        self._requests = {}
        buckets: dict[int, list[ClaimedItem]] = defaultdict(list)
        for item in batch.items:
            try:
                request = self.generator.settled(self._request(item, batch.features[item.text_key]))
                self._requests[item.id] = request
                buckets[self.generator.bucket(request)].append(item)
            except MareyError as error:
                self._requests[item.id] = error
                buckets[0].append(item)
        return [bucket for _, bucket in sorted(buckets.items())]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Generate one bucket; decoding to joints, clean-up and files are left to the exports."""
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
        values, fps = split_settings(items[0].settings)  # the same for the whole batch
        settings = self.generator.settings(values)
        made = self.generator.generate(requests, settings, control=_Rows(items, control))
        elapsed = (time.monotonic() - started) / len(items)
        for item, request, generated in zip(items, requests, made, strict=True):
            if generated is not None:
                yield Done(item.id, partial(_export, self.generator, request, generated, settings, fps), elapsed)

    def _request(self, item: ClaimedItem, blob: bytes) -> Request:
        fps = self.generator.limits.fps
        frames = None if item.seconds is None else round(item.seconds * fps)
        recording = Recording.from_blob(blob)
        text = TextFeatures.from_blob(blob) if recording is None else recording.text
        return Request(text, item.seed, frames, recording)


class _Rows:
    """The generator counts rows of its batch, the loop knows items."""

    def __init__(self, items: Sequence[ClaimedItem], control: BatchControl) -> None:
        self._rows = {item.id: row for row, item in enumerate(items)}
        self._control = control

    def progress(self, done: int, total: int) -> None:
        """A decode step was done."""
        self._control.progress(done, total)

    def dropped(self) -> set[int]:
        """Rows nobody wants any more."""
        return {self._rows[item] for item in self._control.dropped() if item in self._rows}


def _export(generator: Generator[S], request: Request, generated: Generated, settings: S, fps: float | None) -> Export:
    return export_clip(finish(generator, request, generated, settings, fps=fps), generator.bundle.manifest.licence)
