"""The work of the queue `hgm3`: claimed items to motions."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import partial
from uuid import UUID

from shared.errors import InvalidFile, MareyError
from shared.jobs import ClaimedItem
from shared.runtime.handler import Batch, BatchControl, Done, Export, Failed, Outcome
from shared.settings import Settings as Configuration
from shared.settings import settings as configuration
from shared.text.features import TextFeatures
from workers.hgm3.bundle import MODEL
from workers.hgm3.export import export_clip, finish, split_settings
from workers.hgm3.generate import BUCKET, MAX_ROWS, Generated, Generator, Request, Settings


class Hgm3Handler:
    """Generates with one loaded bundle."""

    queue = MODEL
    batch_size = MAX_ROWS

    def __init__(self, chosen: Configuration) -> None:
        self._device = chosen.device
        self._threads = chosen.threads
        self._generator: Generator | None = None
        self._requests: dict[UUID, Request | MareyError] = {}

    @property
    def generator(self) -> Generator:
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
        self._generator = Generator.load(bundle, device=self._device, threads=self._threads)

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Items of equal padded length together, short ones first: a forward holds one bucket."""
        self._requests = {}
        buckets: dict[int, list[ClaimedItem]] = defaultdict(list)
        for item in batch.items:
            try:
                request = self._request(item, batch.features[item.text_key])
                frames = self.generator.frames([request])[0]
                self._requests[item.id] = Request(request.text, request.seed, frames)
                tokens = -(-frames // self.generator.frames_per_token)
                buckets[-(-tokens // BUCKET)].append(item)
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
        settings, fps = split_settings(items[0].settings)  # the same for the whole batch
        made = self.generator.generate(requests, settings, control=_Rows(items, control))
        elapsed = (time.monotonic() - started) / len(items)
        for item, request, generated in zip(items, requests, made, strict=True):
            if generated is not None:
                yield Done(item.id, partial(_export, self.generator, request, generated, settings, fps), elapsed)

    def _request(self, item: ClaimedItem, blob: bytes) -> Request:
        text = TextFeatures.from_blob(blob)
        width = self.generator.config.condition.text_width
        if text.nodes.shape[1] != width:
            raise InvalidFile(f"text features of width {text.nodes.shape[1]}, this bundle wants {width}", where="text")
        fps = self.generator.config.fps
        return Request(text, item.seed, None if item.seconds is None else round(item.seconds * fps))


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


def _export(
    generator: Generator, request: Request, generated: Generated, settings: Settings, fps: float | None
) -> Export:
    return export_clip(finish(generator, request, generated, settings, fps=fps), generator.bundle.manifest.licence)


def create_handler() -> Hgm3Handler:
    """What a worker's child makes."""
    return Hgm3Handler(configuration())
