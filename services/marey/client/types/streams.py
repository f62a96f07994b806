"""Results of `client.streams`."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from marey.client.results import Result
from marey.client.types.common import ErrorDetail

ENDED_STREAM = frozenset({"ended", "failed"})


@dataclass(frozen=True, kw_only=True)
class StreamPrompt(Result):
    """A prompt, and since which frame it is in force."""

    number: int = 0
    """As in frames: from 0; each steer counts one on."""
    frame: int = 0
    prompt: str = ""
    rewritten: str | None = None
    """As it was read; None where that is not on record."""
    not_rewritten: str | None = None
    """Why what the rewriter made of it was not used."""
    warnings: tuple[str, ...] = ()
    """Sentences on parts of it that the model does not know, by its words."""


@dataclass(frozen=True, kw_only=True)
class StreamSkeleton(Result):
    """The joints that frames turn."""

    names: tuple[str, ...] = ()
    parents: tuple[int, ...] = ()
    """Index of each joint's parent, which comes before it; -1 for the root."""
    offsets: tuple[tuple[float, ...], ...] = ()
    """The rest pose: metres from the parent, Y up, facing +Z; the root's own from the floor."""


@dataclass(frozen=True, kw_only=True)
class Stream(Result):
    """A live stream."""

    id: str
    name: str | None = None
    prompt: str = ""
    model: str = ""
    bundle: str = ""
    licence: str | None = None
    """Terms of the weights; None when the bundle is no longer here."""
    seed: int = 0
    state: str = ""
    position: int | None = None
    """How many wait before it; None when it does not wait."""
    waits_for: str | None = None
    """`slot` of a worker, or `worker`: none has loaded the bundle; None when it does not wait."""
    reason: str | None = None
    """Why it is over."""
    error: ErrorDetail | None = None
    fps: float | None = None
    """Frames a second; None when the bundle is no longer here."""
    frames: int = 0
    """How many are on record: a second less than were shown, at most."""
    max_frames: int = 0
    job: str | None = None
    """The job that makes the clip; None until the stream is over."""
    created: datetime | None = None
    started: datetime | None = None
    ended: datetime | None = None

    @property
    def has_ended(self) -> bool:
        """True once the stream is over."""
        return self.state in ENDED_STREAM


@dataclass(frozen=True, kw_only=True)
class StreamDetail(Stream):
    """A live stream with its prompts on record and its skeleton."""

    prompts: tuple[StreamPrompt, ...] = ()
    skeleton: StreamSkeleton | None = None
    """The skeleton that the frames drive; None when the bundle is no longer here."""
