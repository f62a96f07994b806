"""Shared code of ablations: judge a variant, and tabulate variants and seeds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import mean, stdev

from marey.checks.prompts import evaluation_prompts
from marey.checks.rates import mean_quality
from marey.generation.port import Generator, S
from marey.text.features import TextFeatures
from marey.training.adherence import measure


def judge(generator: Generator[S], texts: Sequence[TextFeatures], settings: S) -> dict[str, float]:
    """Measure prompt adherence, foot skate and jerk of one bundle."""
    report = measure(generator, texts, evaluation_prompts(), seeds=[0], settings=settings)
    physical = mean_quality(t.quality for t in report.trials)
    rates = {name: rate.share for name, rate in report.summary.items()}
    return rates | {"foot skate": physical.skate, "jerk": physical.jerk}


def table(results: Mapping[str, Sequence[Mapping[str, float]]]) -> str:
    """Tabulate means over training seeds with 95 % intervals (normal, 1.96 s/√n) as Markdown; one row per variant,
    empty where a number was not measured."""
    names = list(dict.fromkeys(name for rows in results.values() for name in rows[0]))
    lines = ["| variant | seeds | " + " | ".join(names) + " |", "|---" * (len(names) + 2) + "|"]
    for variant, rows in results.items():
        cells = [_interval([row[name] for row in rows]) if name in rows[0] else "" for name in names]
        lines.append(f"| {variant} | {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _interval(values: Sequence[float]) -> str:
    half = f" ± {1.96 * stdev(values) / math.sqrt(len(values)):.3f}" if len(values) > 1 else ""
    return f"{mean(values):.3f}{half}"
