"""Results of `client.motions`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from marey.client.results import Result
from marey.client.types.common import File


@dataclass(frozen=True, kw_only=True)
class Review(Result):
    """The verdict on a motion."""

    verdict: str = ""
    at: datetime | None = None
    by: str = ""
    """Name of an API key."""
    comment: str | None = None


@dataclass(frozen=True, kw_only=True)
class PromptMatch(Result):
    """How well a motion shows the actions of its prompt."""

    value: float | None = None
    """0 to 1; from 0.5 on it shows them in their order. None where the prompt names no action."""
    by: str = ""
    """`check`: by rules on the joints."""
    percentile: int | None = None
    """Percent of real clips of the action with no larger value. None without enough clips."""


@dataclass(frozen=True, kw_only=True)
class ConstraintError(Result):
    """Distance of a motion from one of its constraints."""

    index: int = 0
    """Of the constraint in the item's `constraints`."""
    type: str = ""
    mean_m: float = 0.0
    """Metres; of the root over the points of a path, of the joints of a pose, of the effector over its targets."""
    max_m: float = 0.0
    mean_deg: float | None = None
    """Degrees; None without headings or rotations that were asked for."""
    missed: bool = False
    """Beyond its bar."""


@dataclass(frozen=True, kw_only=True)
class MotionQuality(Result):
    """Physical quality of a motion: measures of the whole clip, and what is wrong with it."""

    version: int = 0
    support: tuple[str, ...] = ()
    """Parts of the body that the actions of the prompt rest on; they choose the limits."""
    float_s: float = 0.0
    """Longest time with every joint over 8 cm above its resting height, seconds."""
    skate: float = 0.0
    """Share of frames in which feet touch the floor and none of their joints is slower than 0.5 m/s."""
    penetration_mm: float = 0.0
    """Depth of the deepest joint under the floor."""
    pops: int = 0
    """Number of jumps of a joint within a twentieth of a second."""
    range_deg: float = 0.0
    """Farthest that a joint bends beyond the human range."""
    self_contact: float = 0.0
    """Deepest that limbs, trunk and head pass into each other, millimetres."""
    flags: tuple[str, ...] = ()
    """Measures beyond their limits: floating, skating, under-floor, popping, joint-range, self-contact; off-prompt: a
    match under 0.5; constraint-missed: a constraint beyond its bar; posture-jump: a row of a timeline begins in a
    posture that the row before does not end in; part-left-out: a part of the prompt was not read."""
    ok: bool = False
    """True without flags."""
    match: PromptMatch | None = None
    """None for motions of earlier releases."""
    constraints: tuple[ConstraintError, ...] | None = None
    """In the order of the item's constraints; None without any."""


@dataclass(frozen=True, kw_only=True)
class Candidate(Result):
    """One motion that was drawn for an item."""

    index: int = 0
    """From 0, in the order in which they were drawn; redraws follow."""
    seed: int = 0
    """Candidate 0 has the item's seed."""
    flags: tuple[str, ...] = ()
    """Those of its quality record."""
    ok: bool = False
    """True without flags."""
    match: float | None = None
    """Value of its match; None where the prompt names no action."""


@dataclass(frozen=True, kw_only=True)
class Selection(Result):
    """The choice of a motion among candidates: one that shows the prompt first, then one without other flags, then by
    match, then the earlier one."""

    version: int = 0
    best_of: int = 0
    """Candidates of a round."""
    redraws: int = 0
    """Further rounds that were drawn because no candidate was good."""
    chosen: int = 0
    """Index of the candidate that is this motion."""
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Motion(Result):
    """A motion."""

    id: str
    job: str = ""
    item: str = ""
    index: int = 0
    name: str | None = None
    tags: tuple[str, ...] = ()
    prompt: str = ""
    model: str = ""
    bundle: str = ""
    licence: str = ""
    seed: int = 0
    variant: int = 0
    frames: int = 0
    fps: float = 0.0
    elapsed: float = 0.0
    files: tuple[File, ...] = ()
    created: datetime | None = None
    review: Review | None = None
    replaces: str | None = None
    """The motion that it is another take of."""
    replaced_by: str | None = None
    """The item that is another take of it."""
    edited_from: tuple[str, ...] = ()
    """Sources of an edit: the edited motion, then the others; empty if the motion was generated."""
    quality: MotionQuality | None = None
    """None for motions of earlier releases and of skeletons other than that of 22 joints."""
    selection: Selection | None = None
    """None if the motion was not chosen among candidates."""

    @property
    def seconds(self) -> float:
        """The length of the motion."""
        return self.frames / self.fps if self.fps else 0.0


@dataclass(frozen=True, kw_only=True)
class MotionDetail(Motion):
    """A motion with what its npz says of it: rewritten prompt, graph, settings, software."""

    metadata: Mapping[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True, kw_only=True)
class Reroll(Result):
    """Another take of a motion: an item of the same job."""

    motion: str = ""
    item: str = ""
    job: str = ""
    seed: int = 0
    state: str = ""
    made: bool = False
    """False = it was asked for before."""
