"""Measurements of a bundle by the referee, in this process: `marey eval actions`, `sequences`, `pairs` and
`studio`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

from marey.core.errors import InvalidInput
from marey.core.extras import extra
from marey.registry import get_model, resolve

if TYPE_CHECKING:
    from marey.bundles import Bundle
    from marey.motion.clip import MotionClip
    from marey.referee.adherence import ActionRate, ActionTrial
    from marey.referee.prompts import ActionPrompt
    from marey.text.pipeline import TextPipeline

    Motion = tuple[ActionPrompt, int, MotionClip]


class _Prompt(Protocol):
    @property
    def text(self) -> str: ...


P = TypeVar("P", bound=_Prompt)


@dataclass(frozen=True)
class RefereeReport:
    """The report of a bundle: its table, and all of it as JSON values."""

    markdown: str
    document: Mapping[str, Any]


@dataclass(frozen=True)
class MeasureOptions:
    """How a bundle is measured.

    Attributes:
        seeds: motions of each prompt, with the seeds from 0 on.
        settings: sampling settings by name.
        threads: of torch; 0 = its own choice.
        output: folder for report.json and report.md.
        progress: called with motions done and wanted.
    """

    seeds: int
    settings: Mapping[str, float]
    threads: int
    output: Path | None
    progress: Callable[[int, int], None]


def measure_actions(
    bundle: str,
    actions: Sequence[str],
    options: MeasureOptions,
    *,
    development: bool = False,
    record: Path | None = None,
    picture: Path | None = None,
) -> RefereeReport:
    """Generate the prompts of actions with a bundle, and let the referee judge the exported joints.

    Args:
        actions: ids of the vocabulary; none = all.
        development: take the prompts by which settings are chosen, instead of the held-out ones.
        record: the prepared folder that the bundle was trained on; its manifest and card get the result.
        picture: a PNG of the first motion of each action, whatever the referee says of it.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        NotFound, InvalidFile: of the prepared folder.
        InvalidInput: no such action or setting; or a part of the actions or seeds, or what was measured by the
            prompts for development, is to be recorded; or `picture` is not a writable PNG.
    """
    if picture is not None:
        from marey.viz.render import check_png

        check_png(picture)
    run = _Run.of(bundle, options)
    from marey.referee.adherence import LEAST_SEEDS

    if record is not None and (actions or options.seeds < LEAST_SEEDS or development):
        raise InvalidInput(
            f"only all actions by held-out prompts with {LEAST_SEEDS} seeds or more are recorded", where="--record"
        )
    learning = None if record is None else _Learning(record)
    from marey.referee import Body
    from marey.referee.adherence import document, judge_trial, markdown, rates
    from marey.referee.prompts import action_prompts, development_prompts

    asked = _of_actions(development_prompts() if development else action_prompts(), actions)
    trials: list[ActionTrial] = []
    firsts: dict[tuple[str, ...], tuple[MotionClip, ActionTrial]] = {}
    for prompt, seed, clip in run.motions(asked) if learning is None else learning.watched(run.motions(asked)):
        trials.append(judge_trial(prompt, seed, Body(clip.joints, clip.fps)))
        firsts.setdefault(tuple(prompt.actions), (clip, trials[-1]))
    found = rates(trials)
    if learning is not None:
        learning.record(run.bundle, found)
    if picture is not None:
        _draw(list(firsts.values()), found, run.reference, picture)
    return run.report(markdown(run.reference, found), document(run.reference, run.settings, trials, found))


class _Learning:
    """The data that a bundle was trained on, beside the motions that it makes."""

    def __init__(self, prepared: Path) -> None:
        from marey.data.prepared import PreparedData
        from marey.evaluator.copies import TrainingPoses
        from marey.evaluator.standings import training_takes

        data = PreparedData.open(prepared, verify=False)
        self._skeleton = data.layout.skeleton
        self._takes = training_takes(data.clips)
        self._training = TrainingPoses.of(data)
        self._distances: list[tuple[str, float]] = []

    def watched(self, motions: Iterator[Motion]) -> Iterator[Motion]:
        """Yield the motions, and measure how near those of the first seed are to the training clips."""
        from marey.evaluator.copies import poses

        for prompt, seed, clip in motions:
            if seed == 0:
                nearest = self._training.nearest(poses(clip.joints, clip.fps, self._skeleton))
                self._distances.append(("; ".join(prompt.actions), nearest.millimetres))
            yield prompt, seed, clip

    def record(self, bundle: Bundle, rates: Sequence[ActionRate]) -> None:
        """Write lists and table into the bundle."""
        from marey.evaluator.standings import Learned, record, share_of_copies

        record(bundle, rates, Learned(self._takes, share_of_copies(self._distances)))


def _draw(
    motions: Sequence[tuple[MotionClip, ActionTrial]], found: Sequence[ActionRate], bundle: str, picture: Path
) -> None:
    """Draw a motion of each action, the best action first, with the share of its motions that the referee passes."""
    from marey.viz.overview import draw_tile, overview
    from marey.viz.paper import theme_named
    from marey.viz.render import save_png

    shares = {rate.action: rate.share for rate in found}
    named = [("; ".join(trial.prompt.actions), clip, trial) for clip, trial in motions]
    named.sort(key=lambda each: (-shares[each[0]], each[0]))
    theme = theme_named("light")
    tiles = (
        draw_tile(
            clip,
            f"{action}, {shares[action]:.0%} (this one {'passes' if trial.passed else 'fails'}): {trial.prompt.text}",
            theme=theme,
        )
        for action, clip, trial in named
    )
    save_png(overview(tiles, len(named), f"{bundle}: the first motion drawn of each action", theme=theme), picture)


def measure_studio(bundle: str, options: MeasureOptions) -> RefereeReport:
    """Generate a studio's list with a bundle; count motions that do what was asked, and those that are flagged.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        InvalidInput: no such setting.
    """
    run = _Run.of(bundle, options)
    from marey.referee import Body
    from marey.referee.prompts import studio_prompts
    from marey.referee.studio import judge_studio, studio_document, studio_markdown, studio_rates

    trials = [
        judge_studio(prompt, seed, Body(clip.joints, clip.fps), clip.manifest)
        for prompt, seed, clip in run.motions(studio_prompts())
    ]
    table = studio_markdown(run.reference, studio_rates(trials))
    return run.report(table, studio_document(run.reference, run.settings, trials))


def measure_sequences(bundle: str, options: MeasureOptions, *, development: bool = False) -> RefereeReport:
    """Generate prompts of several actions one after another with a bundle, and let the referee judge their order.

    Args:
        development: take the prompts by which settings are chosen, instead of the held-out ones.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        InvalidInput: no such setting.
    """
    run = _Run.of(bundle, options)
    from marey.checks import reader_prompts
    from marey.referee import Body
    from marey.referee.adherence import document, judge_trial, sequence_markdown, sequence_rates
    from marey.referee.prompts import DEVELOPMENT_AUTHOR, ActionPrompt, sequence_prompts

    known = reader_prompts.sequence_prompts()
    chosen = [ActionPrompt(text, actions, "", DEVELOPMENT_AUTHOR) for text, actions in known]
    trials = [
        judge_trial(prompt, seed, Body(clip.joints, clip.fps))
        for prompt, seed, clip in run.motions(chosen if development else sequence_prompts())
    ]
    found = sequence_rates(trials)
    return run.report(sequence_markdown(run.reference, found), document(run.reference, run.settings, trials, found))


def measure_pairs(
    bundle: str, properties: Sequence[str], options: MeasureOptions, *, development: bool = False
) -> RefereeReport:
    """Generate minimal pairs of prompts with a bundle, and count the pairs whose motions differ as asked.

    Args:
        properties: side, count, order, direction, speed or duration; none = all.
        development: take the prompts by which settings are chosen, instead of the held-out ones.

    Raises:
        NotFound, InvalidBundle: of the bundle.
        InvalidInput: no such property or setting.
    """
    from marey.referee import Body
    from marey.referee.pairs import (
        PROPERTIES,
        development_pairs,
        pair_prompts,
        pairs_document,
        pairs_markdown,
        property_rates,
        read_property,
    )

    if unknown := [name for name in properties if name not in PROPERTIES]:
        hint = f"Known: {', '.join(PROPERTIES)}."
        raise InvalidInput(f"there are no pairs for {unknown[0]!r}", where="--property", hint=hint)
    run = _Run.of(bundle, options)
    known = development_pairs() if development else pair_prompts()
    asked = [prompt for prompt in known if not properties or prompt.property in properties]
    readings = [read_property(prompt, seed, Body(clip.joints, clip.fps)) for prompt, seed, clip in run.motions(asked)]
    table = pairs_markdown(run.reference, property_rates(readings))
    return run.report(table, pairs_document(run.reference, run.settings, readings))


def _of_actions(prompts: Sequence[ActionPrompt], actions: Sequence[str]) -> list[ActionPrompt]:
    known = {action for prompt in prompts for action in prompt.actions}
    if unknown := [action for action in actions if action not in known]:
        raise InvalidInput(
            f"there are no prompts for {unknown[0]!r}",
            where="--action",
            hint=f"Known: {', '.join(sorted(known))}.",
        )
    return [prompt for prompt in prompts if not actions or set(prompt.actions) <= set(actions)]


class _Run:
    """A loaded generator with its settings."""

    def __init__(self, generator: Any, options: MeasureOptions, values: Mapping[str, Any]) -> None:
        from marey.generation.candidates import split_settings

        self.bundle: Bundle = generator.bundle
        self.reference: str = self.bundle.reference
        self._generator = generator
        self._options = options
        own, self._plan = split_settings(values)
        self._settings = generator.settings(own)
        chosen = {name: value for name, value in values.items() if name not in own}
        self.settings: Mapping[str, object] = {**generator.describe_settings(self._settings), **chosen}

    @classmethod
    def of(cls, bundle: str, options: MeasureOptions) -> _Run:
        with extra("worker"):
            from marey.bundles import choose_bundle
            from marey.bundles.limits import check_settings
        found = choose_bundle(bundle)
        values = check_settings(found, options.settings)
        load = resolve(get_model(found.manifest.model, where=bundle).load)
        return cls(load(found, threads=options.threads), options, values)

    def motions(self, prompts: Sequence[P]) -> Iterator[tuple[P, int, MotionClip]]:
        """Generate each prompt with each seed."""
        from marey.bundles.limits import length_of
        from marey.generation.asked import drawing_of
        from marey.generation.candidates import draw_clips
        from marey.generation.port import Request
        from marey.generation.shots.dispatch import resolve_request
        from marey.items.item import Item
        from marey.training.adherence import pipeline_of

        generator = self._generator
        pipeline = pipeline_of(generator)
        texts = pipeline.features([prompt.text for prompt in prompts])
        lengths = (length_of(generator.bundle, Item(prompt.text)) for prompt in prompts)
        frames = [generator.limits.frames_of(seconds, text) for seconds, text in zip(lengths, texts, strict=True)]
        scopes = self._scopes(pipeline, prompts)
        drawing = drawing_of(generator, self._settings)
        jobs = [
            (prompt, resolve_request(generator, Request(text, seed, wanted, scope=scope, drawing=drawing)))
            for seed in range(self._options.seeds)
            for prompt, text, wanted, scope in zip(prompts, texts, frames, scopes, strict=True)
        ]
        for start in range(0, len(jobs), generator.batch):
            part = jobs[start : start + generator.batch]
            clips = draw_clips(generator, [request for _, request in part], self._settings, self._plan)
            for (prompt, request), clip in zip(part, clips, strict=True):
                yield prompt, request.seed, clip
            self._options.progress(min(start + generator.batch, len(jobs)), len(jobs))

    def _scopes(self, pipeline: TextPipeline, prompts: Sequence[P]) -> list[dict[str, Any] | None]:
        """Return the scope of each prompt, as the text stage of a job reads it; by it candidates are matched."""
        from marey.bundles.scope import judges_meaning
        from marey.text.meaning import MeaningJudge
        from marey.vocabulary.scope import match_scope

        lists = self.bundle.manifest.actions
        if lists is None:
            return [None] * len(prompts)
        judge = MeaningJudge.of(pipeline).judge if judges_meaning(self.bundle.manifest.text) else match_scope
        return [judge(prompt.text, lists).as_json() for prompt in prompts]

    def report(self, markdown: str, document: Mapping[str, Any]) -> RefereeReport:
        """Return the report; write it where a folder is given."""
        from marey.training.adherence import write_report

        output = self._options.output
        if output is not None:
            write_report(document, markdown, output)
        return RefereeReport(markdown, document)
