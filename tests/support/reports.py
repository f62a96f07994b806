"""A report as a studio would get it on a Monday: every part of it is there, its numbers are made up."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np

from marey.evaluator.report import (
    ArtifactReference,
    Baseline,
    Change,
    Exhibit,
    GenerationSpeed,
    HeatCell,
    Metric,
    MetricRow,
    MotionScore,
    Repeats,
    Report,
    TrendPoint,
    Value,
    sentence_of,
)
from marey.motion.clip import MotionClip

MONDAY = datetime(2026, 11, 23, 5, 40, tzinfo=UTC)
NETWORK = "evaluator-starter@5f0c2b7d91ae"
METRICS = (
    Metric(
        "r1", "R-precision top 1", "", "higher", 3, "How often the prompt of a motion is the nearest of 32.", NETWORK
    ),
    Metric("r3", "R-precision top 3", "", "higher", 3, "The same, among the three nearest.", NETWORK),
    Metric("match", "Matching distance", "", "lower", 3, "Mean distance of a motion to its prompt.", NETWORK),
    Metric("fid", "FID", "", "lower", 3, "How far generated motions as a set are from captured ones.", NETWORK),
    Metric("kid", "KID", "", "lower", 4, "The same by kernels; fair with few motions.", NETWORK),
    Metric("diversity", "Diversity", "", "", 2, "How different motions are; as in the ground truth is best.", NETWORK),
    Metric(
        "r1c",
        "R-precision top 1",
        "",
        "higher",
        3,
        "On pairs never trained together.",
        NETWORK,
        "the compositional split",
    ),
    Metric("obeyed", "Prompt adherence", "%", "higher", 1, "Motions that do what the prompt says."),
    Metric("skate", "Foot skate", "%", "lower", 1, "Frames in which a toe slides on the floor."),
    Metric("jerk", "Jerk", "m/s³", "lower", 0, "How abrupt the motion is."),
    Metric("floor", "Floor penetration", "mm", "lower", 1, "How deep the feet get under the floor."),
)
UNMEASURED = "this tokenizer cannot encode clips of the compositional split"


def _values(*numbers: tuple[str, float, float | None]) -> dict[str, Value]:
    return {key: Value(mean, half, 337, dimensions=256 if key == "fid" else None) for key, mean, half in numbers}


def _rows() -> tuple[MetricRow, ...]:
    truth = (("r1", 0.571, 0.004), ("r3", 0.842, 0.003), ("match", 0.412, 0.001), ("fid", 0.0021, 0.0004))
    truth += (("kid", 0.0, 0.0002), ("diversity", 1.213, 0.011), ("r1c", 0.488, 0.006), ("obeyed", 97.9, None))
    truth += (("skate", 4.1, None), ("jerk", 131.0, None), ("floor", 3.2, None))
    coded = (("r1", 0.558, 0.005), ("r3", 0.831, 0.004), ("match", 0.420, 0.001), ("fid", 0.0142, 0.0009))
    coded += (("kid", 0.0011, 0.0002), ("diversity", 1.204, 0.012), ("obeyed", 97.1, None))
    coded += (("skate", 4.6, None), ("jerk", 126.0, None), ("floor", 4.0, None))
    raw = (("r1", 0.461, 0.007), ("r3", 0.742, 0.006), ("match", 0.503, 0.002), ("fid", 0.0931, 0.004))
    raw += (("kid", 0.0088, 0.0005), ("diversity", 1.142, 0.014), ("r1c", 0.301, 0.009))
    made = (("r1", 0.453, 0.007), ("r3", 0.736, 0.006), ("match", 0.509, 0.002), ("fid", 0.0964, 0.004))
    made += (("kid", 0.0091, 0.0005), ("diversity", 1.139, 0.013), ("r1c", 0.294, 0.01), ("obeyed", 88.1, 0.9))
    made += (("skate", 5.7, 0.2), ("jerk", 127.0, 1.2), ("floor", 3.9, 0.1))
    return (
        MetricRow("ground_truth", "ground truth", "captured clips", _values(*truth)),
        MetricRow(
            "reconstruction",
            "reconstruction",
            "through the tokenizer",
            {**_values(*coded), "r1c": Value.missing(UNMEASURED)},
        ),
        MetricRow(
            "ceiling",
            "label-level ceiling",
            "a perfect model of labels",
            _values(("r1", 0.8, None), ("r1c", 0.79, None)),
        ),
        MetricRow("raw", "raw", "features of the network", _values(*raw)),
        MetricRow("exported", "exported", "joints after clean-up", _values(*made)),
    )


def _changes() -> tuple[Change, ...]:
    return (
        Change("r1", "last run", 0.449, 0.453, -0.009, 0.017, "no difference found"),
        Change("r3", "last run", 0.741, 0.736, -0.017, 0.007, "no difference found"),
        Change("r1c", "last run", 0.262, 0.294, 0.011, 0.054, "better"),
        Change("obeyed", "last run", 94.4, 88.1, -9.8, -2.9, "worse"),
        Change("skate", "last run", 6.4, 5.7, -1.1, -0.3, "better"),
        Change("jerk", "last run", 126.0, 127.0, -2.0, 4.0, "no difference found"),
        Change("r1", "pinned baseline", 0.422, 0.453, 0.013, 0.049, "better"),
        Change("obeyed", "pinned baseline", 92.9, 88.1, -8.1, -1.6, "worse"),
    )


def _trend(count: int) -> tuple[TrendPoint, ...]:
    rng = np.random.default_rng(4)
    points: list[TrendPoint] = []
    for week in range(count):
        late = week >= count - 1
        values = {
            "r1": 0.36 + 0.1 * week / count + 0.012 * float(rng.standard_normal()),
            "kid": 0.02 - 0.011 * week / count + 0.0006 * float(rng.standard_normal()),
            "obeyed": 88.1 if late else 86 + 8 * week / count + float(rng.standard_normal()),
            "skate": 9 - 3 * week / count + 0.3 * float(rng.standard_normal()),
        }
        if week == 5:
            del values["kid"]
        bundle = "hgm3-starter@1c0de4b1a9f3" if week < count // 2 else "hgm3-starter@96a91328572d"
        points.append(TrendPoint(MONDAY - timedelta(weeks=count - 1 - week), f"{week + 1}", bundle, values))
    return tuple(points)


def _heat() -> tuple[HeatCell, ...]:
    passed = {
        "walk": (36, 35, 34, 33, 36, 35),
        "run": (36, 34, None, 31, 35, 36),
        "turn left": (35, 33, 28, 30, 34, 35),
        "turn right": (36, 34, 30, 29, 36, 33),
        "wave": (33, 30, 25, 22, 31, 32),
        "bow": (34, 27, 24, 21, 30, 33),
        "kick": (22, 17, None, 5, 13, 20),
        "punch": (25, 16, 11, 3, 12, 21),
    }
    styles = ("normal", "active", "elderly", "exhausted", "feminine", "masculine")
    return tuple(
        HeatCell(act, style, 36, count)
        for act, counts in passed.items()
        for style, count in zip(styles, counts, strict=True)
        if count is not None
    )


def exhibits(clips: Sequence[MotionClip], *, passed: bool) -> tuple[Exhibit, ...]:
    """A clip each, the best (or worst) first."""
    return tuple(
        Exhibit(
            prompt=str(clip.manifest["prompt"]),
            seed=int(clip.manifest["seed"]),
            passed=passed,
            reason="" if passed else "no foot rises over the knee in front of the body",
            score=(0.83 - 0.02 * k) if passed else (-0.04 + 0.03 * k),
            clip=clip,
        )
        for k, clip in enumerate(clips)
    )


def sample_report(
    worst: Sequence[MotionClip] = (), best: Sequence[MotionClip] = (), *, runs: int = 22, **changed: Any
) -> Report:
    """The whole report; `changed` are fields of it."""
    fell = next(c for c in _changes() if c.metric == "obeyed")
    report = Report(
        title="hgm3-starter on the evaluation prompts",
        evaluation="22",
        created=MONDAY,
        generator=ArtifactReference(
            "hgm3-starter@96a91328572d", "96a91328572de3541eb2499337627ffc969eb1b6d1157f84dbb1ccaf4bfe006f"
        ),
        licence="CC-BY-NC-4.0",
        evaluator=ArtifactReference(NETWORK, "5f0c2b7d91ae" + 52 * "a"),
        source=ArtifactReference("test split", "0b" * 32),
        prompts=200,
        motions=1674,
        failed=3,
        repeats=Repeats(20, 3),
        metrics=METRICS,
        rows=_rows(),
        baselines=(
            Baseline("last run", "21", "hgm3-starter@96a91328572d", MONDAY - timedelta(weeks=1)),
            Baseline("pinned baseline", "12", "hgm3-starter@1c0de4b1a9f3", MONDAY - timedelta(weeks=10)),
        ),
        changes=_changes(),
        regressed=True,
        alarms=(
            sentence_of(fell, METRICS[7]),
            sentence_of(_changes()[-1], METRICS[7]),
        ),
        trend=_trend(runs),
        heat=_heat(),
        ranked_by=f"cosine of prompt and motion by {NETWORK}",
        best=exhibits(best, passed=True),
        worst=exhibits(worst, passed=False),
        speed=GenerationSpeed(1.42, 9.83, "1 worker, 2 threads of a CPU, bfloat16, batches of 32"),
        command="marey eval run hgm3-starter --split test --repeats 20 --regenerate 3 --seed 1",
        settings={"steps": 10, "guidance": 4.0, "temperature": 0.5, "top_k": 0.1, "seeds": [1, 2, 3], "feet": True},
        software={"marey": "0.1.0", "torch": "2.13.0+cpu", "numpy": "2.4.1"},
        notes=("The clean-up of the feet changed since the pinned baseline.",),
        scores=tuple(MotionScore(k // 3, k % 3, float(k % 7 > 0), None if k % 5 == 0 else 0.25) for k in range(12)),
    )
    return dataclasses.replace(report, **changed)
