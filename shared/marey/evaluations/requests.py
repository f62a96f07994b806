"""Conversion of an evaluation request to exact bundles, prompts and items. The API validates with it, the scheduler
runs it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, replace

from marey.bundles import Bundle, choose_bundle, choose_evaluator, named_by
from marey.bundles.choose import unlike
from marey.bundles.reference import reference_prompts
from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.evaluations import TEST_SPLIT, EvaluationRequest, EvaluationRow
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.items.item import MAX_ITEMS, Item
from marey.items.problems import MAX_PROBLEMS, InvalidItems, Problem
from marey.items.values import MAX_SEED
from marey.jobs import EVALUATOR_QUEUE, NO_TEXT, PRIORITY_LIMIT, NewItem, NewJob
from marey.jobs.generators import GeneratorCapabilities, capabilities_of, new_items

BACKGROUND = -PRIORITY_LIMIT
"""Priority of the jobs of evaluations: interactive work goes first."""


@dataclass(frozen=True)
class EvaluationPlan:
    """An evaluation that can run."""

    request: EvaluationRequest
    """With exact bundles and the model."""
    generator: GeneratorCapabilities
    prompts: tuple[EvaluationPrompt, ...]

    def generation(self, row: EvaluationRow) -> NewJob:
        """Return the job that generates its motions."""
        return NewJob(
            items=new_items((item, self.generator) for item in self._items()),
            tenant=row.tenant,
            name=f"evaluation {row.label}",
            comment=f"motions of evaluation {row.id}",
            priority=BACKGROUND,
            count=len(self.prompts) * self.request.repeats,
        )

    def _items(self) -> Iterator[Item]:
        request = self.request
        low, high = self.generator.min_seconds, self.generator.max_seconds
        for number, prompt in enumerate(self.prompts):
            seconds = prompt.seconds
            if seconds is not None and request.splits:
                seconds = min(max(seconds, low), high)  # the lengths of real clips are fixed
            yield Item(
                prompt.prompt,
                seconds=seconds,
                seed=request.seed + number * request.repeats,
                variants=request.repeats,
                settings=request.settings,
                timeline=prompt.timeline,
                constraints=prompt.constraints,
            )


def plan_evaluation(
    request: EvaluationRequest, prompts: tuple[EvaluationPrompt, ...] | None, config: Settings
) -> EvaluationPlan:
    """Resolve the bundles of a request, and validate that it can run. Loads no model.

    Args:
        prompts: custom prompts; None = those of the evaluator's bundle.

    Raises:
        NotFound, InvalidBundle, Refused: of the bundles; `where` is the field that names it.
        InvalidItems: with every prompt whose length, or timeline, the model cannot make.
        InvalidInput: a setting that the model lacks, too many motions, a seed that is too high.
    """
    with named_by("bundle"):
        generator = capabilities_of(choose_bundle(request.bundle, config=config, verify=False), config)
    with named_by("evaluator"):
        evaluator = choose_evaluator(request.evaluator, generator=generator.bundle, config=config)
        _check_layout(generator.bundle, evaluator)
        # Custom prompts are compared with real motion too: check that it exists before any motion is made.
        captions = tuple(p for split in request.splits or (TEST_SPLIT,) for p in reference_prompts(evaluator, split))
    prompts = captions if prompts is None else prompts
    settings = generator.check_settings(request.settings)
    if not request.splits:
        _check_prompts(prompts, generator)
    _check_size(request, len(prompts))
    exact = replace(
        request,
        bundle=generator.bundle.reference,
        model=generator.bundle.manifest.model,
        evaluator=evaluator.reference,
        settings=settings,
    )
    return EvaluationPlan(exact, generator, prompts)


def scoring_job(row: EvaluationRow) -> NewJob:
    """Return the job of one item that measures the motions."""
    evaluator = row.request.evaluator
    assert evaluator is not None  # exact since generation started
    item = NewItem(
        index=0,
        prompt=f"measure evaluation {row.label}",
        model=EVALUATOR_QUEUE,
        bundle=evaluator,
        batch_key=hashlib.sha256(evaluator.encode()).hexdigest(),
        text_key=NO_TEXT,
        text_batch_key=NO_TEXT,
        seed=row.request.seed,
    )
    return NewJob(
        items=[item],
        tenant=row.tenant,
        name=f"evaluation {row.label}",
        comment=f"score of evaluation {row.id}",
        priority=BACKGROUND,
        metered=False,
    )


def _check_layout(generator: Bundle, evaluator: Bundle) -> None:
    """Validate that generator and evaluator share a layout, before thousands of motions are made."""
    found = unlike(generator.manifest, evaluator.manifest)
    if found is not None:
        what, made, measured = found
        raise InvalidInput(
            f"{evaluator.manifest.name} measures motions of the {what} {measured}; {generator.manifest.name} makes "
            f"them of {made}",
            where="evaluator",
            hint=f"Choose an evaluator of the generator's {what}.",
        )


def _check_prompts(prompts: tuple[EvaluationPrompt, ...], generator: GeneratorCapabilities) -> None:
    problems: list[Problem] = []
    for line, prompt in enumerate(prompts, 1):
        try:
            generator.check_seconds(prompt.seconds)
        except InvalidInput as error:
            problems.append(Problem(line, "seconds", error.message))
        try:
            generator.check_timeline(prompt.timeline)
        except InvalidInput as error:
            problems.append(Problem(line, "timeline", error.on_a_line))
    if problems:
        raise InvalidItems(problems[:MAX_PROBLEMS], total=len(problems))


def _check_size(request: EvaluationRequest, prompts: int) -> None:
    motions = prompts * request.repeats
    if motions > MAX_ITEMS:
        raise InvalidInput(
            f"{prompts} prompts, {request.repeats} times each, are {motions} motions, over the limit of {MAX_ITEMS}",
            where="repeats",
        )
    if request.seed + motions - 1 > MAX_SEED:
        raise InvalidInput(f"plus {motions - 1} for the last motion is over {MAX_SEED}", where="seed")
