"""Progress of a stream through the actions of its prompt."""

from __future__ import annotations

from typing import NamedTuple


class ActionStart(NamedTuple):
    """Start of an action of the prompt in force."""

    frame: int
    """The first that was drawn under it."""
    act: int
    """Its number in its prompt, counted from 0."""
