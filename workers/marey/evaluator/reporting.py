"""Build the `Report` of a measured evaluation."""

from __future__ import annotations

import shlex
import statistics
from collections import defaultdict
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from marey.evaluations import TEST_SPLIT, EarlierRun
from marey.evaluator.comparing import Earlier, alarms, changes
from marey.evaluator.heat import heat_of, style_of
from marey.evaluator.measuring import EvaluatedMotion, EvaluatedMotions
from marey.evaluator.port import Evaluator, ProgressCallback, no_progress
from marey.evaluator.reconstruction import Reconstruction
from marey.evaluator.reference import RealClips
from marey.evaluator.report import (
    ArtifactReference,
    Baseline,
    Exhibit,
    GenerationSpeed,
    HeatCell,
    Metric,
    MetricRow,
    MotionScore,
    Repeats,
    Report,
    TrendPoint,
    from_json,
)
from marey.evaluator.report.model import MOST_EXHIBITS, Against
from marey.evaluator.rows import Ruler, embedded_sets, generated_rows, reconstruction_row, truth_row
from marey.evaluator.scoring import REPEATS, EmbeddedSet, metrics_of, retrieved
from marey.evaluator.shot_sections import constraint_section, timeline_section
from marey.evaluator.shots import rows_shown
from marey.measures.comparing import OBEYED, RETRIEVED
from marey.motion.clip import parse_npz
from marey.runtime.scoring import ScoreInput

ANY = "any"
TRENDS = (OBEYED, RETRIEVED, "fid", "kid", "skate", "jerk")


def report_of(
    source: ScoreInput,
    measured: EvaluatedMotions,
    evaluator: Evaluator,
    real: RealClips,
    reconstruction: Reconstruction | None = None,
    *,
    progress: ProgressCallback = no_progress,
) -> Report:
    """Build the report of an evaluation.

    Args:
        source: the request, and the runs to compare with.
        measured: its motions.
        evaluator: the evaluator that embedded them.
        real: real clips of the evaluator's bundle. The ground truth is the clips of the prompts; for custom prompts,
            the split `test`.
        reconstruction: measurements of the generator's tokenizer.
        progress: called during measurement, which takes minutes for many motions.

    Raises:
        InvalidInput: a run to compare with has other prompts.
        NotFound: the reference lacks a split.
        Unreachable: the store does not answer.
    """
    seed = source.request.seed
    ruler = Ruler(evaluator, real, source.request.splits or (TEST_SPLIT,), seed, progress)
    metrics = metrics_of(evaluator, ruler.splits)
    sets = embedded_sets(measured, _labels(source, measured, real), progress)
    raw, exported = generated_rows(measured, sets, ruler)
    scores = _scores(measured, sets[1], evaluator, seed)
    earlier = _earlier(source)
    found = tuple(change for run in earlier for change in changes(run, scores, seed=seed))
    why = alarms(found, {metric.key: metric for metric in metrics})
    now = datetime.now(UTC)
    best, worst = _exhibits(source, measured, scores)
    return Report(
        title=f"Evaluation {source.name or str(source.evaluation)[-8:]}",
        evaluation=str(source.evaluation),
        created=now,
        generator=bundle_of(source.request.bundle),
        licence=next((motion.item.licence or "" for motion in measured.motions), ""),
        evaluator=bundle_of(evaluator.name),
        source=ArtifactReference(source.request.source, source.prompts),
        prompts=len({item.index for item in source.items}),
        motions=len(measured.motions),
        failed=len(source.items) - len(measured.motions),
        repeats=Repeats(REPEATS, min(source.request.repeats, REPEATS)),
        metrics=metrics,
        rows=(truth_row(ruler), _reconstruction(reconstruction, ruler, metrics), raw, exported),
        baselines=tuple(run.baseline for run in earlier),
        changes=found,
        regressed=bool(why) if earlier else None,
        alarms=why,
        trend=_trend(source, exported, now),
        heat=_heat(source, measured, real),
        timelines=timeline_section(measured.motions),
        constraints=constraint_section(measured.motions),
        ranked_by="prompt adherence, then R-precision",
        best=best,
        worst=worst,
        speed=_speed(source, measured),
        command=_command(source),
        settings=dict(source.request.settings) | {"seed": seed, "repeats": source.request.repeats},
        software=_software(measured, source),
        notes=_notes(source, measured),
        scores=scores,
    )


