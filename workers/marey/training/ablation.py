"""Shared code of ablations: judge a variant, measure variants on several seeds, and tabulate them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean, stdev
from typing import Any

from marey.checks.prompts import evaluation_prompts
from marey.checks.rates import mean_quality
from marey.core.whole_files import whole_file
from marey.generation.port import Generator, S
from marey.text.features import TextFeatures
from marey.training.adherence import measure, pipeline_of
from marey.training.budget import Budget
from marey.training.staging import C, TrainOptions

DECIDES = "all but kick, punch, slash, dance"
"""Rate of `judge` that compares variants."""


@dataclass(frozen=True)
class AblationRequest:
    """The request of an ablation: `marey train ablate`.

    Attributes:
        data: prepared data.
        bundle: gives the configuration and the parts that no variant trains.
        output: folder of runs, numbers and tables.
        steps: of each training.
        batch: clips a step; None = as configured.
        seeds: training seeds of each variant; see `compare`.
        threads: 0 = PyTorch's default.
        other: prepared data that an ablation of data adds; None = none.
        protocol: measures a generator with its settings, in a folder of its own, by the published protocol; None = rows
            hold no such numbers.
    """

    data: Path
    bundle: str
    output: Path
    steps: int
    batch: int | None = None
    seeds: int = 1
    threads: int = 0
    other: Path | None = None
    protocol: Callable[[Generator[Any], Any, Path], Mapping[str, float]] | None = None

    def measured(self, generator: Generator[S], settings: S, about: str) -> Mapping[str, float]:
        """Return the numbers of the published protocol of a row, named `about` below the output folder."""
        if self.protocol is None:
            return {}
        return self.protocol(generator, settings, self.output / "protocol" / about)

    def training(self, run: Path, config: C, seed: int) -> TrainOptions[C]:
        """Return the options of the training of a variant."""
        return TrainOptions(self.data, run, config, Budget(steps=self.steps), seed=seed, threads=self.threads)


def judge(generator: Generator[S], texts: Sequence[TextFeatures], settings: S) -> dict[str, float]:
    """Measure prompt adherence, foot skate and jerk of what the network of one bundle makes, without drawn movements:
    those are the same in every row."""
    report = measure(generator, texts, evaluation_prompts(), seeds=[0], settings=settings, drawing=False)
    physical = mean_quality(t.quality for t in report.trials)
    rates = {name: rate.share for name, rate in report.summary.items()}
    return rates | {"foot skate": physical.skate, "jerk": physical.jerk}


def evaluation_texts(generator: Generator[S]) -> list[TextFeatures]:
    """Read the evaluation prompts for `judge`, as the bundle reads prompts.

    Raises:
        InvalidBundle: the bundle declares no text pipeline.
    """
    return pipeline_of(generator).features([prompt.text for prompt in evaluation_prompts()])


def compare(
    variants: Sequence[str], measured: Callable[[str, int], Mapping[str, float]], output: Path, name: str, *, seeds: int
) -> str:
    """Measure every variant with every seed, and with one further seed those whose intervals touch another's.

    Numbers are kept in the folder `output/<name>`: a second call measures what is missing. The table is written after
    each measurement, as `output/<name>.md`, and the numbers of all as `output/<name>.json` at the end.

    Args:
        variants: their names, rows of the table.
        measured: numbers of a variant trained with a seed.
        output: folder.
        name: of the ablation.
        seeds: first seeds, from 0 on; with one there are no intervals.
    """
    results: dict[str, list[Mapping[str, float]]] = {}
    (output / name).mkdir(parents=True, exist_ok=True)

    def add(variant: str, seed: int) -> None:
        file = output / name / f"{file_name(variant)}.{seed}.json"
        if not file.is_file():
            text = json.dumps(dict(measured(variant, seed)), indent=1)
            with whole_file(file, alone=True) as part:
                part.write_text(text, encoding="utf-8")
        results.setdefault(variant, []).append(json.loads(file.read_text(encoding="utf-8")))
        (output / f"{name}.md").write_text(table(results), encoding="utf-8")

    for seed in range(seeds):
        for variant in variants:
            add(variant, seed)
    for variant in touching(results) if seeds > 1 else ():
        add(variant, seeds)
    (output / f"{name}.json").write_text(json.dumps(results, indent=1), encoding="utf-8")
    return table(results)


def file_name(row: str) -> str:
    """Return the name of a row in names of files."""
    return re.sub("[^a-z0-9]+", "-", row.lower()).strip("-")


def touching(results: Mapping[str, Sequence[Mapping[str, float]]], metric: str = DECIDES) -> list[str]:
    """Return the variants whose interval of the deciding metric overlaps that of another one."""
    found = {name: interval([row[metric] for row in rows]) for name, rows in results.items() if metric in rows[0]}
    return [
        name
        for name, (middle, half) in found.items()
        if any(abs(middle - other) <= half + wide for each, (other, wide) in found.items() if each != name)
    ]


def table(results: Mapping[str, Sequence[Mapping[str, float]]]) -> str:
    """Tabulate means over training seeds with 95 % intervals (normal, 1.96 s/√n) as Markdown; one row per variant,
    empty where a number was not measured."""
    names = list(dict.fromkeys(name for rows in results.values() for name in rows[0]))
    lines = ["| variant | seeds | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for variant, rows in results.items():
        cells = [_shown([row[name] for row in rows]) if name in rows[0] else "" for name in names]
        lines.append(f"| {variant} | {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def interval(values: Sequence[float]) -> tuple[float, float]:
    """Return the mean and half the width of its 95 % interval (normal, 1.96 s/√n), 0 for a single value."""
    return mean(values), 1.96 * stdev(values) / math.sqrt(len(values)) if len(values) > 1 else 0.0


def _shown(values: Sequence[float]) -> str:
    middle, half = interval(values)
    return f"{middle:.3f} ± {half:.3f}" if len(values) > 1 else f"{middle:.3f}"
