"""Where a prompt has the head turn: "looks left, then right", "glances over her shoulder", "shakes his head"."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import groupby
from typing import Literal, cast

Glance = Literal[
    "left",
    "right",
    "up",
    "down",
    "around",
    "behind",
    "behind_left",
    "behind_right",
    "shake",
    "twice_left",
    "twice_right",
    "twice",
]
"""`around`: to one side and to the other; `behind`: over either shoulder, or that of a side, with the shoulders;
`shake`: quickly to and fro; `twice`: to a side, ahead, and fast to the same side again."""

_AT = (
    r"(?: (?:at|into|towards?) (?:(?:him|her|them|it|someone)"
    r"|(?:a|an|the|his|her|their|its|some) (?:(?!(?:and|then|while)\b)\w+ ){0,2}?\w+)"
    r"(?=$|[.,;!]| (?:and|then|while|with|before|as)\b))?"
)
"""Objects that a head faces which turns up or down: "up at the tower"."""
_BEHIND = r"behind(?: (?:him|her|them)(?:sel(?:f|ves))?)?(?! (?:the|an?|my|your|his|their)\b)"
_WHERE = {
    "behind_left": r"over (?:(?:his|her|their|its|the|your|my) )?left shoulder"
    rf"|(?:left )?{_BEHIND} (?:over|on|to) (?:his|her|their|its|the) left(?: shoulder| side)?",
    "behind_right": r"over (?:(?:his|her|their|its|the|your|my) )?right shoulder"
    rf"|(?:right )?{_BEHIND} (?:over|on|to) (?:his|her|their|its|the) right(?: shoulder| side)?",
    "left": r"left|leftwards?|(?:(?:in|at|into) )?(?:the|his|her) left mirror",
    "right": r"(?:(?:in|at|into) )?(?:the|his|her) (?:right|rear-?view|rear view|driving) mirror"
    r"|right(?! (?:at|into|in|through|past)\b)|rightwards?",
    "up": rf"up(?! (?:the|to) ){_AT}|upwards?|(?:at|to|into|towards?) (?:the )?(?:(?:night|blue|dark|starry) )?"
    r"(?:sky|ceiling|stars|heavens|clouds|moon|sun)",
    "down": rf"down(?! the ){_AT}|downwards?|at (?:(?:the|his|her|their|its) )?(?:floor|ground|feet|shoes|watch)",
    "around": r"around|about(?! to\b)|both ways|(?:from )?side to side|left and right|right and left",
    "behind": rf"{_BEHIND}|over (?:(?:his|her|their|its|the|one|a|your|my) )?shoulder",
}
_SIDE = r"(?:(?:back |quickly |slowly |briefly )?(?:to (?:the|his|her|their|its) )?)"
_ANY = "|".join(f"(?P<{name}>{words})" for name, words in _WHERE.items())
_LOOKS = re.compile(
    r"\b(?:look|glanc|gaz|peer|star|scan|check)(?:s|e|es|ing|ed)?\b"
    r"|\b(?:turn|tilt|mov)(?:s|e|es|ing)? (?:(?:his|her|their|its|the) )?head\b"
    r"(?: (?:to|and) (?:look|glance|peer)s?\b)?"
)
_TURNS_HEAD = re.compile(
    r"\bturn(?:s|ing)? (?:his|her|their|its|the) head"
    r"(?: (?:\w+ly|away|aside|sideways|to (?:the|one) side|a little|a bit))*"
    r"(?! and (?:(?:his|her|their|its) )?(?:body|shoulders|torso|trunk|neck)\b)"
    r"(?=\W*$|[.,;!]| (?:and|then|while|as|before|until)\b)"
)
"""A head that turns to no side that is named."""
_STEP = re.compile(rf"(?:\s*,?\s*(?:and |then |and then )?(?:{_SIDE}))(?:{_ANY})\b(?!-)")
_SHAKES = re.compile(r"\bshak(?:e|es|ing) (?:(?:his|her|their|its|the) )?head\b(?: no\b)?|\bhead[ -]shak(?:e|ing)\b")
_TWICE = re.compile(
    r"\b(?:(?:does|do|did|doing|makes?|making)\ (?:an?|the|his|her)\ (?:\w+\ )?)?double[- ]takes?\b"
    r"(?:\ to\ (?:the|his|her|their|its)\ (?P<side>left|right))?(?:\ at\ (?:the|a|an|his|her)\ (?:\w+\ )?\w+)?"
    r"|\blook(?:s|ing)?\ (?:away\ and\ )?(?:back\ )?twice\b"
)
"""A second look at once."""
_JOINT = re.compile(
    r"(?:^|\s*[,;]|\s)\s*(?:(?:and|then|while|as|but|first)\s+)*(?:(?:an?|the)\s+(?:person|man|woman)\s+|(?:he|she|they)\s+)?"
    r"(?:(?:is|are)\s+)?(?:\w+ly\s+)?$",
    re.IGNORECASE,
)
"""Words that join these to others."""
_MOOD = (
    r"(?:(?:a bit|a little|very|all|quite) )?"
    r"(?:embarrassed|nervous|confused|worried|scared|frightened|afraid|puzzled|suspicious"
    r"|alert|curious|dazed|ashamed|lost|bewildered|angry|happy|sad|tired|bored|amazed|surprised|shocked|anxious|proud"
    r"|startled|guilty|annoyed|relieved|sheepish)"
)
_SAYS_HOW = re.compile(rf"(?:(?:an?|the) \w+ ?)?(?:\w+ly|{_MOOD}(?: and {_MOOD})?)?\W*", re.IGNORECASE)
_DENIED = re.compile(r"\b(?:without|not|never|no|n't|don't|stops?|avoids?)\s+(?:(?!(?:and|then)\b)\w+\s+)?$")


def stated_gaze(prompt: str) -> tuple[Glance, ...]:
    """Return where the head turns, in order; empty if a prompt does not say.

    Args:
        prompt: as a user typed it.
    """
    glances: list[Glance] = [glance for _, _, found in _spans(prompt) for glance in found]
    return tuple(glance for glance, _ in groupby(glances))


def without_gaze(prompt: str) -> str:
    """Return a prompt without the words that have the head turn: "walks" of "walks while looking around"."""
    kept, at = "", 0
    for begin, end, _ in _spans(prompt):
        joint = _JOINT.search(prompt[at:begin])
        kept += prompt[at : begin if joint is None else at + joint.start()]
        at = end
    return (kept + prompt[at:]).strip(" ,;.") if at else prompt


def only_gaze(prompt: str) -> bool:
    """Return True if a prompt asks for nothing but that the head turns."""
    return bool(stated_gaze(prompt)) and _SAYS_HOW.fullmatch(without_gaze(prompt)) is not None


def _spans(prompt: str) -> Iterator[tuple[int, int, list[Glance]]]:
    """Yield begin and end of the words that have the head turn, and where to."""
    text = prompt.lower().replace("’", "'")
    found: list[tuple[int, int, list[Glance]]] = [
        (each.start(), each.end(), ["shake"]) for each in _SHAKES.finditer(text)
    ]
    for again in _TWICE.finditer(text):
        found.append(
            (again.start(), again.end(), [cast("Glance", f"twice_{again['side']}" if again["side"] else "twice")])
        )
    for head in _TURNS_HEAD.finditer(text):
        found.append((head.start(), head.end(), ["around"]))
    for looks in _LOOKS.finditer(text):
        at, glances = looks.end(), list[Glance]()
        while (step := _STEP.match(text, at)) is not None:
            glances.append(cast("Glance", next(name for name in _WHERE if step[name] is not None)))
            at = step.end()
        if glances:
            found.append((looks.start(), at, glances))
    yield from sorted(each for each in found if not _DENIED.search(text[: each[0]]))
