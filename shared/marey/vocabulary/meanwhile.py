"""Clauses of a prompt that are done at once, joined by "as" or "while": which words say so, and which are left out with
the words of a bearing in one of them.

"As she runs, she waves", "while waving she runs" and "she waves while running" are a run with a wave drawn on it. The
clause of the way or the posture is read; the other one and the words that join it are left out.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

Span = tuple[int, int]

WAYS = (
    r"(?:walk(?:s|ing|ed)?|runs?|running|jog(?:s|ging)?|sprint(?:s|ing)?|stroll(?:s|ing)?|march(?:es|ing)?|turns?|turning"
    r"|(?:side)?steps?|back(?:s|ing)|advanc(?:e|es|ing)|strafe?s?|strafing|creeps?|creeping|paces?|pacing)"
)
"""Verbs of ways beside which a bearing is shown."""
_GOES = (
    rf"(?:{WAYS}|circl(?:es|ing)|(?:side)?stepping|hurr(?:y|ies|ying)|strid(?:e|es|ing)|wander(?:s|ing)?"
    r"|dash(?:es|ing)?|rush(?:es|ing)?|limp(?:s|ing)?|retreat(?:s|ing)?|pass(?:es|ing)?|approach(?:es|ing)?"
    r"|shuffl(?:es|ing)|trudg(?:es|ing)|trot(?:s|ting)?)\b"
)
"""Verbs of ways that are read."""
_BASE = rf"(?:{_GOES}|(?:kneel(?:s|ing)?|sit(?:s|ting)?)\b)"
"""Verbs of the clause that is read: those of ways, and of postures in which the arms are free."""
_AS = r"(?:as|while|whilst)(?! (?:if|though|soon|well|long|far|usual|much|many|a|an)\b)"
AT_ONCE = re.compile(r"\b(?:as|while|whilst)\b", re.IGNORECASE)
"""Words without one of which no text says that two things are done at once."""
JOINS_AHEAD = re.compile(r"\b(?:as|while|whilst) $", re.IGNORECASE)
"""A word ahead of a clause that joins it to the next one."""
_HOW = r"(?:(?:is|are|also|still|\w+ly) )*"
_PRONOUN = r"(?:he|she|they|it)"
_NOUN = r"(?:the|his|her|their|a|an|our) (?:(?!(?:he|she|they|the|a|an)\b)[\w-]+ ){0,2}?(?!(?:he|she|they)\b)[\w-]+"
_WHO = rf"(?:{_PRONOUN}|{_NOUN})"
_STARTS = r"(?:^|(?<=[,.;:] )|(?<=\band )|(?<=\bthen ))"
_REST = r"(?P<rest>(?:(?!(?:and|then|but|or)\b)[^,.;]){0,40}?)"
"""Words behind those of a bearing that its patterns do not know: "waves | to the crowd of fans"."""
_WAY_BEHIND = re.compile(rf"^{_REST},?\s+{_AS} (?:{_WHO} )?{_HOW}(?={_BASE})")
_WAY_AHEAD = re.compile(
    rf"{_STARTS}(?P<joint>{_AS} )(?:{_WHO} )?{_HOW}(?={_BASE})(?:(?!\b(?:and then|then)\b)[^,.;])*?"
    rf"(?P<who>,\s+(?:{_WHO}\s+)?|\s+(?:{_WHO})\s+){_HOW}$"
)
_WAY_BEFORE = re.compile(rf"\b{_BASE}(?:(?!\bthen\b)[^.;])*?(?P<joint>,?\s+(?<!\bsame time ){_AS} (?:{_WHO} )?{_HOW})$")
_AHEAD = re.compile(rf"{_STARTS}{_AS} (?:{_WHO} )?{_HOW}$")
_AHEAD_OF_WAY = re.compile(rf"^{_REST}(?:,\s+|\s+(?={_WHO} ))(?=(?:{_WHO} )?{_HOW}{_BASE})")
_TO_THE_END = re.compile(rf"^{_REST}(?=\s*(?:$|[,.;!]|(?:and|then|but)\b))")
_JOINT_TAKEN = re.compile(r"\s+(?:as|while|whilst)$")
"""A word that joins clauses, which a pattern took for an object: "talks to his friend while"."""
_BEING = re.compile(r"\b(?:is|are) (?:\w+ly )?$")
_SENTENCE = re.compile(r"[.;]|\bthen\b")
_PARTICIPLE = re.compile(r"\w+ing$|with$")
_WAY = re.compile(rf"\b{_GOES}")


def spans_at_once(text: str, start: int, end: int) -> Sequence[Span]:
    """Return the parts of a text to leave out with words of a bearing that a clause has beside one of a way or a
    posture; none if the text does not say that both are done at once.

    Args:
        text: in lower case.
        start: of the words of the bearing.
        end: of these words.
    """
    own = text[start:end]
    end -= len(own) - len(_JOINT_TAKEN.sub("", own))
    before, behind = text[:start], text[end:]
    if found := _WAY_BEHIND.match(behind):
        being = _BEING.search(before)
        return [(start if being is None else being.start(), end + found.end())]
    whole = end + (more.end() if (more := _TO_THE_END.match(behind)) else 0)
    if found := _WAY_AHEAD.search(before):
        return [(found.start("who"), whole), found.span("joint")]
    if found := _WAY_BEFORE.search(before):
        return [(found.start("joint"), whole)]
    ahead, found = _AHEAD.search(before), _AHEAD_OF_WAY.match(behind)
    return [(ahead.start(), end + found.end())] if ahead and found else []


def is_on_a_way(text: str, start: int, end: int) -> bool:
    """Return True if words that begin with a verb in -ing stand in the same sentence as a way: "runs, waving"."""
    if not _PARTICIPLE.match(text[start:end].split()[0]):
        return False
    ahead = _SENTENCE.split(text[:start])[-1]
    behind = _SENTENCE.split(text[end:])[0]
    return _WAY.search(f"{ahead} {behind}") is not None
