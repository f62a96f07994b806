"""The interface between the live loop and its model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import Skeleton
from marey.streams.actions import ActionStart
from marey.streams.frames import Frame
from marey.text.features import TextFeatures

Tokens: TypeAlias = NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """Result of a step for one session."""

    frame: Frame
    tokens: Tokens
    """(V,): the column it was decoded from."""
    action: int
    """Number of the action in its prompt, from 0."""


class SessionPool(Protocol):
    """Sessions of one loaded bundle; all that are not paused advance together, one frame per step. Not thread-safe.

    Every method raises `InvalidInput` for an unknown session or one in the wrong state.
    """

    @property
    def capacity(self) -> int:
        """Maximum number of sessions."""
        ...

    @property
    def fps(self) -> float:
        """Frames per second."""
        ...

    @property
    def bundle(self) -> str:
        """The exact bundle."""
        ...

    @property
    def model(self) -> str:
        """Its model, which is the queue that makes clips of recordings."""
        ...

    @property
    def skeleton(self) -> Skeleton:
        """The skeleton of its frames."""
        ...

    @property
    def levels(self) -> int:
        """V, codes per frame."""
        ...

    @property
    def min_frames(self) -> int:
        """Length of the shortest clip, in frames."""
        ...

    def start(
        self,
        text: TextFeatures,
        seed: int,
        *,
        past: Tokens | None = None,
        prompt: int = 0,
        began: ActionStart | None = None,
    ) -> int:
        """Start a session, or resume one behind `past` (n, V) with prompt number `prompt` in force and its action
        `began` playing (None: the first action starts); return its id."""
        ...

    def steer(self, session: int, text: TextFeatures) -> None:
        """Set another prompt, in force from the next frame on."""
        ...

    def pause(self, session: int) -> None:
        """Exclude a session from steps."""
        ...

    def resume(self, session: int) -> None:
        """Resume a session with the frames that it would have shown."""
        ...

    def stop(self, session: int) -> None:
        """Remove a session."""
        ...

    def catch_up(self, session: int, frames: int) -> list[LiveFrame]:
        """Return the next frames of one session alone, at once."""
        ...

    def step(self) -> dict[int, LiveFrame]:
        """Return the next frame of every session that is not paused."""
        ...


Parse: TypeAlias = Callable[[str], TextFeatures]
"""Parses a prompt; may be called on several threads at once. Raises `InvalidInput`."""


@dataclass(frozen=True)
class LiveModel:
    """A model that a live worker serves.

    Attributes:
        open_pool: returns an empty pool; called again after a pool failed.
        parse: parses prompts, each on a thread of its own.
        device: device name for the worker's row.
    """

    open_pool: Callable[[int], SessionPool]
    parse: Parse
    device: str


LiveModelFactory: TypeAlias = Callable[[], LiveModel]
