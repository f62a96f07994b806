"""What the live loop knows of the model it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray

from marey.streams.actions import ActionStart
from marey.streams.frames import Frame
from marey.text.features import TextFeatures

Tokens: TypeAlias = NDArray[np.int16]


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What a step gives for a session."""

    frame: Frame
    tokens: Tokens
    """(V,): the column it was decoded from."""
    act: int
    """Number of the act of its prompt, from 0."""


class SessionPool(Protocol):
    """Sessions of one loaded bundle; all that are not paused move on together, one frame a step. One thread at a time.

    Every method raises `InvalidInput` for a session that is not there or not in the right state.
    """

    @property
    def capacity(self) -> int:
        """Sessions at most."""
        ...

    @property
    def fps(self) -> float:
        """Frames of a second."""
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
    def levels(self) -> int:
        """V, codes of a frame."""
        ...

    @property
    def min_frames(self) -> int:
        """The shortest clip."""
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
        """A new session, or one to go on behind `past` (n, V) with prompt number `prompt` in force, of which the act
        `began` plays (None: the first begins); its name."""
        ...

    def steer(self, session: int, text: TextFeatures) -> None:
        """Another prompt, in force from the next frame on."""
        ...

    def pause(self, session: int) -> None:
        """Leave a session out of the steps."""
        ...

    def resume(self, session: int) -> None:
        """Let it go on with the frames that it would have shown."""
        ...

    def stop(self, session: int) -> None:
        """Forget a session."""
        ...

    def catch_up(self, session: int, frames: int) -> list[LiveFrame]:
        """The next frames of one session alone, at once."""
        ...

    def step(self) -> dict[int, LiveFrame]:
        """The next frame of every session that is not paused."""
        ...


Parse: TypeAlias = Callable[[str], TextFeatures]
"""Reads a prompt; may be called on several threads at once. Raises `InvalidInput`."""


@dataclass(frozen=True)
class LiveModel:
    """What a live worker serves.

    Attributes:
        open_pool: an empty pool; called again when one broke.
        parse: reads prompts, each on a thread of its own.
        device: for the worker's row.
    """

    open_pool: Callable[[int], SessionPool]
    parse: Parse
    device: str


LiveModelFactory: TypeAlias = Callable[[], LiveModel]
