"""Draw motions for constraints: candidates of several lengths are ranked by how little they have to be changed, the
best few are fitted, and one is chosen. It depends on its own request and seed alone. The recording of a live stream is
the only candidate of its request."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from marey.core.frame_rates import frames_at_rate
from marey.generation.candidates import DrawPlan, candidate_seed
from marey.generation.constraints.choose import candidate_of, fit_candidate
from marey.generation.constraints.constraint_set import ConstraintSet, asked_of
from marey.generation.constraints.fit import misfit
from marey.generation.constraints.timing import shortest
from marey.generation.export import finish
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, Limits, MotionFeatures, NoControl, Request, S
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.generation.shots.timeline_plan import plan_timeline
from marey.items.constraint_frames import for_clip, frames_to_last, last_frame
from marey.items.constraints import ROOT_PATH
from marey.motion.body import NamedBody, standard_body, travel_scale
from marey.motion.clip import SELECTION, MotionClip
from marey.motion.edits.licences import LICENCE, terms_with
from marey.motion.skeleton import Skeleton
from marey.quality.selection import Selection

CANDIDATES = 8
"""Candidates of a motion, unless its `best_of` asks for more."""
FITTED = 4
"""Candidates that are fitted, the best by `misfit`."""
LENGTHS = (1.0, 1.25, 1.5, 1.0, 2.0, 0.9, 1.25, 1.5)
"""Lengths of candidates for a path, as shares of the clip's: of a longer one the part with the best speeds is shown, or
it is played faster."""
LONGEST_SHARE = 0.92
"""Most frames of a candidate that is longer than the clip, as a share of the model's longest motion. At its very end a
model has learned from few clips: walks of 9.8 s of `hgm3-open` 0.5 climb 0.7 m, those of 9 s stay on the floor."""
CONSTRAINTS = "constraints"
"""Key of the constraints in a motion's manifest."""
Constraints = Sequence[Mapping[str, Any]]


@dataclass(eq=False)
class _Drawn:
    """Candidates of one request that are kept so far, the best first: misfit, number, request, what was generated."""

    request: Request
    constraints: Constraints
    asked: ConstraintSet
    kept: list[tuple[float, int, Request, MotionFeatures]] = field(
        default_factory=list[tuple[float, int, Request, Any]]
    )
    dropped: bool = False


def constrained_request(
    generator: Generator[Any], request: Request, constraints: Constraints, seconds: float | None, fps: float | None
) -> Request:
    """Return a request with the length of a clip that its constraints fit: the one asked for, or else up to the last of
    them if there is a path.

    Args:
        seconds: asked for; None = the constraints decide if there is a path, else the model, to the last of them at
            least.
        fps: of the clip; None = the model's.

    Raises:
        InvalidInput: constraints beyond the clip, of another skeleton, that contradict one another, or poses under
            terms that exclude those of the weights; with the field in `where`.
    """
    terms_with(generator.bundle.manifest.licence, constraints)
    rate, limits = fps or generator.layout.fps, generator.limits
    # A path runs through one motion; movements that are made one by one would not follow it together.
    known = resolve_request(generator, replace(request, text=replace(request.text, movements=())))
    if seconds is None and request.timeline is None and request.recording is None:
        known = replace(known, frames=_reaching(known, constraints, limits, rate), open=False)
    _asked(constraints, known, limits, generator.layout.skeleton, rate)
    return known


def _reaching(known: Request, constraints: Constraints, limits: Limits, rate: float) -> int | None:
    """Return the length in frames of the model that reaches to the last constraint; None = it decides later."""
    least = frames_to_last(constraints, rate, limits.fps, limits.min_frames, limits.max_frames)
    if least is None:
        return known.frames
    if last_frame(constraints, rate, kind=ROOT_PATH) is not None:
        return least
    return None if known.frames is None else max(known.frames, least)


def _asked(
    constraints: Constraints, request: Request, limits: Limits, skeleton: Skeleton, rate: float
) -> ConstraintSet:
    """Check constraints against the clip of a request, the longest one if the model decides its length, and return them
    as arrays.

    Raises:
        InvalidInput: constraints beyond the clip, of another skeleton, or that contradict one another.
    """
    if request.timeline is not None:
        frames = plan_timeline(request.timeline, request.seed, limits).frames
    elif request.recording is not None:
        frames = len(request.recording.tokens)
    else:
        frames = request.frames or limits.max_frames
    own, count = for_clip(constraints, frames, limits.fps, rate)
    asked = asked_of(own, skeleton, count, rate)
    return asked if request.timeline is None and request.recording is None else replace(asked, retimed=False)


