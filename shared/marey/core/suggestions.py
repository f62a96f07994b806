"""Suggestions for mistyped names. Standard library only: the small client imports it."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

LONGEST = 40
"""Characters: longer names are mistyped from none."""
MOST_APART = 2
"""Characters that a name has more or fewer than the known one. Most names are sorted out by it, at little cost."""
LIKENESS = 0.7


def nearest(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is meant, where a name differs by case, a few letters or their order; else None."""
    typed = name.strip().lower()
    if len(typed) > LONGEST:
        return None
    names = {each.lower(): each for each in known if abs(len(each) - len(typed)) <= MOST_APART}
    letters = sorted(typed)
    swapped = [each for each in names if sorted(each) == letters]
    found = swapped or difflib.get_close_matches(typed, names, 1, LIKENESS)
    return names[found[0]] if found else None


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ` (did you mean 'prompt'?)` for a message about an unknown name; empty if it is like none."""
    found = nearest(name, known)
    return "" if found is None else f" (did you mean {found!r}?)"
