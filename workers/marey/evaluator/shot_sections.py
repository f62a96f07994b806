"""Sections of a report about timelines and constraints, from measured motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from marey.evaluator.measuring import EvaluatedMotion
from marey.evaluator.report.shots import (
    WORST,
    ConstraintKind,
    ConstraintSection,
    TimelineSection,
    WorstConstraint,
    WorstRow,
)
from marey.quality.constraints import ConstraintError
from marey.quality.record import SHOWN


def timeline_section(motions: Iterable[EvaluatedMotion]) -> TimelineSection | None:
    """Return the section about timelines; None without any."""
    made = [motion for motion in motions if motion.rows]
    if not made:
        return None
    every = [(motion, row) for motion in made for row in motion.rows]
    rows = [row for _, row in every]
    matched = [row.match for row in rows if row.match is not None]
    failing = [(motion, row) for motion, row in every if row.fails]
    worst = sorted(failing, key=lambda each: 1.0 if each[1].match is None else each[1].match)[:WORST]
    return TimelineSection(
        motions=len(made),
        rows=len(rows),
        judged=sum(row.shown is not None for row in rows),
        shown=sum(row.shown is True for row in rows),
        matched=len(matched),
        off_prompt=sum(match < SHOWN for match in matched),
        flagged=sum(bool(motion.flags) for motion in made),
        worst=tuple(
            WorstRow(row.row.prompt, row.row.times, motion.item.index, motion.item.seed, row.match)
            for motion, row in worst
        ),
    )


def constraint_section(motions: Iterable[EvaluatedMotion]) -> ConstraintSection | None:
    """Return the section about constraints; None without any."""
    asked = [motion for motion in motions if motion.item.constrained or motion.constraints is not None]
    if not asked:
        return None
    every = [(motion, error) for motion in asked for error in motion.constraints or ()]
    kinds = dict.fromkeys(error.type for _, error in every)
    missed = [(motion, error) for motion, error in every if error.missed]
    worst = sorted(missed, key=lambda each: -each[1].max_m)[:WORST]
    known = [motion for motion in asked if motion.constraints is not None]
    return ConstraintSection(
        motions=len(known),
        missed=sum(any(error.missed for error in motion.constraints or ()) for motion in known),
        kinds=tuple(_kind(kind, [error for _, error in every if error.type == kind]) for kind in kinds),
        unknown=len(asked) - len(known),
        worst=tuple(
            WorstConstraint(
                motion.item.prompt, motion.item.index, motion.item.seed, error.index, error.type, error.max_m,
                error.mean_deg,
            )
            for motion, error in worst
        ),
    )  # fmt: skip


def _kind(kind: str, errors: Sequence[ConstraintError]) -> ConstraintKind:
    degrees = [error.mean_deg for error in errors if error.mean_deg is not None]
    return ConstraintKind(
        kind,
        len(errors),
        sum(error.missed for error in errors),
        float(np.mean([error.mean_m for error in errors])),
        max(error.max_m for error in errors),
        float(np.mean(degrees)) if degrees else None,
    )
