"""Prompt adherence of a bundle: the 200 evaluation prompts, several seeds, judged on the exported joints.

    python -m marey.models.hgm3.obedience models/hgm3-starter --seeds 3 -o report
    python -m marey.models.mogo.obedience models/mogo-starter --seeds 3 -o report

Choose settings (steps, guidance, temperature) with `--captions DATA`, the captions of a prepared folder's validation
clips, or with `--prompts development`, never on the evaluation prompts. `--prompts blind` is a second held-out set
written by another author, and `fresh` a third one with mostly two-action prompts.

The checker reads joints only and is independent of the model; report its own rate on real clips beside every number.
Motions are judged as exported: feet cleaned, rotations solved.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

from marey.checks.judge import judge, straightness
from marey.checks.prompts import EvaluationPrompt, PromptSet, evaluation_prompts
from marey.checks.quality import Quality, quality
from marey.checks.rates import Rate, expectations, mean_quality, name_of
from marey.core.errors import InvalidBundle, InvalidInput
from marey.data.prepared import PreparedData
from marey.generation.export import finish
from marey.generation.port import Generator, Request, S
from marey.text.features import TextFeatures
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
    straight: bool | None  # None where no straight way was asked for
    quality: Quality


@dataclass(frozen=True)
class Report:
    """Rates of one bundle under one way of drawing."""

    bundle: str
    settings: Mapping[str, Any]
    prompts: tuple[EvaluationPrompt, ...]
    trials: tuple[Trial, ...]

    def rate(self, wanted: Callable[[EvaluationPrompt], bool]) -> Rate:
        """Share of passed trials among the prompts that `wanted` picks."""
        texts = {p.text for p in self.prompts if wanted(p)}
        passed = [t.passed for t in self.trials if t.prompt in texts]
        return Rate(len(passed), sum(passed))

    @property
    def summary(self) -> dict[str, Rate]:
        """The numbers that the bars are set on."""
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
        """Rates by group of prompts."""
        names = dict.fromkeys(t.group for t in self.trials)
        return {name: self.rate(lambda p, name=name: p.group == name) for name in names}

    def markdown(self) -> str:
        """Tables for a card or a page of results."""
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
        """Everything, each trial included."""
        return {
            "bundle": self.bundle,
            "settings": dict(self.settings),
            "summary": {name: asdict(rate) for name, rate in self.summary.items()},
            "groups": {name: asdict(rate) for name, rate in self.groups.items()},
            "trials": [asdict(t) for t in self.trials],
        }


def validation_prompts(folder: Path) -> tuple[EvaluationPrompt, ...]:
    """Each caption that validation clips have and a check exists for, in the order of the clips."""
    found: dict[str, EvaluationPrompt] = {}
    for clip in PreparedData.open(folder).split("val"):
        expected = expectations(clip.acts, clip.sides)
        if expected is None or not clip.captions:
            continue
        text = clip.captions[len(found) % len(clip.captions)]
        separate = any(e.act in ("kick", "punch", "slash", "dance") for e in expected)
        found.setdefault(text, EvaluationPrompt(text, name_of(expected), expected, separate))
    return tuple(found.values())


def measure(
    generator: Generator[S],
    texts: Sequence[TextFeatures],
    prompts: Sequence[EvaluationPrompt],
    *,
    seeds: Iterable[int],
    settings: S,
    frames: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Report:
    """Generate every prompt with every seed and judge it.

    Args:
        generator: the loaded bundle.
        texts: features of each prompt, in the order of `prompts`.
        prompts: prompts with their expectations.
        seeds: one motion a prompt and seed.
        settings: way of drawing.
        frames: length of every motion; None = the length estimator's.
        progress: called with motions done and wanted.
    """
    jobs = [
        (prompt, Request(text, seed, frames)) for seed in seeds for prompt, text in zip(prompts, texts, strict=True)
    ]
    trials: list[Trial] = []
    for start in range(0, len(jobs), generator.batch):
        part = jobs[start : start + generator.batch]
        trials += _judged(generator, part, settings)
        progress(len(trials), len(jobs))
    return Report(generator.bundle.reference, generator.described(settings), tuple(prompts), tuple(trials))


def _judged(generator: Generator[S], jobs: Sequence[tuple[EvaluationPrompt, Request]], settings: S) -> Iterator[Trial]:
    results = generator.generate([request for _, request in jobs], settings)
    for (prompt, request), made in zip(jobs, results, strict=True):
        assert made is not None  # nothing drops rows here
        clip = finish(generator, request, made, settings)
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


def _settings(given: Sequence[str]) -> dict[str, Any]:
    """`["guidance=3", "steps=8"]` by name."""
    out: dict[str, Any] = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            out[name] = json.loads(value)
        except ValueError as error:
            raise InvalidInput("is not NAME=VALUE", where=f"--set {text}", hint="Such as guidance=3.") from error
    return out


def parser_of(program: str) -> argparse.ArgumentParser:
    """The options that all models share."""
    parser = argparse.ArgumentParser(prog=f"python -m {program}", description="Does a bundle do what the prompts say?")
    parser.add_argument("bundle", help="name or path")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, help="length of every motion; else the model's own choice")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=VALUE", help="one setting, guidance=3")
    parser.add_argument("--captions", type=Path, metavar="DATA", help="a folder: its validation captions instead")
    parser.add_argument(
        "--prompts", choices=get_args(PromptSet), default="evaluation", help="the set that is asked for"
    )  # fmt: skip
    parser.add_argument("--every", type=int, default=1, help="only each K-th prompt, for a quick look")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("-o", "--output", type=Path, help="folder of report.json and report.md")
    return parser


def pipeline_of(generator: Generator[Any]) -> TextPipeline:
    """Text pipeline of a bundle. Raise InvalidBundle if the bundle declares none."""
    text = generator.bundle.manifest.text
    if text is None:
        raise InvalidBundle("declares no text pipeline", where=str(generator.bundle.path))
    return TextPipeline.load(text)


def report_of(generator: Generator[Any], chosen: argparse.Namespace) -> Report:
    """Measure a bundle as the command line requests, and print its failures."""
    prompts = validation_prompts(chosen.captions) if chosen.captions else evaluation_prompts(chosen.prompts)
    prompts = prompts[:: chosen.every]
    report = measure(
        generator,
        pipeline_of(generator).features([p.text for p in prompts]),
        prompts,
        seeds=range(chosen.seeds),
        settings=generator.settings(_settings(chosen.set)),
        frames=None if chosen.seconds is None else round(chosen.seconds * generator.limits.fps),
        progress=lambda done, total: print(f"\r{done}/{total}", end="", file=sys.stderr),  # noqa: T201
    )
    print(file=sys.stderr)  # noqa: T201
    failures = defaultdict[str, list[str]](list)
    for trial in report.trials:
        if not trial.passed:
            failures[trial.group].append(f"{trial.prompt!r} (seed {trial.seed}): {trial.reason}")
    for group, reasons in failures.items():
        print(f"{group}:", *reasons[:6], sep="\n  ", file=sys.stderr)  # noqa: T201
    return report


def publish(found: Mapping[str, Any], markdown: str, folder: Path | None) -> None:
    """Print the tables; JSON and Markdown into a folder where one is named."""
    print(markdown)  # noqa: T201
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "report.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
        (folder / "report.md").write_text(markdown, encoding="utf-8")
