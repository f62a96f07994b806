"""Data types of the repository of live streams."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple
from uuid import UUID

from marey.jobs.types import FailureReason
from marey.streams.actions import ActionStart
from marey.streams.rewrites import PromptRewrite
from marey.streams.states import StreamState, WaitsFor


@dataclass(frozen=True)
class NewStream:
    """A live stream to create.

    Args:
        key: the caller's API key.
        prompt: the first prompt.
        bundle: the exact bundle.
        seed: 0 … 2³¹ − 1.
        max_frames: number of frames after which it ends.
    """

    tenant: str
    key: UUID
    prompt: str
    model: str
    bundle: str
    seed: int
    max_frames: int
    name: str | None = None


@dataclass(frozen=True)
class StreamRow:
    """A live stream."""

    id: UUID
    tenant: str
    name: str | None
    prompt: str
    model: str
    bundle: str
    seed: int
    max_frames: int
    state: StreamState
    position: int | None
    """Number of streams that wait before it; None if it does not wait."""
    waits_for: WaitsFor | None
    """None if it does not wait."""
    reason: str | None
    problem: FailureReason | None
    fence: int
    worker: str | None
    control: str
    frames: int
    """Number of recorded frames; at most a second less than shown."""
    job: UUID | None
    """Job of the clip."""
    created: datetime
    started: datetime | None
    ended: datetime | None


class StreamPrompt(NamedTuple):
    """A prompt of a stream as viewers receive it."""

    frame: int
    """First frame."""
    prompt: str
    read: PromptRewrite | None = None
    """None if not recorded."""


@dataclass(frozen=True)
class StreamPast:
    """State from which a worker resumes a stream.

    Attributes:
        tokens: int16, little-endian, a column of V levels for each of `row.frames`.
        prompts: every prompt with its first frame; none before the first frame.
        actions: starts of actions of all these prompts.
    """

    row: StreamRow
    tokens: bytes = field(repr=False)
    prompts: tuple[tuple[int, str], ...]
    actions: tuple[ActionStart, ...]


@dataclass(frozen=True)
class StreamChunk:
    """Frames and changes since the last chunk.

    Args:
        first: number of its first frame.
        frames: how many.
        tokens: int16, little-endian, a column of V levels a frame.
        prompts: prompts that came into force; `reads`, of the same length, has their rewrites.
        control: id of the last applied message.
        state: live or paused; None = unchanged.
        actions: starts of actions.
    """

    first: int
    frames: int
    tokens: bytes = field(repr=False)
    prompts: Sequence[tuple[int, str]]
    control: str
    state: StreamState | None = None
    actions: Sequence[ActionStart] = ()
    reads: Sequence[PromptRewrite] | None = None
