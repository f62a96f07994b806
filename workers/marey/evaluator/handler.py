"""Handler of the queue `evaluator`: an item is one evaluation, from its motions to its report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from marey.bundles import Bundle, find_bundle
from marey.core.errors import MareyError, NotFound, Unreachable
from marey.core.settings import settings
from marey.evaluator.loading import load_evaluator
from marey.evaluator.measuring import check_measured, measure
from marey.evaluator.port import Evaluator
from marey.evaluator.reconstruction import find_reconstruction
from marey.evaluator.reference import RealClips
from marey.evaluator.report import headline, to_html, to_json, to_markdown
from marey.evaluator.reporting import report_of, summary_of
from marey.jobs import EVALUATOR_QUEUE, ClaimedItem
from marey.runtime.export_types import ExportedFile
from marey.runtime.handler import Batch, BatchControl, Failed, Handler, Outcome, Scored
from marey.runtime.scoring import ScoreInput


@dataclass(frozen=True)
class _Loaded:
    bundle: Bundle
    evaluator: Evaluator
    real: RealClips


class EvaluatorHandler:
    """Measure evaluations with one loaded evaluator."""

    queue = EVALUATOR_QUEUE
    batch_size = 1

    def __init__(self, device: str) -> None:
        """Create a handler without a loaded bundle; `device` as in the settings."""
        self._device = device
        self._loaded: _Loaded | None = None

    def load(self, bundle: str) -> None:
        """Load an evaluator with the real clips of its reference.

        Raises:
            NotFound, InvalidBundle, Refused: see `find_bundle`.
            InvalidInput: unknown device.
        """
        found = find_bundle(bundle)
        self._loaded = _Loaded(found, load_evaluator(found, device=self._device), RealClips.of(found))

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Return one bucket per item."""
        return [[item] for item in batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Measure the motions of one evaluation and write its report."""
        assert self._loaded is not None  # the loop loads before it runs
        item, source = batch.items[0], batch.scoring
        if source is None:
            yield Failed(item.id, NotFound("no evaluation is scored by this item", where=f"item {item.id}"))
            return
        try:
            yield _scored(item, source, self._loaded, control)
        except Unreachable:
            raise
        except MareyError as error:
            yield Failed(item.id, error)


def _scored(item: ClaimedItem, source: ScoreInput, loaded: _Loaded, control: BatchControl) -> Scored:
    measured = measure(source.items, source.npz, loaded.evaluator, progress=control.progress)
    check_measured(measured, len(source.items))
    reconstruction = find_reconstruction(loaded.bundle, source.request.bundle)
    made = len(measured.motions)
    report = report_of(
        source, measured, loaded.evaluator, loaded.real, reconstruction, progress=lambda: control.progress(made, made)
    )
    files = (
        ExportedFile("html", to_html(report), "text/html; charset=utf-8"),
        ExportedFile("json", to_json(report), "application/json"),
        ExportedFile("md", to_markdown(report), "text/markdown; charset=utf-8"),
    )
    return Scored(item.id, files, summary_of(report), report.regressed, headline(report).sentence)


def create_handler() -> Handler:
    """Create the handler from this process's settings."""
    return EvaluatorHandler(settings().device)
