"""Progress of a stream through the actions of its prompt."""

from __future__ import annotations

from typing import NamedTuple


class ActionStart(NamedTuple):
    """Start of an action of the prompt in force."""

    frame: int
    """Number of the first frame of the action."""
    action: int
    """Number of the action in its prompt, from 0."""
