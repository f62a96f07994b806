"""Captions that show a language model the style of a data set: MOGO's style prior Ψ (Sec. 2.3)."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable, Sequence

from marey.core.errors import MareyError
from marey.data.manifest import Clip
from marey.items.prompts import check_prompt
from marey.text.wordings import CAPTION_WORDS
from marey.vocabulary.scope import every_action, match_scope

CAPTIONS, LENGTHS = 24, 4
"""Captions that are chosen, as many of each quarter of the lengths."""
LEAST_WORDS = 3
LONGEST = 500
"""Characters, as manifests allow."""
LOOKED_AT = 200
"""Captions of a quarter among which those of different actions are chosen."""


def style_of(clips: Iterable[Clip]) -> tuple[str, ...]:
    """Return captions of the clips, of several lengths and actions, the same whatever the order of the clips.

    Different captions are put in four groups by their length, as many in each. Of a group the first six by their hash
    are taken, those of actions that none has yet before the others. Captions that no rewrite may be, with under three
    words or over 60, are left out.

    Args:
        clips: of the training split.
    """
    said = {text for clip in clips for caption in clip.captions if (text := _usable(caption))}
    ranked = sorted(said, key=lambda text: (len(text.split()), _hash(text)))
    taken = Counter[str | None]()
    chosen: list[str] = []
    for number in range(LENGTHS):
        group = ranked[number * len(ranked) // LENGTHS : (number + 1) * len(ranked) // LENGTHS]
        chosen += _varied(sorted(group, key=_hash)[:LOOKED_AT], CAPTIONS // LENGTHS, taken)
    return tuple(chosen)


def _varied(texts: Sequence[str], count: int, taken: Counter[str | None]) -> list[str]:
    """Choose texts whose action was taken least often so far, and count it."""
    left = {text: match_scope(text, every_action()).actions[0].action for text in texts}
    chosen: list[str] = []
    while left and len(chosen) < count:
        text = min(left, key=lambda each: taken[left[each]])  # the first of several
        taken[left.pop(text)] += 1
        chosen.append(text)
    return chosen


def _usable(caption: str) -> str | None:
    """Return a caption as a prompt; None if it cannot be one, or is too short or too long."""
    try:
        text = check_prompt(caption)
    except MareyError:
        return None
    return text if LEAST_WORDS <= len(text.split()) <= CAPTION_WORDS and len(text) <= LONGEST else None


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
