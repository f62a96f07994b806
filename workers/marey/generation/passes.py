"""Control of one of several passes of a batch."""

from __future__ import annotations

from collections.abc import Sequence

from marey.generation.port import GenerationControl


class PassControl:
    """Control of one pass over parts of requests, as a share of all parts."""

    def __init__(
        self, control: GenerationControl, owners: Sequence[int], before: int, total: int, *, parts: int | None = None
    ) -> None:
        """Create the control of a pass.

        Args:
            control: of the batch.
            owners: the request of each part of this pass.
            before: parts of earlier passes.
            total: parts of all passes.
            parts: of this pass; None = as many as it has owners.
        """
        self._control = control
        self._owners = owners
        self._before = before
        self._total = total
        self._parts = len(owners) if parts is None else parts

    def progress(self, done: int, total: int) -> None:
        """Report a step of this pass as a percent of its parts."""
        share = self._parts * 100 * done // total
        self._control.progress(100 * self._before + share, 100 * self._total)

    def dropped(self) -> set[int]:
        """Return the parts of dropped requests."""
        dropped = self._control.dropped()
        return {part for part, owner in enumerate(self._owners) if owner in dropped}
