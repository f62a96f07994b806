"""Sections of a report about timelines and constraints: their numbers, and both as tables of text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from marey.evaluator.report.parts import finite

WORST = 6
"""Rows and constraints that a section names."""
KINDS = {"root_path": "path of the root", "pose_keyframe": "pose", "effector_target": "effector"}
BARS = {"root_path": "10 cm mean, 25 cm, 15°", "pose_keyframe": "5 cm", "effector_target": "3 cm, 15°"}


@dataclass(frozen=True)
class WorstRow:
    """A row of a timeline that does not show its prompt; `match` is None where an action has no check."""

    prompt: str
    times: str
    index: int
    seed: int
    match: float | None


@dataclass(frozen=True)
class TimelineSection:
    """Rows of timelines, each judged alone by its prompt.

    Attributes:
        motions: timelines.
        rows: of all of them.
        judged: rows whose actions the referee has rules for.
        shown: those in which it sees them.
        matched: rows with a match in their manifest.
        off_prompt: those whose match is too low.
        flagged: timelines whose quality record has a flag.
        worst: rows that fail by the referee or by their match, the lowest match first.
    """

    motions: int
    rows: int
    judged: int
    shown: int
    matched: int
    off_prompt: int
    flagged: int
    worst: tuple[WorstRow, ...] = ()


@dataclass(frozen=True)
class ConstraintKind:
    """Errors of all constraints of one type; metres and degrees, as in quality records."""

    type: str
    count: int
    missed: int
    mean_m: float
    max_m: float
    mean_deg: float | None

    def __post_init__(self) -> None:
        finite(f"errors of {self.type}", self.mean_m, self.max_m, self.mean_deg)


@dataclass(frozen=True)
class WorstConstraint:
    """A constraint that was missed; `place` is its index in the prompt's constraints."""

    prompt: str
    index: int
    seed: int
    place: int
    type: str
    max_m: float
    mean_deg: float | None


@dataclass(frozen=True)
class ConstraintSection:
    """Errors of constraints.

    Attributes:
        motions: motions with constraints.
        missed: those that miss one.
        unknown: motions with constraints whose quality record has no errors of them; they count in no number.
    """

    motions: int
    missed: int
    kinds: tuple[ConstraintKind, ...]
    unknown: int = 0
    worst: tuple[WorstConstraint, ...] = ()


@dataclass(frozen=True)
class TextTable:
    """A table of text; the first `left` columns are aligned to the left."""

    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    left: int = 1


@dataclass(frozen=True)
class ShotSection:
    """A section for readers."""

    id: str
    title: str
    sentence: str
    tables: Sequence[TextTable]


def shots_of(timelines: TimelineSection | None, constraints: ConstraintSection | None) -> list[ShotSection]:
    """Return the sections of what a report has."""
    found = [] if timelines is None else [_timelines(timelines)]
    return found if constraints is None else [*found, _constraints(constraints)]


def _timelines(section: TimelineSection) -> ShotSection:
    numbers = [
        ["timelines", str(section.motions)],
        ["rows", str(section.rows)],
        ["rows that show their prompt, by the referee", _share(section.shown, section.judged)],
        ["rows off their prompt, by their match", _share(section.off_prompt, section.matched)],
        ["timelines with a flag", _share(section.flagged, section.motions)],
    ]
    worst = [
        [f"“{w.prompt}”", f"{w.index}: {w.times} s", "–" if w.match is None else f"{w.match:.2f}", str(w.seed)]
        for w in section.worst
    ]
    return ShotSection(
        "timelines",
        "Timelines",
        "Each row is cut out and judged by its own prompt. Evaluators read one prompt and one short motion, so the "
        f"timelines, {section.motions}, are left out of the measures of embeddings (R-precision, CLIP score, FID and "
        "the like). Those on joints include them.",
        _tables(
            TextTable(["measure", "value"], numbers),
            TextTable(["row that fails", "prompt: times", "match", "seed"], worst, 2),
        ),
    )


def _constraints(section: ConstraintSection) -> ShotSection:
    kinds = [
        [
            KINDS.get(kind.type, kind.type), BARS.get(kind.type, ""), str(kind.count), str(kind.missed),
            _cm(kind.mean_m), _cm(kind.max_m), _degrees(kind.mean_deg),
        ]
        for kind in section.kinds
    ]  # fmt: skip
    worst = [
        [
            f"“{each.prompt}”", f"{KINDS.get(each.type, each.type)} ({each.index}: {each.place})",
            _cm(each.max_m), _degrees(each.mean_deg), str(each.seed),
        ]
        for each in section.worst
    ]  # fmt: skip
    unknown = f" {section.unknown} more have no record of errors." if section.unknown else ""
    return ShotSection(
        "constraints",
        "Constraints",
        f"{section.missed} of {section.motions} motions miss a constraint by more than its bar.{unknown}",
        _tables(
            TextTable(["type", "bar", "constraints", "missed", "mean error", "largest", "mean angle"], kinds, 2),
            TextTable(["missed", "constraint (prompt: place)", "largest", "mean angle", "seed"], worst, 2),
        ),
    )


def _tables(*tables: TextTable) -> list[TextTable]:
    return [table for table in tables if table.rows]


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({100 * part / whole:.1f} %)" if whole else "none was judged"


def _cm(metres: float) -> str:
    return f"{100 * metres:.1f} cm"


def _degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}°"
