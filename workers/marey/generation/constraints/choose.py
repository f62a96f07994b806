"""Choose among fitted candidates of a motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from marey.generation.constraints.constraint_set import ConstraintSet
from marey.generation.constraints.fit import fit_clip
from marey.generation.constraints.measure import constraint_errors
from marey.generation.export import judged
from marey.generation.port import Request
from marey.motion.clip import QUALITY, MotionClip
from marey.motion.edits.place import at_origin
from marey.motion.feet import find_contacts, skate
from marey.quality.record import OF_PROMPT, SHOWN, Flag, MotionQuality, PromptMatch, read_quality
from marey.quality.selection import Candidate

SLIDING, TOES, JERKING = 2.0, 6.0, 0.8
"""Weights beside `misfit`: of the share of sliding frames, of the speed of standing toes in m/s, and of the logarithm
of how much jerk the fit added."""


@dataclass(frozen=True)
class Fitted:
    """A candidate that was fitted to constraints.

    Attributes:
        rank: the higher the better: constraints met, the prompt shown, no other flags, little sliding and change.
        seed: of the candidate.
    """

    clip: MotionClip = field(repr=False)
    rank: tuple[bool, bool, bool, float]
    seed: int


def fit_candidate(clip: MotionClip, request: Request, asked: ConstraintSet, misfit: float) -> Fitted:
    """Fit a finished candidate, and put it to the origin, with its errors in the quality record."""
    made = fit_clip(clip, asked)
    errors = constraint_errors(made, asked)
    made = judged(at_origin(made), request)
    quality = read_quality(made.manifest)
    if quality is None:  # a skeleton that is not measured
        return Fitted(made, (not any(error.missed for error in errors), True, True, -misfit), request.seed)
    if asked.paths and _value(quality) < _value(drawn := read_quality(clip.manifest)) and drawn is not None:
        quality = quality.with_match(drawn.match or PromptMatch())  # a walk along a circle is a walk
    sound = set(quality.flags) <= OF_PROMPT
    quality = quality.with_constraints(errors)
    met = Flag.CONSTRAINT_MISSED not in quality.flags
    match = None if quality.match is None else quality.match.value
    cost = misfit + SLIDING * quality.skate + TOES * _toes(made)
    cost += JERKING * float(np.log(_jerk(made) / _jerk(clip)))
    rank = (met, match is None or match >= SHOWN, sound, -cost)
    return Fitted(
        replace(made, manifest={**made.manifest, QUALITY: quality.model_dump(mode="json")}), rank, request.seed
    )


def candidate_of(index: int, fitted: Fitted) -> Candidate:
    """Return the record of a candidate."""
    quality = read_quality(fitted.clip.manifest)
    flags = [] if quality is None else quality.flags
    match = None if quality is None or quality.match is None else quality.match.value
    return Candidate(index=index, seed=fitted.seed, flags=flags, ok=not flags, match=match)


def _jerk(clip: MotionClip) -> float:
    """Return the mean jerk of joints, m/s³, 1 or more."""
    third = np.diff(clip.joints.astype(np.float64), 3, axis=0) * clip.fps**3
    return 1.0 + float(np.linalg.norm(third, axis=-1).mean()) if len(third) else 1.0


def _toes(clip: MotionClip) -> float:
    """Return the mean speed of standing toes, m/s."""
    joints = clip.joints.astype(np.float64)
    return skate(joints, find_contacts(joints, clip.skeleton, clip.fps), clip.skeleton, clip.fps)


def _value(quality: MotionQuality | None) -> float:
    match = None if quality is None else quality.match
    return 0.0 if match is None or match.value is None else match.value