def constrained_clips(
    generator: Generator[S],
    requests: Sequence[Request],
    constraints: Sequence[Constraints],
    settings: S,
    plan: DrawPlan,
    *,
    body: NamedBody | None = None,
    control: GenerationControl | None = None,
) -> list[MotionClip | None]:
    """Return a clip of each request that meets its constraints; None where `control` dropped the request.

    Requests have the length that `constrained_request` gave them. Each clip faces +Z at the origin in frame 0; its
    `placement` leads to the space of the constraints. Its quality record has the errors.

    Raises:
        InvalidInput: constraints beyond a clip, of another skeleton, or that contradict each other; or as
            `Generator.generate`.
    """
    skeleton = (body or standard_body(generator.layout.skeleton)).skeleton
    rate = plan.fps or generator.layout.fps
    rows = [
        _Drawn(request, each, _asked(each, request, generator.limits, skeleton, rate))
        for request, each in zip(requests, constraints, strict=True)
    ]
    candidates = max(CANDIDATES, plan.candidates)
    scale = travel_scale(generator.layout.skeleton, skeleton)
    for number in range(candidates):
        _draw(generator, rows, settings, number, candidates, scale, control or NoControl())
    return [None if row.dropped else _best(generator, row, settings, plan, body) for row in rows]


def _draw(
    generator: Generator[S],
    rows: Sequence[_Drawn],
    settings: S,
    number: int,
    candidates: int,
    scale: float,
    control: GenerationControl,
) -> None:
    """Draw one candidate of each row, and keep it if it is among the best."""
    owners = [
        owner for owner, row in enumerate(rows) if not row.dropped and (number == 0 or row.request.recording is None)
    ]
    open_rows = [rows[owner] for owner in owners]
    part = [_candidate(row, number, generator.limits) for row in open_rows]
    watched = PassControl(control, owners, number * len(rows), candidates * len(rows))
    made = generate_any(generator, part, settings, control=watched) if part else []
    for row, request, generated in zip(open_rows, part, made, strict=True):
        if generated is None:
            row.dropped = True
            continue
        cost = _cost(generator, row.asked, generated, scale)
        row.kept = sorted([*row.kept, (cost, number, request, generated)], key=lambda each: each[:2])[:FITTED]


def _candidate(row: _Drawn, number: int, limits: Limits) -> Request:
    if row.request.recording is not None:
        return row.request
    if row.request.timeline is not None:
        return replace(row.request, seed=candidate_seed(row.request.seed, number))
    frames = row.request.frames or limits.max_frames
    if row.asked.paths:
        length = round(frames * LENGTHS[number % len(LENGTHS)])
        longest = max(round(LONGEST_SHARE * limits.max_frames), frames)
        frames = min(max(length, limits.min_frames, shortest(frames)), longest)
    return replace(row.request, seed=candidate_seed(row.request.seed, number), frames=frames)


def _cost(generator: Generator[Any], asked: ConstraintSet, generated: MotionFeatures, scale: float) -> float:
    """Return how much a candidate has to be changed for the path, from its joints as decoded."""
    if not asked.paths:
        return 0.0
    layout = generator.layout
    joints = np.asarray(layout.decode(generated.features), np.float64) * scale
    frames = frames_at_rate(asked.frames, asked.fps, layout.fps)
    return misfit(joints, asked.at_rate(layout.fps, frames), layout.skeleton)


def _best(generator: Generator[S], row: _Drawn, settings: S, plan: DrawPlan, body: NamedBody | None) -> MotionClip:
    """Finish and fit the kept candidates, and return the best with the record of the choice."""
    fitted = [
        fit_candidate(
            finish(generator, request, generated, settings, body=body, fps=plan.fps), request, row.asked, cost
        )
        for cost, _, request, generated in row.kept
    ]
    chosen = max(range(len(fitted)), key=lambda k: fitted[k].rank)
    seen = [candidate_of(number, one) for (_, number, _, _), one in zip(row.kept, fitted, strict=True)]
    selection = Selection(
        best_of=max(CANDIDATES, plan.best_of),
        redraws=0,
        chosen=row.kept[chosen][1],
        candidates=sorted(seen, key=lambda each: each.index),
    )
    about = {
        "seed": row.request.seed,
        LICENCE: terms_with(generator.bundle.manifest.licence, row.constraints),
        CONSTRAINTS: [dict(each) for each in row.constraints],
        **({} if row.request.recording is not None else {SELECTION: selection.model_dump(mode="json")}),
    }
    clip = fitted[chosen].clip
    return replace(clip, manifest={**clip.manifest, **about})
