"""Requests of a generator, made of what an item asks for and the features of its prompts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

from marey.generation.asked import drawing_of
from marey.generation.candidates import split_settings
from marey.generation.constraints.draw import constrained_request
from marey.generation.port import Generator, Request
from marey.generation.shots.dispatch import resolve_request, timeline_request
from marey.items.timeline import timeline_rows
from marey.text.features import TextFeatures

if TYPE_CHECKING:
    from marey.streams.recording import StreamRecording  # it would import the database


class MotionFields(Protocol):
    """Fields of an item that decide its motion, beside its prompts."""

    @property
    def seed(self) -> int:
        """Return the seed."""
        ...

    @property
    def seconds(self) -> float | None:
        """Return the length; None = the prompt or the model decides."""
        ...

    @property
    def settings(self) -> Mapping[str, Any]:
        """Return the settings of the network, and those of the platform, such as the frame rate."""
        ...

    @property
    def timeline(self) -> Sequence[Mapping[str, Any]] | None:
        """Return the rows of a timeline, as `read_timeline` does; None = one prompt."""
        ...

    @property
    def constraints(self) -> Sequence[Mapping[str, Any]] | None:
        """Return the constraints, as `read_constraints` does; none = it has none."""
        ...


def request_of(
    generator: Generator[Any],
    item: MotionFields,
    texts: Sequence[TextFeatures],
    scope: Mapping[str, Any] | None,
    recording: StreamRecording | None = None,
) -> Request:
    """Return the request of an item, with its length where the model decides lengths beforehand.

    Args:
        generator: draws the motion.
        item: what is asked for.
        texts: of the prompt, or of each row of the timeline.
        scope: of the prompt or of all rows; None = by their words.
        recording: of a live stream that is exported.

    Raises:
        InvalidInput: a length or seed out of range, features of another encoder, or constraints that no clip can meet;
            with the field in `where`.
    """
    own, plan = split_settings(item.settings)
    if item.timeline is not None:
        request = timeline_request(timeline_rows(item.timeline), texts, item.seed, scope)
    else:
        frames = generator.limits.frames_of(item.seconds, texts[0])
        request = Request(texts[0], item.seed, frames, recording, scope)
    request = replace(request, drawing=drawing_of(generator, generator.settings(own)))
    if item.constraints:
        request = constrained_request(generator, request, item.constraints, item.seconds, plan.fps)
    return resolve_request(generator, request)
