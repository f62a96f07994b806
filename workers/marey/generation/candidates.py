"""Best of N: several candidates of each request, of which one becomes the motion.

Candidates of one number share forward passes; one clip of each request is kept, so memory does not grow with N. Every
candidate depends on the seed of its request and its own number alone: results do not depend on the batch.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.generation.asked import changes_of
from marey.generation.export import finish
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, MotionFeatures, NoControl, Request, S
from marey.generation.shots.dispatch import generate_any
from marey.generation.shots.provenance import with_selections
from marey.generation.shots.timelines import check_timelines, generate_timelines, row_requests
from marey.generation.timed import part_seed
from marey.items.settings import BEST_OF, OUTPUT_FPS, PLATFORM_SETTINGS, REDRAWS
from marey.motion.body import NamedBody
from marey.motion.clip import SELECTION, MotionClip
from marey.quality.record import OF_PROMPT, SHOWN, read_quality
from marey.quality.selection import Candidate, Selection

ROWS_SHARE = 80
"""Percent of the progress of timelines that is of the candidates of their rows."""


@dataclass(frozen=True)
class DrawPlan:
    """Settings of an item that are not the network's.

    Attributes:
        fps: of the files; None = the model's.
        best_of: candidates of a round.
        redraws: most further rounds, drawn while no candidate is good.
    """

    fps: float | None = None
    best_of: int = 1
    redraws: int = 0

    @property
    def is_single(self) -> bool:
        """True if nothing is chosen."""
        return self.candidates == 1

    @property
    def candidates(self) -> int:
        """The most candidates of an item."""
        return self.best_of * (self.redraws + 1)


def split_settings(values: Mapping[str, Any]) -> tuple[dict[str, Any], DrawPlan]:
    """Split an item's settings into the network's own and the platform's."""
    own = {name: value for name, value in values.items() if name not in PLATFORM_SETTINGS}
    return own, DrawPlan(values.get(OUTPUT_FPS), int(values.get(BEST_OF, 1)), int(values.get(REDRAWS, 0)))


def candidate_seed(seed: int, number: int) -> int:
    """Return the seed of a candidate: the item's own for candidate 0, else one derived from both."""
    return seed if number == 0 else part_seed(seed, "candidate", number)


def best_clips(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S,
    plan: DrawPlan,
    *,
    body: NamedBody | None = None,
    control: GenerationControl | None = None,
) -> list[MotionClip | None]:
    """Draw candidates of each request, and return the best of each; None where `control` dropped the request. Of a
    timeline, candidates of each row are drawn, and the best of these are joined.

    Raises:
        InvalidInput: as `Generator.generate`.
    """
    made: list[MotionClip | None] = [None] * len(requests)
    plain = [row for row, request in enumerate(requests) if request.timeline is None]
    timed = [row for row, request in enumerate(requests) if request.timeline is not None]
    for rows, before, best in ((plain, 0, _best_motions), (timed, len(plain), _best_timelines)):
        if rows:
            watched = PassControl(control or NoControl(), rows, before, len(requests))
            part = best(generator, [requests[row] for row in rows], settings, plan, body, watched)
            for row, clip in zip(rows, part, strict=True):
                made[row] = clip
    return made


def _best_motions(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S,
    plan: DrawPlan,
    body: NamedBody | None,
    control: GenerationControl,
) -> list[MotionClip | None]:
    """Return the best candidate of each request of one prompt."""
    draws = [_Draw(request, plan) for request in requests]
    _draw(generator, draws, range(len(draws)), settings, plan, body, control)
    return [draw.result() for draw in draws]


def _best_timelines(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S,
    plan: DrawPlan,
    body: NamedBody | None,
    control: GenerationControl,
) -> list[MotionClip | None]:
    """Return timelines of which each row is the best of its own candidates; transitions are made once, of these."""
    check_timelines(generator)
    draws = [[_Draw(row, plan) for row in row_requests(request, generator.limits)] for request in requests]
    owners = [number for number, rows in enumerate(draws) for _ in rows]
    drawing = PassControl(control, range(len(requests)), 0, 100, parts=ROWS_SHARE)
    every = [draw for rows in draws for draw in rows]
    _draw(generator, every, owners, settings, replace(plan, fps=None), body, drawing)
    left = [number for number, rows in enumerate(draws) if all(draw.best is not None for draw in rows)]
    chosen = [_with_best(requests[number], draws[number]) for number in left]
    joining = PassControl(control, left, ROWS_SHARE, 100, parts=100 - ROWS_SHARE)
    made = generate_timelines(generator, chosen, settings, control=joining) if chosen else []
    clips: list[MotionClip | None] = [None] * len(requests)
    for number, request, generated in zip(left, chosen, made, strict=True):
        if generated is not None:
            clip = finish(generator, request, generated, settings, body=body, fps=plan.fps)
            clips[number] = with_selections(clip, [draw.selection() for draw in draws[number]])
    return clips


