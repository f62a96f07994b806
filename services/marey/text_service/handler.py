"""The handler of the queue `text`: prompts to graphs and node vectors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

from marey.bundles import Bundle, TextSpec, find_bundle
from marey.bundles.limits import stated_seconds_of
from marey.bundles.scope import judges_meaning
from marey.core.errors import InvalidBundle, MareyError
from marey.items.problems import UnknownAction
from marey.items.timeline import prompts_with_rows
from marey.jobs import TEXT_QUEUE, ClaimedItem
from marey.jobs.lease_types import PromptScope
from marey.jobs.types import named_prompts, prompts_of_ops
from marey.runtime.handler import Batch, BatchControl, Failed, Outcome, TextDone
from marey.text.keys import as_served, scope_key
from marey.text.meaning import MeaningJudge
from marey.text.pipeline import TextPipeline
from marey.text.several import SeveralTexts, several_key
from marey.vocabulary.report import refusal, says_known, with_length
from marey.vocabulary.scope import ScopePolicy, scope_of_prompts, scope_of_rows

BATCH = 64
"""Prompts of one claim: a second of one core, so a cancelled job does not wait long."""
TOGETHER = 16
"""Prompts that are encoded together: more gain little."""


class TextHandler:
    """Parses and encodes with the text specification of the loaded bundle."""

    queue = TEXT_QUEUE
    batch_size = BATCH

    def __init__(self) -> None:
        self._pipelines: dict[TextSpec, TextPipeline] = {}
        self._stages: dict[TextSpec, ScopeStage] = {}
        self._pipeline: TextPipeline | None = None
        self._scopes: ScopeStage | None = None

    def load(self, bundle: str) -> None:
        """Load the text pipeline of `bundle`; bundles of one specification share it.

        Raises:
            NotFound, InvalidBundle: the bundle, its encoder or its labeller is missing or does not match.
        """
        found = find_bundle(bundle, verify=False)
        spec = found.manifest.text
        if spec is None:
            raise InvalidBundle("this bundle does not read prompts", where=bundle)
        if spec not in self._pipelines:
            self._pipelines[spec] = TextPipeline.load(as_served(spec))
            if judges_meaning(spec):
                self._stages[spec] = ScopeStage(MeaningJudge.of(self._pipelines[spec]))
        self._pipeline, self._scopes = self._pipelines[spec], self._stages.get(spec)
        if self._scopes is not None:
            self._scopes.bundles[bundle] = found

    def buckets(self, batch: Batch) -> Sequence[Sequence[ClaimedItem]]:
        """Return one bucket: texts of any length are encoded together."""
        return [batch.items]

    def run(self, batch: Batch, control: BatchControl) -> Iterator[Outcome]:
        """Yield the features of each prompt, as soon as they are made."""
        assert self._pipeline is not None  # the loop loads before it runs
        dropped = control.dropped()
        items = [item for item in batch.items if item.id not in dropped]
        self._pipeline.prefetch([prompt for item in items for _, prompt in _prompts_of(item)])
        for low in range(0, len(items), TOGETHER):
            dropped = control.dropped()
            part = [item for item in items[low : low + TOGETHER] if item.id not in dropped]
            for outcome in _outcomes(self._pipeline, self._scopes, part, batch.claim.scope):
                if outcome.item not in control.dropped():
                    yield outcome
            control.progress(min(low + TOGETHER, len(items)), len(items))


@dataclass(frozen=True)
class ScopeStage:
    """Scopes of prompts, for bundles of one text specification."""

    judge: MeaningJudge
    bundles: dict[str, Bundle] = field(default_factory=dict[str, Bundle])
    """The bundles that were asked for."""

    def scope_of(self, item: ClaimedItem, policy: ScopePolicy) -> PromptScope | None:
        """Return the encoder's verdict on an item's prompt; None if the words decide it, or it is not examined.

        Raises:
            UnknownAction: the job refuses unknown prompts, and this is one.
        """
        if policy == "ignore":
            return None
        bundle = self._bundle(item.bundle)
        lists = bundle.manifest.actions
        prompts = _examined(item)
        if lists is None:
            return None
        scopes = [self.judge.judge(prompt, lists) for _, prompt in prompts]
        if all(scope.by == "words" for scope in scopes):
            return None
        for (row, _), scope in zip(prompts, scopes, strict=True):
            if policy == "refuse" and (message := refusal(scope)) is not None:
                hint = says_known(bundle.manifest.name, lists.known)
                raise UnknownAction(f"{row or 'the prompt'} {message}", hint=hint)
        if item.edits is not None:
            texts = "\n".join(prompt for _, prompt in prompts)
            key = scope_key(texts, item.bundle, lists, of_edit=True)
            return PromptScope(key, scope_of_prompts(scopes).as_json())
        key = scope_key(item.prompt, item.bundle, lists, in_rows=item.timeline is not None)
        if item.timeline is not None:
            return PromptScope(key, scope_of_rows(scopes).as_json())
        return PromptScope(key, with_length(scopes[0], item.prompt, stated_seconds_of(bundle)).as_json())

    def _bundle(self, name: str) -> Bundle:
        if name not in self.bundles:
            self.bundles[name] = find_bundle(name, verify=False)
        return self.bundles[name]


def _outcomes(
    pipeline: TextPipeline, scopes: ScopeStage | None, items: Sequence[ClaimedItem], policy: ScopePolicy
) -> Iterator[Outcome]:
    """Yield the features of each item under the key it was submitted with, and its scope; or why it has none."""
    found: list[tuple[ClaimedItem, PromptScope | None, list[str]]] = []
    for item in items:
        prompts = [prompt for _, prompt in _prompts_of(item)]
        try:
            _check_key(pipeline, item, prompts)
            scope = None if scopes is None else scopes.scope_of(item, policy)
        except MareyError as error:
            yield Failed(item.id, error)
        else:
            found.append((item, scope, prompts))
    features = iter(pipeline.features([prompt for _, _, prompts in found for prompt in prompts]))
    for item, scope, prompts in found:
        made = tuple(islice(features, len(prompts)))
        text = made[0] if _is_single(item) else SeveralTexts(made)
        yield TextDone(item.id, item.text_key, text.to_blob(), scope)


def _check_key(pipeline: TextPipeline, item: ClaimedItem, prompts: Sequence[str]) -> None:
    """Raise InvalidBundle if the key of an item, which promises weights, is not that of its prompts here; InvalidInput
    if one of them cannot be used."""
    keys = [pipeline.key(prompt) for prompt in prompts]
    if (keys[0] if _is_single(item) else several_key(keys)) != item.text_key:
        raise InvalidBundle(
            "the server that took this job has another text encoder or labeller than this worker",
            hint="Install the same models on both, then retry the job's failed items.",
        )


def _is_single(item: ClaimedItem) -> bool:
    return item.timeline is None and item.edits is None


def _prompts_of(item: ClaimedItem) -> list[tuple[str | None, str]]:
    if item.edits is not None:
        return [(None, prompt) for prompt in prompts_of_ops(item.edits.ops)]
    return prompts_with_rows(item.prompt, item.timeline)


def _examined(item: ClaimedItem) -> list[tuple[str | None, str]]:
    """Return the prompts whose scope counts: of an edit those that it names."""
    return _prompts_of(item) if item.edits is None else [(None, prompt) for prompt in named_prompts(item.edits.ops)]


def create_handler() -> TextHandler:
    """Create the handler in a worker's child."""
    return TextHandler()
