"""Shots of a bow that are told in parts: "draws the bow, aims high and releases" is one movement."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from marey.text.sequence_reader import ReadMovement

_BOW = "draw-bow"
_OF_THE_SAME = frozenset({_BOW, "aim", "shoot", "idle", None})
"""Actions that parts of the shot are taken for when they are read alone."""
_PART = re.compile(
    r"""\W*(?:(?:and|then|before|he|she|they)\ )*(?:\w+ly\ )?(?:takes?\ (?:careful\ )?)?
    (?:aim|hold|held|wait|pause|breathe|steady|steadi|release|releasing|loos|let|fire|firing|shoot|shot|pull|anchor)""",
    re.IGNORECASE | re.VERBOSE,
)
_OTHER_WEAPON = re.compile(r"\b(?:gun|rifle|pistol|revolver|shotgun|crossbow|sword|blade|dagger|knife|spear)s?\b", re.I)


def with_whole_shots(movements: Iterable[ReadMovement]) -> tuple[ReadMovement, ...]:
    """Return movements in which what is done with a drawn bow is one movement with its draw."""
    whole = list[ReadMovement]()
    for each in movements:
        may_be = bool(whole) and each.action in _OF_THE_SAME and each.seconds is None
        if may_be and is_part_of_shot(each.text, whole[-1].action):
            whole[-1] = replace(whole[-1], text=f"{whole[-1].text}, {each.text}")
        else:
            whole.append(each)
    return tuple(whole)


def is_part_of_shot(text: str, action: str | None) -> bool:
    """Return True if a text says what is done with the bow that is drawn in a movement of this action."""
    return action == _BOW and bool(_PART.match(text)) and not _OTHER_WEAPON.search(text)