def _with_best(request: Request, draws: Sequence[_Draw]) -> Request:
    """Return the request of a timeline whose rows are the best that were drawn."""
    assert request.timeline is not None
    rows = zip(request.timeline, draws, strict=True)
    chosen = (replace(row, seed=draw.chosen_seed, made=draw.features, changes=draw.changes) for row, draw in rows)
    return replace(request, timeline=tuple(chosen))


def _draw(
    generator: Generator[S],
    draws: Sequence[_Draw],
    owners: Sequence[int],
    settings: S,
    plan: DrawPlan,
    body: NamedBody | None,
    control: GenerationControl,
) -> None:
    """Draw candidates until each request has a good one, or all that it may have.

    Args:
        draws: of the requests; one that is dropped has no best clip.
        owners: number of each request in `control`.
    """
    open_rows, number = list(range(len(draws))), 0
    while open_rows and number < plan.candidates:
        part = [draws[row].request(number) for row in open_rows]
        watched = PassControl(control, [owners[row] for row in open_rows], number, plan.candidates, parts=1)
        made = generate_any(generator, part, settings, control=watched)
        kept: list[int] = []
        for row, generated in zip(open_rows, made, strict=True):
            if generated is None:
                draws[row].best = None
                continue
            draws[row].fix_length(len(generated.features))
            clip = finish(generator, draws[row].asked, generated, settings, body=body, fps=plan.fps)
            draws[row].consider(number, clip, generated)
            kept.append(row)
        number += 1
        round_ended = number % plan.best_of == 0
        open_rows = [row for row in kept if not (round_ended and draws[row].good)]


def draw_clips(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S,
    plan: DrawPlan,
    *,
    body: NamedBody | None = None,
) -> Iterator[MotionClip]:
    """Generate, and return the motion of each request in order: its only one, finished when it is taken, or the best of
    its candidates.

    Raises:
        InvalidInput: as `Generator.generate`.
    """
    if not plan.is_single:
        return filter(None, best_clips(generator, requests, settings, plan, body=body))  # nothing was dropped
    made = generate_any(generator, requests, settings)
    return (
        finish(generator, request, generated, settings, body=body, fps=plan.fps)
        for request, generated in zip(requests, made, strict=True)
        if generated is not None
    )


class _Draw:
    """The candidates of one request, and the best of them."""

    def __init__(self, asked: Request, plan: DrawPlan) -> None:
        self.asked = asked
        self.best: MotionClip | None = None
        self.features: NDArray[np.float32] | None = None
        self.changes: Mapping[str, Any] = {}
        self.good = False
        self._plan = plan
        self._frames = asked.frames
        self._rank = (False, False, -1.0)
        self._chosen = 0
        self._candidates: list[Candidate] = []

    def request(self, number: int) -> Request:
        """Return the request of a candidate; all have the length of the first."""
        return replace(self.asked, seed=candidate_seed(self.asked.seed, number), frames=self._frames)

    def fix_length(self, frames: int) -> None:
        """Give the candidates that follow the length of the first one, where the model drew it."""
        self._frames = self._frames or frames

    def consider(self, number: int, clip: MotionClip, generated: MotionFeatures) -> None:
        """Keep a candidate if it is better than those before it: one that shows the prompt, then one without flags,
        then by match."""
        quality = read_quality(clip.manifest)
        flags = [] if quality is None else quality.flags
        match = None if quality is None or quality.match is None else quality.match.value
        seed = candidate_seed(self.asked.seed, number)
        self._candidates.append(Candidate(index=number, seed=seed, flags=flags, ok=not flags, match=match))
        shows, sound = match is None or match >= SHOWN, set(flags) <= OF_PROMPT
        self.good = self.good or (shows and sound)
        rank = (shows, sound, 0.0 if match is None else match)
        if rank > self._rank:
            self.best, self._rank, self._chosen = clip, rank, number
            self.features, self.changes = generated.features, changes_of(generated)

    @property
    def chosen_seed(self) -> int:
        """Return the seed of the best candidate."""
        return candidate_seed(self.asked.seed, self._chosen)

    def selection(self) -> Selection:
        """Return the record of the choice."""
        return Selection(
            best_of=self._plan.best_of,
            redraws=-(-len(self._candidates) // self._plan.best_of) - 1,
            chosen=self._chosen,
            candidates=self._candidates,
        )

    def result(self) -> MotionClip | None:
        """Return the best clip, with the record of the choice in its manifest."""
        if self.best is None:
            return None
        record = self.selection().model_dump(mode="json")
        return replace(self.best, manifest={**self.best.manifest, SELECTION: record})
