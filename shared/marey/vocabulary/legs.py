"""Legs that a prompt names: the one that carries the body, and the one that is lifted or swings."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Literal

Leg = Literal["left", "right", ""]

ON_ONE_LEG = frozenset({"balance", "hop"})
"""Actions whose side is that of the leg that carries the body."""
WITH_ONE_LEG = frozenset({"arabesque", "kick", "kick-ball"})
"""Actions whose side is that of the leg that is lifted."""
_OF = r"(?:(?:his|her|their|its|the|one|a|my|your)[ ])?(?:own[ ])?"
_NO_LEG = r"(?![ ](?:hand|arm|fist|palm|elbow|wrist|forearm|shoulder|side|hip|knee|edge|of)\b)"
_FOOT = r"(?:leg|foot|toes?|heel)"
_CARRIES = re.compile(
    rf"""\b(?:st(?:and|ood)|balanc|hop|poise|perch|weight|pivot|stay|remain|sway|wobbl|teeter|pose|stance)\w*\b
    (?:(?!\b(?:left|right)\b)[^;.])*?\bon(?:to)?\ {_OF}(?P<on>left|right)\b{_NO_LEG}
    |\bthen\ on(?:to)?\ {_OF}(?P<then>left|right)\b{_NO_LEG}
    |\b(?P<base>left|right)\ {_FOOT}\ (?:(?:is|stays|remains|kept|being|firmly)\ )*
    (?:planted|rooted|flat|straight|on\ the\ (?:floor|ground)|down|carr(?:ies|ying)|bear(?:s|ing)|support\w*|standing
    |stands|as\ (?:the\ |a\ )?(?:stand|support|base)\w*)\b
    |\b(?:standing|supporting|support|base)\ {_FOOT}\ (?:is\ )?{_OF}(?P<named>left|right)\b""",
    re.VERBOSE,
)
"""Words of the leg on which a body stands: "balances on the left foot", "weight on the right", "left foot planted"."""
_LIMB = r"(?:leg|foot|knee|thigh|heel|ankle|shin|toes?)"
_IS_LIFTED = re.compile(
    rf"""\b(?:lift|rais|sw[iu]ng|bring|pull|draw|hug|hold|bend|bent|tuck|stretch|extend|pick|hook|cross|rest|press|put|plac)
    \w*\ (?:(?:up|out|back)\ )?{_OF}(?P<object>left|right)\ {_LIMB}\b
    |\b(?P<subject>left|right)\ {_LIMB}\ (?:(?:is|held|kept|being|stays|\w+ly|points?)\ )*
    (?:up|raised|lifted|bent|high|off|in\ the\ air|out|sw[iu]ng\w*|stretch\w*|extend\w*|outstretched|behind|back\w*
    |forwards?|ahead|against|tucked|hooked|crossed|resting|drawn|pulled|in\ front|hover\w*|dangl\w*|rises|kick\w*
    |to\ the\ (?:side|back|front))\b
    |\bkick\w*\b(?:(?!\b(?:stand\w*|weight)\b)[^;.])*?\b(?:with|using|off)\ {_OF}(?P<kicks>left|right)\b
    {_NO_LEG}""",
    re.VERBOSE,
)
"""Words of the leg that is off the floor: "left knee up", "raises the right foot", "kicks with the left"."""
_OTHER: dict[str, Leg] = {"left": "right", "right": "left", "": ""}


def stated_leg(prompt: str, action: str) -> Leg:
    """Return the leg, `left` or `right`, that a prompt has an action of `ON_ONE_LEG` or `WITH_ONE_LEG` done on or with,
    also where it names the other one alone; empty if its words do not say how they use the legs, or of other actions.

    Args:
        prompt: as a user typed it.
        action: id in the vocabulary.
    """
    if action not in ON_ONE_LEG | WITH_ONE_LEG:
        return ""
    text = " ".join(prompt.lower().split())
    lifted = _only(_sides(_IS_LIFTED.finditer(text)))
    carries = _only(_sides(_CARRIES.finditer(text)))
    if action in ON_ONE_LEG:
        return carries or _OTHER[lifted]
    return lifted or _OTHER[carries]


def _sides(found: Iterable[re.Match[str]]) -> set[str]:
    return {side for match in found for side in match.groups() if side}


def _only(sides: set[str]) -> Leg:
    """Return the only side of several words; empty if there is none, or if they name both."""
    return _OTHER[_OTHER[sides.pop()]] if len(sides) == 1 else ""
