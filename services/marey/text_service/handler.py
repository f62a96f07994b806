"""The handler of the queue `text`: prompts to graphs and node vectors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from marey.bundles import TextSpec, find_bundle
from marey.core.errors import InvalidBundle, MareyError
from marey.jobs import TEXT_QUEUE, ClaimedItem
from marey.runtime.handler import Batch, BatchControl, Failed, Outcome, TextDone
from marey.text.keys import as_served
from marey.text.pipeline import TextPipeline

BATCH = 64
"""Prompts of one claim: half a second on one core, so a cancelled job does not wait long."""


class TextHandler:
    """Parses and encodes with the text specification of the loaded bundle."""

    queue = TEXT_QUEUE
    batch_size = BATCH

    def __init__(self) -> None:
        self._pipelines: dict[TextSpec, TextPipeline] = {}
        self._pipeline: TextPipeline | None = None

    def load(self, bundle: str) -> None:
        """Load the text pipeline of `bundle`; bundles of one specification share it.

        Raises:
            NotFound, InvalidBundle: the bundle, its encoder or its labeller is missing or does not match.
        """
        spec = find_bundle(bundle, verify=False).manifest.text
        if spec is None:
            raise InvalidBundle("this bundle does not read prompts", where=bundle)
        if spec not in self._pipelines:
            self._pipelines[spec] = TextPipeline.load(as_served(spec))
        self._pipeline = self._pipelines[spec]

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Return one bucket: texts are encoded one by one anyway."""
        return [batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Yield the features of each prompt, as soon as they are made."""
        assert self._pipeline is not None  # the loop loads before it runs
        self._pipeline.prefetch([item.prompt for item in batch.items if item.id not in control.dropped()])
        for done, item in enumerate(batch.items, 1):
            if item.id in control.dropped():
                continue
            yield _outcome(self._pipeline, item)
            control.progress(done, len(batch.items))


def _outcome(pipeline: TextPipeline, item: ClaimedItem) -> Outcome:
    """Return the features of one item under the key it was submitted with; the key, which promises weights, is
    checked."""
    try:
        if pipeline.key(item.prompt) != item.text_key:
            raise InvalidBundle(
                "the server that took this job has another text encoder or labeller than this worker",
                hint="Install the same models on both, then retry the job's failed items.",
            )
        (features,) = pipeline.features([item.prompt])
    except MareyError as error:
        return Failed(item.id, error)
    return TextDone(item.id, item.text_key, features.to_blob())


def create_handler() -> TextHandler:
    """Create the handler in a worker's child."""
    return TextHandler()
