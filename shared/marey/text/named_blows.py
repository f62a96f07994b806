"""Blows by their own nouns, told as punches: of "throws a backfist" or "a body shot" models read a throw (ours).

What kind of punch it is, the drawing takes from the words of the prompt (`marey.vocabulary.blows`).
"""

from __future__ import annotations

import re

_SIDED = re.compile(
    r"\b(?P<an>an )?(?:over[- ]?hand|(?<!stands )(?<!standing )straight) (?P<side>left|right)(?: hand)?"
    r"(?=$|[,.;!]| (?:and|then|to|at|into|combo\w*)\b)",
    re.IGNORECASE,
)
"""A blow of which the way and the hand are named: "an overhand right"."""
_BEHIND_ARTICLE = re.compile(
    r"\b(?:an?|the|his|her|their|one|two|three|some|with|\w+(?:s|ing)) (?:[\w-]+ )?$|^\W*(?:lead |rear )?$"
    r"|[,;] (?:\w+ )?$|\b(?:and|then) (?:an? )?$",
    re.IGNORECASE,
)
_GOES = re.compile(r"\b(?:walk|run|go|jog|turn|head|move|look|drive|keep|stand|sit|aim|step|jump)\w* $", re.IGNORECASE)
_NOUN = re.compile(
    r"(?<!spinning )(?<!turning )(?<!spin )(?<!360 )(?<!degree )(?<!degrees )"
    r"\b(?:back[- ]?fist|hammer[- ]?fist(?: strike)?|palm(?:[- ]heel)?[- ]strike|(?:body|liver)[- ](?:shot|blow))"
    r"(?P<s>s)?\b",
    re.IGNORECASE,
)
"""A blow of which the way, or what it hits, is all that is named; out of a turn it is drawn as one."""
_JOINT = re.compile(
    r"(?P<joint>^|[,;+&]\s*|\b(?:and|then)\s+)(?P<one>an? )?"
    r"(?:(?P<before>left|right) elbow|(?P<part>elbow|knee(?! (?:left|right)))(?: (?P<side>left|right))?)"
    r"(?=$|[.,;+&]| (?:and|then|combo\w*)\b)",
    re.IGNORECASE,
)
_BLOWS = re.compile(
    r"\b(?:punch(?:es)?|jabs?|hooks?|cross(?:es)?|uppercuts?|kicks?|knees?|strikes?|overhand|backfists?)\b",
    re.IGNORECASE,
)
"""A blow with the elbow or the knee in a list of blows."""


def with_blows_named(text: str) -> str:
    """Return a text in which unknown blows are punches, and elbows and knees among other blows strike."""
    told = _NOUN.sub(lambda found: f"punch{'es' if found['s'] else ''}", _SIDED.sub(_punch, text))
    return _JOINT.sub(_with_joint, told) if _BLOWS.search(told) else told


def _punch(found: re.Match[str]) -> str:
    """Return a punch of a side, unless the words say where a body goes."""
    before = found.string[: found.start()]
    if _GOES.search(before) or not (found["an"] or _BEHIND_ARTICLE.search(before)):
        return found[0]
    return f"{'a ' if found['an'] else ''}{found['side']} punch"


def _with_joint(found: re.Match[str]) -> str:
    side = found["before"] or found["side"]
    part = (found["part"] or "elbow").lower()
    return f"{found['joint']}{found['one'] or ''}{side + ' ' if side else ''}{part} strike"