def summary_of(report: Report) -> dict[str, float | None]:
    """Return the judged row by metric, for lists and trends."""
    values = report.row(report.judged).values
    return {key: value.mean for key, value in values.items()}


def _labels(source: ScoreInput, measured: EvaluatedMotions, real: RealClips) -> NDArray[np.int64]:
    """Return the label (N,) of each motion's prompt: the real clip's, or for custom prompts the prompt itself."""
    if source.request.splits:
        return real.joined(source.request.splits).labels[measured.indices]
    numbers: dict[str, int] = {}
    return np.array([numbers.setdefault(m.item.prompt, len(numbers)) for m in measured.motions], np.int64)


def _scores(
    measured: EvaluatedMotions, embeddings: EmbeddedSet, evaluator: Evaluator, seed: int
) -> tuple[MotionScore, ...]:
    """Return the scores of each motion, for the pairs of later runs."""
    found = retrieved(embeddings, evaluator, seed)
    return tuple(
        MotionScore(
            motion.item.index,
            motion.item.variant,
            None if motion.exported.obeyed is None else float(motion.exported.obeyed),
            None if np.isnan(share) else round(float(share), 4),
            rows_shown(motion.rows),
        )
        for motion, share in zip(measured.motions, found, strict=True)
    )


def _reconstruction(found: Reconstruction | None, ruler: Ruler, metrics: Sequence[Metric]) -> MetricRow:
    source = "+".join(ruler.splits)
    if found is None or source not in found.values:
        return reconstruction_row(None, "real motion through the tokenizer")
    known = {metric.key for metric in metrics}  # the measuring version may be another
    values = {key: value for key, value in found.values[source].items() if key in known}
    return reconstruction_row(values, found.note(source))


def _earlier(source: ScoreInput) -> tuple[Earlier, ...]:
    """Return the last run and the pinned one, if their reports still exist."""
    runs: list[tuple[Against, EarlierRun | None]] = [
        ("last run", source.previous),
        ("pinned baseline", source.baseline),
    ]
    found: list[Earlier] = []
    for against, run in runs:
        if run is not None and run.report is not None:
            scores = from_json(source.read(run.report.sha256)).scores
            found.append(Earlier(Baseline(against, str(run.id), run.request.bundle, run.finished), scores))
    return tuple(found)


def _trend(source: ScoreInput, row: MetricRow, now: datetime) -> tuple[TrendPoint, ...]:
    here = {key: value.mean for key, value in row.values.items() if value.mean is not None}
    points = [(run.finished, str(run.id), run.request.bundle, run.summary) for run in source.history]
    points.append((now, str(source.evaluation), source.request.bundle, here))
    return tuple(
        TrendPoint(finished, run, bundle, {k: v for k, v in values.items() if k in TRENDS and v is not None})
        for finished, run, bundle, values in points
    )


def _heat(source: ScoreInput, measured: EvaluatedMotions, real: RealClips) -> tuple[HeatCell, ...]:
    """Return the heat map; by style only if the prompts are captions of clips with known style."""
    splits = source.request.splits
    styles = [style_of(clip.label) for clip in real.joined(splits).clips] if splits else []
    return heat_of(
        (motion.item.expected, styles[motion.item.index] if splits else ANY, motion.exported.obeyed)
        for motion in measured.motions
    )


