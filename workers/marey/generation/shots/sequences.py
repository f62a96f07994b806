"""Sequences: a prompt of several movements, made as a timeline of them.

A model that learned single actions shows two of them in one pass for every second prompt, and three for every sixth.
Made one by one, each as long as it takes alone, four of five and two of three show
(docs/decisions/0044-sequences.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import Any

from marey.generation.lengths import resolved_length
from marey.generation.port import Generator, Limits, Request
from marey.generation.timed import TimedText, part_seed
from marey.items.timeline import MIN_ROW_SECONDS
from marey.text.features import TextFeatures
from marey.vocabulary.lengths import stated_length

SEED = "movement"
"""Part of the seed by which the length of a movement is drawn."""


def as_timeline(generator: Generator[Any], request: Request) -> Request:
    """Return the request of a sequence as that of a timeline with a row for each movement; any other as it is.

    Each movement has the length that its words state, or the model gives it alone. Where the length of the whole is
    asked for, all are longer or shorter by the same factor; where that leaves one of them less than a second, the
    prompt stays one text.

    Args:
        generator: of the motion; one that cannot generate frames around others makes the prompt in one pass.
        request: of one prompt.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    movements = request.text.movements
    alone = not (request.kept or request.free or request.recording or request.timeline)
    if not (movements and alone and generator.limits.keeps):
        return request
    generator.limits.check(request)
    fps = generator.limits.fps
    stated = [_stated_frames(generator.limits, request, movement) for movement in movements]
    lengths = [own or _drawn_frames(generator, request, number) for number, own in enumerate(stated)]
    if request.frames is not None:
        lengths = _shared(request.frames, lengths)
    if min(lengths) < MIN_ROW_SECONDS * fps:
        return request
    ends = list(accumulate(lengths))
    rows = tuple(
        TimedText((end - length) / fps, end / fps, text, open=own is None and request.frames is None)
        for end, length, text, own in zip(ends, lengths, movements, stated, strict=True)
    )
    return replace(request, timeline=rows)


def _stated_frames(limits: Limits, request: Request, movement: TextFeatures) -> int | None:
    """Return the frames of a movement that its words state, or its reader; None = they do not, or the prompt has a
    length out of the range of the bundle."""
    if movement.seconds is not None:
        return limits.within(round(movement.seconds * limits.fps))
    whole, own = stated_length(request.text.prompt), stated_length(movement.prompt).seconds
    used = whole.is_partial or whole.within(limits.min_frames / limits.fps, limits.max_frames / limits.fps)
    return limits.within(round(own * limits.fps)) if used and own is not None else None


def _drawn_frames(generator: Generator[Any], request: Request, number: int) -> int:
    """Return the frames that the model gives a movement alone."""
    alone = Request(request.text.movements[number], part_seed(request.seed, SEED, number))
    return resolved_length(generator, alone).frames or generator.limits.min_frames


def _shared(frames: int, lengths: Sequence[int]) -> list[int]:
    """Return lengths in the same ratio that sum up to `frames`."""
    ends = [round(frames * end / sum(lengths)) for end in accumulate(lengths, initial=0)]
    return [end - start for start, end in pairwise(ends)]
