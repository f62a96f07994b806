"""Everything that a prompt asks for of a movement that is drawn."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class FineWish:
    """How a movement is to be drawn.

    Attributes:
        count: repetitions; None = any number.
        side: `left` or `right` of the limb that acts; empty = either.
        prompt: as a user typed it, for its kind.
        fixed: the motion keeps its number of frames.
        beside: prompts of the movements before and after it, in one motion; empty = none.
    """

    count: int | None = None
    side: str = ""
    prompt: str = ""
    fixed: bool = False
    beside: tuple[str, str] = ("", "")
