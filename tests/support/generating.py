"""Motions as generators return them, and batches of which some are cancelled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from marey.generation.port import Generated


def equal_motions(a: Sequence[Generated | None], b: Sequence[Generated | None]) -> bool:
    """Return True if all motions are there, with equal tokens and features."""
    return all(
        x is not None
        and y is not None
        and np.array_equal(x.tokens, y.tokens)
        and np.array_equal(x.features, y.features)
        for x, y in zip(a, b, strict=True)
    )


class Dropping:
    """Control that drops some requests after so many steps.

    Attributes:
        steps: the reported progress.
    """

    def __init__(self, *rows: int, after: int = 0) -> None:
        self.steps: list[tuple[int, int]] = []
        self._rows = set(rows)
        self._after = after

    def progress(self, done: int, total: int) -> None:
        """Keep the report."""
        self.steps.append((done, total))

    def dropped(self) -> set[int]:
        """Return the requests to leave out from now on."""
        return self._rows if len(self.steps) >= self._after else set()
