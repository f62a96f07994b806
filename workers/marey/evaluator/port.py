"""Interface of evaluators: motions and sentences embedded in one space where matches are near.

There are two implementations: `marey.evaluator.tmr` (ours, after SnapMoGen App. B.2) and `marey.evaluator.t2m` (the
public network of Guo et al. 2022). Both take strings and raw features: the text encoder or word vectors that read the
strings, and the mean and deviation that normalise the features, are part of the evaluator. The statistics of the model
that generated the motion are never the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.retrieval import Distance

ProgressCallback = Callable[[], None]
"""Called regularly during long work, so that the caller can report progress."""

Motion = NDArray[np.float32]
Embeddings = NDArray[np.float32]


class Evaluator(Protocol):
    """A loaded evaluator. Numbers of different evaluators are different quantities: a number names its evaluator."""

    @property
    def name(self) -> str:
        """The exact bundle: `name@first 12 of the weights' hash`."""
        ...

    @property
    def layout(self) -> str:
        """Name of the feature layout it reads."""
        ...

    @property
    def fps(self) -> float:
        """Frames a second of the motions it reads."""
        ...

    @property
    def width(self) -> int:
        """E, the width of an embedding."""
        ...

    @property
    def distance(self) -> Distance:
        """The distance of its space; retrieval uses no other."""
        ...

    def embed_motion(self, motions: Sequence[Motion]) -> Embeddings:
        """Embed motions, row by row in the order given, independent of each other.

        Args:
            motions: each (T, D), raw features of `layout` in its own units (metres), as generated or captured, NOT
                normalised.

        Returns:
            (N, E).

        Raises:
            InvalidInput: another width, too short or too long, or numbers that are not finite; names the motion.
        """
        ...

    def embed_text(self, sentences: Sequence[str]) -> Embeddings:
        """Embed sentences, row by row in the order given, independent of each other.

        Args:
            sentences: prompts as users write them.

        Returns:
            (N, E).

        Raises:
            InvalidInput: a sentence it cannot read.
        """
        ...


def no_progress() -> None:
    """Do nothing: the default `ProgressCallback`."""


def check_motions(motions: Sequence[Motion], width: int, shortest: int, longest: int) -> None:
    """Validate motions before they are embedded.

    Raises:
        InvalidInput: not (T, `width`), T outside `shortest` to `longest`, or numbers that are not finite.
    """
    for number, motion in enumerate(motions):
        where = f"motion {number}"
        if motion.ndim != 2 or motion.shape[1] != width:
            raise InvalidInput(f"features have shape {motion.shape}, not (T, {width})", where=where)
        if not shortest <= len(motion) <= longest:
            raise InvalidInput(
                f"has {len(motion)} frames; this evaluator reads {shortest} to {longest}",
                where=where,
                hint="Evaluate a longer motion in windows.",
            )
        broken = np.flatnonzero(~np.isfinite(motion).all(1))
        if broken.size:
            raise InvalidInput(
                f"{broken.size} of {len(motion)} frames hold NaN or infinite numbers, the first is {broken[0]}",
                where=where,
                hint="Check the model that generated it: a broken motion cannot be embedded.",
            )
