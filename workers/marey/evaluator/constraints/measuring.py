"""Measures of constrained motions, beside motions of the same prompts and seeds without constraints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from marey.evaluator.constraints.cases import Case
from marey.motion.clip import MotionClip
from marey.motion.courses import carried, natural_course
from marey.motion.feet import find_contacts, skate
from marey.motion.rotations import Array
from marey.quality.record import read_quality
from marey.referee import Body
from marey.referee.rules import RULES
from marey.referee.sequences import shows_in_order
from marey.vocabulary.scope import every_action, match_scope

MOST_SKATE, MOST_JERK, MOST_LOST = 1.2, 1.25, 5.0
"""Bars: skate and jerk beside those without constraints, and points of adherence that are lost."""


@dataclass(frozen=True)
class ConstraintReading:
    """Measures of one case; those with `free_` are of the motion without constraints.

    Attributes:
        errors: as in the quality record.
        skate: mean speed of standing toes, m/s. sliding: `skate` of the quality record, share of frames.
        jerk: mean over joints and frames, m/s³.
        shown: the referee sees the actions of the prompt; None where it names none that has a rule.
    """

    name: str
    group: str
    errors: list[dict[str, Any]]
    flags: list[str]
    skate: float
    free_skate: float
    sliding: float
    free_sliding: float
    jerk: float
    free_jerk: float
    shown: bool | None
    free_shown: bool | None

    def of(self, kind: str) -> list[dict[str, Any]]:
        """Return the errors of a type of constraints."""
        return [error for error in self.errors if error["type"] == kind]


def read_case(case: Case, clip: MotionClip, free: MotionClip) -> ConstraintReading:
    """Measure the motion of a case and the one without constraints."""
    quality, plain = read_quality(clip.manifest), read_quality(free.manifest)
    assert quality is not None
    assert plain is not None
    actions = judged_actions(case.prompt)
    return ConstraintReading(
        case.name,
        case.group,
        [error.model_dump(mode="json") for error in quality.constraints or []],
        [str(flag) for flag in quality.flags],
        _skate(clip),
        _skate(free),
        quality.skate,
        plain.skate,
        jerk(clip),
        jerk(free),
        shows(actions, clip) if actions else None,
        shows(actions, free) if actions else None,
    )


def shows(actions: Sequence[str], clip: MotionClip) -> bool:
    """Return True if the referee sees the actions, in the motion or in the same motion along a straight line: a walk
    along a circle is a walk."""
    joints = clip.joints.astype(np.float64)
    return any(shows_in_order(actions, Body(each, clip.fps)) for each in (joints, straightened(clip)))


def straightened(clip: MotionClip) -> Array:
    """Return joints (T, J, 3) of a motion, carried frame by frame from its own course to a straight one."""
    course = natural_course(clip.joints.astype(np.float64), clip.skeleton, clip.fps)
    return carried(clip.joints.astype(np.float64), course, course.straight(), np.arange(clip.frames, dtype=np.float64))


def jerk(clip: MotionClip) -> float:
    """Return the mean length of the third derivative of joints, m/s³."""
    return float(np.linalg.norm(np.diff(clip.joints.astype(np.float64), 3, axis=0), axis=-1).mean() * clip.fps**3)


def _skate(clip: MotionClip) -> float:
    joints = clip.joints.astype(np.float64)
    return skate(joints, find_contacts(joints, clip.skeleton, clip.fps), clip.skeleton, clip.fps)


def judged_actions(prompt: str) -> list[str]:
    """Return the actions that a prompt names; none if one of them has no rule of the referee."""
    named = [action.action for action in match_scope(prompt, every_action()).actions]
    known = [name for name in named if name is not None and name in RULES]
    return known if len(known) == len(named) else []


def summary(readings: Sequence[ConstraintReading]) -> dict[str, Any]:
    """Return the figures that the bars are for."""

    def errors(kind: str, field: str) -> list[float]:
        return [error[field] for reading in readings for error in reading.of(kind) if error[field] is not None]

    judged = [reading for reading in readings if reading.shown is not None and reading.free_shown is not None]
    kinds = ("root_path", "pose_keyframe", "effector_target")
    return {
        "cases": len(readings),
        "path_mean_cm": _cm(np.mean, errors("root_path", "mean_m")),
        "path_max_cm": _cm(np.max, errors("root_path", "max_m")),
        "heading_deg": round(float(np.mean(errors("root_path", "mean_deg"))), 2),
        "pose_max_cm": _cm(np.max, errors("pose_keyframe", "max_m")),
        "effector_max_cm": _cm(np.max, errors("effector_target", "max_m")),
        "missed": {kind: sum(error["missed"] for r in readings for error in r.of(kind)) for kind in kinds},
        "skate": _ratio([r.skate for r in readings], [r.free_skate for r in readings]),
        "sliding": _ratio([r.sliding for r in readings], [r.free_sliding for r in readings]),
        "jerk": _ratio([r.jerk for r in readings], [r.free_jerk for r in readings]),
        "jerk_ratio_p95": round(float(np.quantile([r.jerk / max(r.free_jerk, 1e-9) for r in readings], 0.95)), 3),
        "judged": len(judged),
        "shown": _share([bool(r.shown) for r in judged]),
        "free_shown": _share([bool(r.free_shown) for r in judged]),
    }


def _cm(how: Any, values: Sequence[float]) -> float:
    return round(100 * float(how(values)), 2)


def _ratio(values: Sequence[float], free: Sequence[float]) -> dict[str, float]:
    ours, theirs = float(np.mean(values)), float(np.mean(free))
    return {"constrained": round(ours, 4), "free": round(theirs, 4), "ratio": round(ours / max(theirs, 1e-9), 3)}


def _share(values: Sequence[bool]) -> float:
    return round(100 * float(np.mean(values)), 1) if values else 0.0


def constraints_markdown(bundle: str, readings: Sequence[ConstraintReading]) -> str:
    """Return a report with a table, a row for each measure and a column for each group of cases."""
    groups = {"all": list(readings)}
    for reading in readings:
        groups.setdefault(reading.group, []).append(reading)
    found = {name: summary(rows) for name, rows in groups.items()}
    rows: list[tuple[str, str, Any]] = [
        ("cases", "", lambda s: s["cases"]),
        ("path, mean error", "10 cm", lambda s: f"{s['path_mean_cm']:.1f} cm"),
        ("path, largest error", "25 cm", lambda s: f"{s['path_max_cm']:.1f} cm"),
        ("heading, mean error", "15°", lambda s: f"{s['heading_deg']:.1f}°"),
        ("pose, largest error of a joint", "5 cm", lambda s: f"{s['pose_max_cm']:.1f} cm"),
        ("effector, largest error", "3 cm", lambda s: f"{s['effector_max_cm']:.1f} cm"),
        ("constraints missed", "0", lambda s: sum(s["missed"].values())),
        ("skate of standing toes, beside unconstrained", f"{MOST_SKATE:g}", lambda s: s["skate"]["ratio"]),
        ("share of sliding frames, beside unconstrained", f"{MOST_SKATE:g}", lambda s: s["sliding"]["ratio"]),
        ("jerk, beside unconstrained", f"{MOST_JERK:g}", lambda s: s["jerk"]["ratio"]),
        ("shows the prompt", "", lambda s: f"{s['shown']:.0f} %"),
        ("shows the prompt, unconstrained", f"-{MOST_LOST:g} points", lambda s: f"{s['free_shown']:.0f} %"),
    ]
    head = " | ".join(groups)
    lines = [f"Bundle `{bundle}`, constraints.", "", f"| measure | bar | {head} |", "|---" * (len(groups) + 2) + "|"]
    lines += [f"| {name} | {bar} | " + " | ".join(str(of(found[g])) for g in groups) + " |" for name, bar, of in rows]
    return "\n".join(lines) + "\n"


def constraints_document(
    bundle: str, settings: dict[str, object], readings: Sequence[ConstraintReading]
) -> dict[str, Any]:
    """Return all data as JSON values, each case included."""
    groups = dict.fromkeys(reading.group for reading in readings)
    return {
        "bundle": bundle,
        "settings": settings,
        "summary": {
            "all": summary(readings),
            **{group: summary([r for r in readings if r.group == group]) for group in groups},
        },
        "cases": [asdict(reading) for reading in readings],
    }
