"""Where a stream stands among the acts of its prompt."""

from __future__ import annotations

from typing import NamedTuple


class ActionStart(NamedTuple):
    """An act of the prompt that was in force began to play."""

    frame: int
    """The first that was drawn under it."""
    act: int
    """Its number in its prompt, counted from 0."""
