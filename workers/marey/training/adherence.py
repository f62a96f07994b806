"""Prompt adherence of a bundle: the 200 evaluation prompts, several seeds, judged on the exported joints.

    marey eval adherence hgm3-starter --seeds 3 -o report

Choose settings (steps, guidance, temperature) with `--captions DATA`, the captions of a prepared folder's validation
clips, or with `--prompts development`, never on the evaluation prompts. `--prompts blind` is a second held-out set
written by another author, and `fresh` a third one with mostly two-action prompts.

The checker reads joints only and is independent of the model; report its own rate on real clips beside every number.
Motions are judged as exported: feet cleaned, rotations solved.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from marey.checks.judge import judge, straightness
from marey.checks.prompts import HeldOutPrompt
from marey.checks.quality import Quality, quality
from marey.checks.rates import Rate, expectations, mean_quality, name_of
from marey.core.errors import InvalidBundle
from marey.data.prepared import PreparedData
from marey.generation.asked import drawing_of
from marey.generation.export import finish
from marey.generation.port import Generator, Request, S
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.motion.clip import MotionClip
from marey.text.features import TextFeatures
from marey.text.keys import as_served
from marey.text.pipeline import TextPipeline


@dataclass(frozen=True)
class Trial:
    """One motion and the checker's verdict."""

    prompt: str
    group: str
    seed: int
    seconds: float
    passed: bool
    reason: str
    straight: bool | None  # None if the prompt does not ask for a straight path
    quality: Quality


@dataclass(frozen=True)
class AdherenceReport:
    """Rates of one bundle under one set of sampling settings."""

    bundle: str
    settings: Mapping[str, Any]
    prompts: tuple[HeldOutPrompt, ...]
    trials: tuple[Trial, ...]

    def rate(self, wanted: Callable[[HeldOutPrompt], bool]) -> Rate:
        """Return the share of passed trials among the prompts that `wanted` selects."""
        texts = {p.text for p in self.prompts if wanted(p)}
        passed = [t.passed for t in self.trials if t.prompt in texts]
        return Rate(len(passed), sum(passed))

    @property
    def summary(self) -> dict[str, Rate]:
        """Return the rates that have targets."""
        straight = [t.straight for t in self.trials if t.straight is not None]
        return {
            "one action": self.rate(lambda p: not p.separate and len(p.expected) == 1),
            "side and hand": self.rate(lambda p: not p.separate and p.sided),
            "two actions in order": self.rate(lambda p: not p.separate and len(p.expected) > 1),
            "all but kick, punch, slash, dance": self.rate(lambda p: not p.separate),
            "straight ways": Rate(len(straight), sum(straight)),
        }

    @property
    def groups(self) -> dict[str, Rate]:
        """Return rates by group of prompts."""
        names = dict.fromkeys(t.group for t in self.trials)
        return {name: self.rate(lambda p, name=name: p.group == name) for name in names}

    def markdown(self) -> str:
        """Return tables for a card or a page of results."""
        physical = mean_quality(t.quality for t in self.trials)
        lines = [
            f"Bundle `{self.bundle}`, {len(self.trials)} motions.",
            "",
            "| prompts | motions | adherence |",
            "|---|---|---|",
        ]
        lines += [
            f"| {name} | {r.clips} | {r.share:.1%} |" for name, r in [*self.summary.items(), *self.groups.items()]
        ]
        lines += ["", f"Foot skate {physical.skate:.3f}, jerk {physical.jerk:.1f} m/s³, floor penetration "]
        lines[-1] += f"{1000 * physical.penetration:.0f} mm."
        return "\n".join(lines) + "\n"

    def to_json(self) -> dict[str, object]:
        """Return all data, each trial included."""
        return {
            "bundle": self.bundle,
            "settings": dict(self.settings),
            "summary": {name: asdict(rate) for name, rate in self.summary.items()},
            "groups": {name: asdict(rate) for name, rate in self.groups.items()},
            "trials": [asdict(t) for t in self.trials],
        }


def validation_prompts(folder: Path) -> tuple[HeldOutPrompt, ...]:
    """Return each caption of validation clips that has a check, in the order of the clips."""
    found: dict[str, HeldOutPrompt] = {}
    for clip in PreparedData.open(folder).split("val"):
        expected = expectations(clip.acts, clip.sides)
        if expected is None or not clip.captions:
            continue
        text = clip.captions[len(found) % len(clip.captions)]
        separate = any(e.act in ("kick", "punch", "slash", "dance") for e in expected)
        found.setdefault(text, HeldOutPrompt(text, name_of(expected), expected, separate))
    return tuple(found.values())


