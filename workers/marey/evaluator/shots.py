"""Rows of timelines and errors of constraints of a motion."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from marey.evaluator.constraints.measuring import judged_actions
from marey.items.timeline import TimelineRow
from marey.motion.clip import MotionClip
from marey.quality.constraints import ConstraintError
from marey.quality.record import SHOWN, read_quality
from marey.referee import Body, shows_in_order


@dataclass(frozen=True)
class RowReading:
    """A row of a timeline.

    Attributes:
        shown: the referee sees the actions of its prompt; None where they have no rules.
        match: as its manifest says; None where an action has no check.
    """

    row: TimelineRow
    shown: bool | None
    match: float | None

    @property
    def fails(self) -> bool:
        """Return True if the row does not show its prompt, by the referee or by the match."""
        return self.shown is False or (self.match is not None and self.match < SHOWN)


def rows_of(clip: MotionClip) -> tuple[RowReading, ...]:
    """Judge each row of a timeline, from the place where it begins; none if the clip is no timeline."""
    timeline = cast("Mapping[str, Any]", clip.manifest.get("timeline") or {})
    return tuple(_reading(clip, row) for row in timeline.get("rows", ()))


def rows_shown(rows: Iterable[RowReading]) -> float | None:
    """Return the share of the rows of a timeline that the referee judges and that show their prompts; None without
    any."""
    judged = [row.shown for row in rows if row.shown is not None]
    return round(sum(judged) / len(judged), 4) if judged else None


def constraints_of(clip: MotionClip) -> tuple[ConstraintError, ...] | None:
    """Return the errors of a clip's constraints; None if its quality record has none."""
    record = read_quality(clip.manifest)
    return None if record is None or record.constraints is None else tuple(record.constraints)


def _reading(clip: MotionClip, row: Mapping[str, Any]) -> RowReading:
    known = TimelineRow(float(row["start"]), float(row["end"]), str(row["prompt"]))
    part = clip.joints[round(known.start * clip.fps) : round(known.end * clip.fps)].astype(np.float64)
    actions = judged_actions(known.prompt)
    # A trimmed timeline keeps its rows, also those beyond its end.
    shown = (
        shows_in_order(actions, Body(part - part[0, 0] * [1, 0, 1], clip.fps)) if actions and len(part) > 1 else None
    )
    return RowReading(known, shown, row.get("match"))
