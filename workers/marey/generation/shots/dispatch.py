"""Generation of requests of every kind: motions of one prompt, and timelines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from marey.core.errors import InvalidInput
from marey.generation.asked import generate_as_asked
from marey.generation.lengths import resolved_length
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, MotionFeatures, NoControl, Request, S
from marey.generation.shots.sequences import as_timeline
from marey.generation.shots.timelines import check_timelines, generate_timelines
from marey.generation.timed import TimedText
from marey.items.timeline import TimelineRow
from marey.text.features import TextFeatures

TIMELINE_BUCKET = 2**31
"""Bucket of timelines: after those of motions of one prompt, which cost less."""


def timeline_request(
    rows: Sequence[TimelineRow], texts: Sequence[TextFeatures], seed: int, scope: Mapping[str, Any] | None
) -> Request:
    """Return the request of a timeline.

    Args:
        rows: in the order of time.
        texts: of the prompt of each row.
        seed: of the whole.
        scope: of all rows; None = by their words.

    Raises:
        InvalidInput: the number of texts is not that of the rows.
    """
    if len(texts) != len(rows):
        raise InvalidInput(f"{len(texts)} prompts were parsed, and the timeline has {len(rows)} rows", where="text")
    scopes: Sequence[Mapping[str, Any] | None] = (scope or {}).get("rows") or [None] * len(rows)
    timeline = tuple(
        TimedText(row.start, row.end, text, of_row) for row, text, of_row in zip(rows, texts, scopes, strict=True)
    )
    return Request(replace(texts[0], movements=()), seed, scope=scope, timeline=timeline)


def resolve_request(generator: Generator[S], request: Request) -> Request:
    """Return the request with its length set, where the model decides lengths beforehand; a sequence as a timeline.

    Raises:
        InvalidInput: as `Limits.check`; or a timeline, and the model cannot generate frames around others.
    """
    request = as_timeline(generator, request)
    if request.timeline is None:
        return replace(resolved_length(generator, request), open=request.open or request.frames is None)
    check_timelines(generator)
    for row in request.timeline:
        generator.limits.check(Request(row.text, request.seed))
    return request


def bucket_of(generator: Generator[S], request: Request) -> int:
    """Return the bucket of a request with a set length; requests of one bucket are generated together."""
    return generator.bucket(request) if request.timeline is None else TIMELINE_BUCKET


def generate_any(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S | None = None,
    *,
    control: GenerationControl | None = None,
) -> list[MotionFeatures | None]:
    """Generate one motion per request, as `Generator.generate`, timelines among them.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    timed = [row for row, request in enumerate(requests) if request.timeline is not None]
    if not timed:
        return generate_as_asked(generator, requests, settings, control=control)
    plain = [row for row, request in enumerate(requests) if request.timeline is None]
    made: list[MotionFeatures | None] = [None] * len(requests)

    def keep(rows: Sequence[int], motions: Sequence[MotionFeatures | None]) -> None:
        for row, motion in zip(rows, motions, strict=True):
            made[row] = motion

    def watched(rows: Sequence[int], before: int) -> PassControl:
        return PassControl(control or NoControl(), rows, before, len(requests))

    if plain:
        keep(plain, generate_as_asked(generator, [requests[row] for row in plain], settings, control=watched(plain, 0)))
    several = [requests[row] for row in timed]
    keep(timed, generate_timelines(generator, several, settings, control=watched(timed, len(plain))))
    return made
