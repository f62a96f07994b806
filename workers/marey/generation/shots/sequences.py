"""Sequences: a prompt of several movements, made as a timeline of them.

A model that learned single actions shows two of them in one pass for every second prompt, and three for every sixth.
Made one by one, each as long as it takes alone, four of five and two of three show
(docs/decisions/0044-sequences.md).
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

from marey.generation.port import Generator, Request
from marey.generation.timed import TimedText, part_seed
from marey.items.timeline import MIN_ROW_SECONDS
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
    """
    movements = request.text.movements
    alone = not (request.kept or request.free or request.recording or request.timeline)
    if not (movements and alone and generator.limits.keeps):
        return request
    fps = generator.limits.fps
    lengths = [_frames(generator, request, number) for number in range(len(movements))]
    if request.frames is not None:
        lengths = _shared(request.frames, lengths)
    if min(lengths) < MIN_ROW_SECONDS * fps:
        return request
    ends = [sum(lengths[: number + 1]) for number in range(len(lengths))]
    rows = tuple(
        TimedText((end - length) / fps, end / fps, text)
        for end, length, text in zip(ends, lengths, movements, strict=True)
    )
    return replace(request, timeline=rows)


def _frames(generator: Generator[Any], request: Request, number: int) -> int:
    """Return the frames of a movement: those that its words state, or else those that the model gives it alone."""
    limits, text = generator.limits, request.text.movements[number]
    whole, own = stated_length(request.text.prompt), stated_length(text.prompt).seconds
    used = whole.is_partial or whole.within(limits.min_frames / limits.fps, limits.max_frames / limits.fps)
    if used and own is not None:
        return limits.within(round(own * limits.fps))
    return generator.resolve_length(Request(text, part_seed(request.seed, SEED, number))).frames or limits.min_frames


def _shared(frames: int, lengths: list[int]) -> list[int]:
    """Return lengths in the same ratio that sum up to `frames`."""
    total, ends = sum(lengths), [0]
    for number in range(len(lengths)):
        ends.append(round(frames * sum(lengths[: number + 1]) / total))
    return [end - start for start, end in itertools.pairwise(ends)]
