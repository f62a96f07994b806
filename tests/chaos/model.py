"""The do-nothing model of chaos runs: the toy under the name of a model that the API knows, each item of which takes a
while and leaves files of one size, so that stores fill up and quotas of bytes are exact."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from dataclasses import replace

from marey.jobs import ClaimedItem
from marey.runtime.export_types import Export
from marey.runtime.handler import Batch, BatchControl, Done, Outcome
from tests.support.toy import ToyHandler

QUEUE = "text,hgm3"
REFERENCE = "tests.support.toy:ToyTextHandler,tests.chaos.model:ChaosToy"
ITEM_SECONDS = "CHAOS_ITEM_SECONDS"
"""Environment variable: how long an item takes in any batch."""
FILE_BYTES = 2048


class ChaosToy(ToyHandler):
    """See the module."""

    queue = "hgm3"

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        pause = float(os.environ[ITEM_SECONDS])
        for step in range(len(batch.items)):
            if control.dropped() >= {item.id for item in batch.items}:
                return
            time.sleep(pause)
            control.progress(step + 1, len(batch.items))
        yield from super().run(batch, control)

    def _outcome(self, item: ClaimedItem, elapsed: float) -> Outcome | None:
        outcome = super()._outcome(item, elapsed)
        if not isinstance(outcome, Done):
            return outcome
        return replace(outcome, export=lambda: _padded(outcome.export()))


def _padded(export: Export) -> Export:
    files = tuple(replace(file, content=file.content.ljust(FILE_BYTES)) for file in export.files)
    return replace(export, files=files)
