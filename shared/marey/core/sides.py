"""Left and right in texts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, cast

_SIDE = re.compile(
    r"(?<![a-z])(?:(?:anti-?|counter-?)?clockwise|(?:left|right)(?=(?:wards?|handed|most)?(?![a-z])))", re.I
)
_OTHER = {"left": "right", "right": "left"}


def swap_sides(text: str) -> str:
    """Exchange left and right in a text: `walk-turn-left` becomes `walk-turn-right`."""
    return _SIDE.sub(_swapped, text)


def swap_sides_in(value: Any) -> Any:
    """Exchange left and right in every text of a JSON value; keys of objects stay."""
    if isinstance(value, str):
        return swap_sides(value)
    if isinstance(value, Mapping):
        return {name: swap_sides_in(each) for name, each in cast("Mapping[str, Any]", value).items()}
    if isinstance(value, Sequence):
        return [swap_sides_in(each) for each in cast("Sequence[Any]", value)]
    return value


def _swapped(found: re.Match[str]) -> str:
    word = found.group(0)
    other = _OTHER.get(word.lower())
    if other is None:
        other = "counterclockwise" if word.lower() == "clockwise" else "clockwise"
    return other.upper() if word.isupper() else other.capitalize() if word[0].isupper() else other
