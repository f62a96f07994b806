"""Prompts at stated times, as a request of a generator holds them."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.generation.posture import NO_POSTURE, RowPosture
from marey.items.values import MAX_SEED
from marey.text.features import TextFeatures

CUT = 8
"""Most frames of a row that the transition to it replaces. All are at its beginning: an action shows at its end that it
was done (a seat is reached, stairs are climbed), and replacing frames there costs adherence."""
CUT_SHARE = 4
"""At most one in so many frames of a row is replaced."""


def cut_of(frames: int, grid: int = 1) -> int:
    """Return how many frames at its beginning a row loses to a transition, a multiple of `grid`."""
    return max(grid, min(CUT, frames // CUT_SHARE // grid * grid))


@dataclass(frozen=True)
class TimedText:
    """One prompt of a timeline.

    Attributes:
        start: in seconds.
        end: in seconds.
        text: of the prompt.
        scope: of the prompt; None = by its words.
        seed: of the row; None = derived from the seed of the whole.
        made: (t, D) features of the first window of the row, made before; None = they are generated.
        open: its times were not asked for, and may change with what is made.
        changes: of the motion of the row, as of `AskedMotion`.
        held: its postures.
    """

    start: float
    end: float
    text: TextFeatures = field(repr=False)
    scope: Mapping[str, Any] | None = None
    seed: int | None = None
    made: NDArray[np.float32] | None = field(default=None, repr=False, compare=False)
    open: bool = False
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    held: RowPosture = NO_POSTURE


def part_seed(seed: int, part: str, number: int) -> int:
    """Return the seed of a part of a motion, from the seed of the whole."""
    digest = hashlib.sha256(f"marey {part} {seed} {number}".encode()).digest()
    return int.from_bytes(digest[:8], "little") % (MAX_SEED + 1)


WORDED = 2**16
"""Seeds that words of a movement lead to from one seed."""


def worded_seed(seed: int, said: str) -> int:
    """Return the seed of what is drawn for words, so that other words give another take of the same action. It grows
    with the seed, by one."""
    words = " ".join(said.lower().split()).rstrip(".!")
    return seed + int.from_bytes(hashlib.sha256(words.encode()).digest()[:8], "little") % WORDED