def _exhibits(
    source: ScoreInput, measured: EvaluatedMotions, scores: Sequence[MotionScore]
) -> tuple[tuple[Exhibit, ...], tuple[Exhibit, ...]]:
    """Return the best and the worst motions of one prompt; a prompt is shown once."""
    order = sorted(np.flatnonzero(measured.single).tolist(), key=lambda row: _rank(scores[row]))
    worst = _distinct(order, measured)[:MOST_EXHIBITS]
    shown = {measured.motions[row].item.index for row in worst}
    rest = [row for row in order[::-1] if measured.motions[row].item.index not in shown]
    best = _distinct(rest, measured)[:MOST_EXHIBITS]
    one, two = (
        tuple(_exhibit(source, measured.motions[row], _rank(scores[row])) for row in rows) for rows in (best, worst)
    )
    return one, two


def _rank(score: MotionScore) -> float:
    """Return the sort key of exhibits: adherence first; without an expectation, retrieval alone."""
    return (0.0 if score.obeyed is None else score.obeyed) + 0.5 * (score.retrieved or 0.0)


def _distinct(order: Sequence[int], measured: EvaluatedMotions) -> list[int]:
    first: dict[int, int] = {}
    for row in order:
        first.setdefault(measured.motions[row].item.index, row)
    return list(first.values())


def _exhibit(source: ScoreInput, motion: EvaluatedMotion, score: float) -> Exhibit:
    verdict = motion.exported.verdict
    return Exhibit(
        prompt=motion.item.prompt,
        seed=motion.item.seed,
        passed=verdict is None or verdict.passed,
        reason="no expectation" if verdict is None else verdict.reason,
        score=round(score, 3),
        clip=parse_npz(source.npz(motion.item)),
    )


def _speed(source: ScoreInput, measured: EvaluatedMotions) -> GenerationSpeed | None:
    """Return the speed of the whole job, waiting included, as users experience it."""
    job = source.generation
    elapsed = [motion.item.elapsed for motion in measured.motions if motion.item.elapsed is not None]
    if job.started is None or job.finished is None or not elapsed:
        return None
    seconds = (job.finished - job.started).total_seconds()
    note = "at background priority, from the first claim to the last commit"
    return GenerationSpeed(len(measured.motions) / max(seconds, 1e-3), statistics.median(elapsed), note)


def bundle_of(reference: str) -> ArtifactReference:
    """Return the report's reference to an exact bundle."""
    name, _, sha256 = reference.partition("@")
    return ArtifactReference(name, sha256)


def _command(source: ScoreInput) -> str:
    """Return the command that repeats the evaluation; file names are quoted."""
    request = source.request
    words = ["marey", "eval", "run", "--bundle", request.bundle, "--evaluator", str(request.evaluator)]
    words += ["--split", request.source, "--repeats", str(request.repeats), "--seed", str(request.seed)]
    for name, value in sorted(request.settings.items()):
        short = f"{value:g}"
        words += ["--set", f"{name}={short if float(short) == value else repr(value)}"]
    return shlex.join(words)


def _software(measured: EvaluatedMotions, source: ScoreInput) -> Mapping[str, str]:
    """Return software versions of the generating workers, from their motions; several versions are noted."""
    found: dict[str, set[str]] = defaultdict(set)
    for motion in measured.motions[:: max(1, len(measured.motions) // 8)]:
        manifest = parse_npz(source.npz(motion.item)).manifest
        for name, version in manifest.get("software", {}).items():
            found[name].add(str(version))
    return {name: ", ".join(sorted(versions)) for name, versions in sorted(found.items())}


def _notes(source: ScoreInput, measured: EvaluatedMotions) -> tuple[str, ...]:
    notes = [f"Not measured: prompt {b.item.index}, repeat {b.item.variant}: {b.reason}" for b in measured.broken[:20]]
    if kinematic := sum(motion.kinematic for motion in measured.motions):
        notes.append(
            f"{kinematic} motions were changed after the network (constraints, edits) and have no features of it: the "
            "row Generated is measured on their files."
        )
    unmade = [item for item in source.items if item.npz is None]
    for item in unmade[:20]:
        why = item.problem.message if item.problem else str(item.state)
        notes.append(f"Not generated: prompt {item.index}, repeat {item.variant}: {why}")
    return tuple(notes)
