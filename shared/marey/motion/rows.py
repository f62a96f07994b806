"""States of live streams: arrays with a row for each stream, so that one call advances all of them by a frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from marey.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class Rows:
    """Base of a state whose every field is an array (S, ...) or another such state. Streams join and leave between
    frames by rows."""

    def __len__(self) -> int:
        return len(getattr(self, fields(self)[0].name))

    def take(self, rows: Sequence[int]) -> Self:
        """Return the state of these streams, in this order."""
        index = np.array(rows, np.intp)

        def pick(value: Rows | Array) -> Rows | Array:
            return value.take(rows) if isinstance(value, Rows) else value[index]

        return type(self)(**{f.name: pick(getattr(self, f.name)) for f in fields(self)})

    @classmethod
    def join(cls, states: Sequence[Self]) -> Self:
        """Concatenate the streams of several states."""

        def merge(values: Sequence[Any]) -> Rows | Array:
            first = values[0]
            return type(first).join(values) if isinstance(first, Rows) else np.concatenate(values)

        return cls(**{f.name: merge([getattr(state, f.name) for state in states]) for f in fields(cls)})
