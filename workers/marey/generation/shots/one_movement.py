"""Movements of a prompt that are none of their own: they are the end of the one before them.

Who picks something up or bows "and stands back up" is upright already, and who raises a hand "and lowers it" has it
down again when that movement ends.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from marey.generation.row_postures import rises, row_postures
from marey.generation.wish import action_of
from marey.text.features import TextFeatures

RAISES = frozenset(
    {"raise-arm", "wave", "reach-up", "reach-forward", "guide", "signal", "cheer", "aim", "block", "clap", "talk"}
)
"""Actions that have a hand where it does not hang."""
UPRIGHT = frozenset(
    {"pick-up", "bow", "bend-over", "squat", "wave", "clap", "idle", "jump", "walk", "walk-backward", "run", "turn"}
    | {"raise-arm", "kick", "punch", "throw", "dance", "roll", "flip", "spin", "nod", "cheer", "wash", "sneak"}
)
"""Actions behind which a body is on its feet, where it has not stayed low."""
_LOWERS = re.compile(
    r"\W*(?:(?:then|and|he|she|they|it) )*(?:slowly |quickly |gently )?"
    r"(?:(?:lowers?|drops?|puts?|brings?|takes?|lets?) (?:it|them|that|(?:both|his|her|their|its|the)"
    r"(?: (?:left|right|same|raised|other|two))? (?:hands?|arms?|fists?|fingers?))"
    r"(?: (?:back|slowly|gently|down|fall|drop|again|hang|sink))*"
    r"(?: (?:to|at|by|on|in) (?:(?:his|her|their|its|the) )?(?:sides?|thighs?|knees?|laps?))?)\W*"
)
"""Words of a hand that is let down, and of nothing else."""
_DOWN = re.compile(r"\b(?:lower\w*|down|drops?|falls?|hang|sink|to (?:his|her|their|the) (?:side|thigh|lap|knee)s?)\b")
_BACK_UP = re.compile(
    r"\b(?:stand|get|got|com|jump|spring|straighten|rais|push|pick)\w* .*\b(?:up|feet)\b|\bris(?:es?|ing)\b"
    r"|\bstraighten\w*|\bback upright\b"
)
"""Words of a body that comes up, not of one that "stands upright" and waits."""
_FALLS = re.compile(r"\b(?:fall\w*|trip\w*|stumbl\w*|slip\w*|collaps\w*|knock\w*|faint\w*|div\w+|lying|lies)\b")
"""Words of a body that may be down, whatever its action."""


def joined_movements(movements: Sequence[TextFeatures], seed: int) -> tuple[TextFeatures, ...]:
    """Return movements without those that are the end of the one before them; their words stay.

    Args:
        movements: of a sequence, in their order.
        seed: of the sequence.
    """
    if len(movements) < 2:
        return tuple(movements)
    found: list[TextFeatures] = []
    for movement in movements:
        if found and (_is_up(found, movement, seed) or _lowers(found[-1], movement)):
            found[-1] = replace(found[-1], prompt=f"{found[-1].prompt} and {movement.prompt}")
        else:
            found.append(movement)
    return tuple(found)


def _is_up(before: Sequence[TextFeatures], movement: TextFeatures, seed: int) -> bool:
    """Return True if a movement is that of standing up, of a body that is on its feet behind those before it."""
    rows = [(action_of(each), each.said.lower()) for each in (*before, movement)]
    if (
        not (rises(rows[-1]) and _BACK_UP.search(rows[-1][1]))
        or rows[-2][0] not in UPRIGHT
        or _FALLS.search(rows[-2][1])
    ):
        return False
    held = row_postures(rows, seed)
    return not held[-1].begin and not held[-2].comes_to


def _lowers(before: TextFeatures, movement: TextFeatures) -> bool:
    """Return True if a movement is that of a hand which is let down behind a gesture with it."""
    said = movement.said.lower()
    return action_of(before) in RAISES and _LOWERS.fullmatch(said) is not None and _DOWN.search(said) is not None
