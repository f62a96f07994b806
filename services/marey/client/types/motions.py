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