def measure(
    generator: Generator[S],
    texts: Sequence[TextFeatures],
    prompts: Sequence[HeldOutPrompt],
    *,
    seeds: Iterable[int],
    settings: S,
    frames: int | None = None,
    drawing: bool = True,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> AdherenceReport:
    """Generate every prompt with every seed and judge it.

    Args:
        generator: the loaded bundle.
        texts: features of each prompt, in the order of `prompts`.
        prompts: prompts with their expectations.
        seeds: seeds, one motion per prompt and seed.
        settings: sampling settings.
        frames: length of every motion; None = the length estimator's.
        drawing: rules may draw movements where the settings let them; else the network makes all.
        progress: called with motions done and wanted.
    """
    drawing = drawing and drawing_of(generator, settings)
    jobs = [
        (prompt, Request(text, seed, frames, drawing=drawing))
        for seed in seeds
        for prompt, text in zip(prompts, texts, strict=True)
    ]
    trials: list[Trial] = []
    for start in range(0, len(jobs), generator.batch):
        part = jobs[start : start + generator.batch]
        trials += _judged(generator, part, settings)
        progress(len(trials), len(jobs))
    return AdherenceReport(
        generator.bundle.reference, generator.describe_settings(settings), tuple(prompts), tuple(trials)
    )


def _judged(generator: Generator[S], jobs: Sequence[tuple[HeldOutPrompt, Request]], settings: S) -> Iterator[Trial]:
    clips = finished(generator, [request for _, request in jobs], settings)
    for (prompt, request), clip in zip(jobs, clips, strict=True):
        verdict = judge(clip.joints, clip.fps, prompt.expected)
        wants_straight = len(prompt.expected) == 1 and prompt.expected[0].straight
        yield Trial(
            prompt.text,
            prompt.group,
            request.seed,
            len(clip.joints) / clip.fps,
            verdict.passed,
            verdict.reason,
            straightness(clip.joints, clip.fps).straight if wants_straight else None,
            quality(clip.joints, clip.fps),
        )


def finished(generator: Generator[S], requests: Sequence[Request], settings: S) -> Iterator[MotionClip]:
    """Generate a batch, and yield its motions as they are exported, in order."""
    resolved = [resolve_request(generator, request) for request in requests]
    for request, made in zip(resolved, generate_any(generator, resolved, settings), strict=True):
        assert made is not None  # no rows are dropped here
        yield finish(generator, request, made, settings)


def pipeline_of(generator: Generator[Any], *, served: bool = False) -> TextPipeline:
    """Return the text pipeline of a bundle; if `served`, with the rewriter of the settings, as workers read prompts.

    Raises:
        InvalidBundle: the bundle declares none.
        InvalidInput: the rewriter lacks its settings.
    """
    text = generator.bundle.manifest.text
    if text is None:
        raise InvalidBundle("declares no text pipeline", where=str(generator.bundle.path))
    return TextPipeline.load(as_served(text) if served else text)


def judge_bundle(
    generator: Generator[Any],
    prompts: Sequence[HeldOutPrompt],
    *,
    seeds: int,
    seconds: float | None = None,
    settings: Mapping[str, Any] | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> AdherenceReport:
    """Judge a bundle on prompts, each with the seeds from 0 on; see `measure`.

    Args:
        seconds: length of every motion; None = the model's own choice.
        settings: sampling settings by name.

    Raises:
        InvalidInput: an unknown setting, or a value out of range.
        InvalidBundle: the bundle declares no text pipeline.
    """
    return measure(
        generator,
        pipeline_of(generator).features([p.text for p in prompts]),
        prompts,
        seeds=range(seeds),
        settings=generator.settings(settings or {}),
        frames=generator.limits.frames_of(seconds),
        progress=progress,
    )


def failures_of(report: AdherenceReport) -> dict[str, list[str]]:
    """List failed prompts, with seed and reason, by group."""
    failures = defaultdict[str, list[str]](list)
    for trial in report.trials:
        if not trial.passed:
            failures[trial.group].append(f"{trial.prompt!r} (seed {trial.seed}): {trial.reason}")
    return dict(failures)


def write_report(found: Mapping[str, Any], markdown: str, folder: Path) -> None:
    """Write `report.json` and `report.md` into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "report.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    (folder / "report.md").write_text(markdown, encoding="utf-8")
