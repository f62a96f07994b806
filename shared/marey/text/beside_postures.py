"""Gestures of a body that sits, kneels or crouches meanwhile, told as the posture and then the gesture (ours).

Readers know a gesture of who stands: "bows while kneeling", "a seated man waves" and "shoots from one knee" were read
as the gesture alone, or made in one pass, which stands up for it.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping

from marey.text.action_reader import named_actions
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.inflection import indefinite_article
from marey.vocabulary.scope import GESTURES

_WHERE = r"(?: (?:on|in|at|down|upon|behind|against|cross-legged)(?: (?!and\b|then\b)[\w'-]+){0,4}?)?"
_BEING = r"(?P<being>sitting|seated|kneeling|crouching|crouched|squatting)"
_WHO = r"(?P<who>(?:(?:an?|the|one) (?:[\w-]+ ){1,2}?|(?:he|she|they) )?)"
_ENDS = r"(?P<end>\W*)$"
_MEANWHILE = re.compile(
    rf"^(?P<start>\W*){_WHO}(?P<does>[a-z]+(?:e?s|ing)?\b[^.;]*?),? "
    rf"(?:(?:while|whilst|as) (?:(?:he|she|they) )?(?:is |are )?|still )?{_BEING}(?P<where>{_WHERE}){_ENDS}",
    re.IGNORECASE,
)
"""A gesture, and the posture meanwhile: "bows while kneeling", "claps, sitting on a bench"."""
_FROM = re.compile(
    rf"^(?P<start>\W*){_WHO}(?P<does>[a-z]+(?:e?s|ing)?\b[^.;]*?),? (?:from|in|on) "
    rf"(?:(?:an?|the|his|her|their) (?P<named>sitting|seated|kneeling|crouching|crouched|squatting)"
    rf" (?:position|posture|stance)|(?P<knee>(?:one|a|(?:his|her) (?:left |right )?) ?knee"
    rf"|(?:his|her|their|both) knees)"
    rf"|(?:an?|the) (?P<low>crouch|squat))"
    rf"{_ENDS}",
    re.IGNORECASE,
)
"""The same by the name of the posture: "fires from one knee"."""
_ADJECTIVE = re.compile(
    rf"^(?P<start>\W*)(?P<det>an?|the|one) {_BEING} (?P<noun>[\w-]+(?: [\w-]+)??) (?P<does>[a-z]+s\b[^.;]*?){_ENDS}",
    re.IGNORECASE,
)
"""A person in the posture: "a seated man waves"."""
_AND = re.compile(
    rf"^(?P<start>\W*){_WHO}(?P<being>(?:sit|kneel|crouch|squat)(?:e?s)?(?: down)?)(?P<where>{_WHERE}),? and "
    rf"(?P<does>[a-z]+s?\b[^.;]*?){_ENDS}",
    re.IGNORECASE,
)
"""The posture, and the gesture in it: "sits and points ahead"."""
_SEVERAL = re.compile(r"\b(?:and|then|before|after|until)\b|,", re.IGNORECASE)
_POSTURES = {"crouch": "crouching", "squat": "squatting"}


def with_posture_first(prompt: str) -> str:
    """Return a prompt in which a body that gestures in a posture is in that posture first, and then gestures."""
    for pattern, posture in _POSTURE_OF.items():
        found = pattern.match(prompt)
        if found is not None and (_gestures(found["does"], prompt) or (pattern is _FROM and _rises(found))):
            return f"{found['start']}{posture(found)}, then {found['does']}{found['end']}"
    return prompt


def _of_adjective(found: re.Match[str]) -> str:
    article = found["det"] if found["det"].lower() not in ("a", "an") else _article(found["noun"], found["det"])
    return f"{article} {found['noun']} is {found['being']}"


def _of_name(found: re.Match[str]) -> str:
    being = found["named"] or _POSTURES.get((found["low"] or "").lower()) or f"kneeling on {found['knee']}"
    return f"{found['who']}is {being}"


_POSTURE_OF: Mapping[re.Pattern[str], Callable[[re.Match[str]], str]] = {
    _ADJECTIVE: _of_adjective,
    _MEANWHILE: lambda found: f"{found['who']}is {found['being']}{found['where']}",
    _AND: lambda found: f"{found['who']}{found['being']}{found['where']}",
    _FROM: _of_name,
}
"""Makers of the words of the posture, by the pattern that finds it; the first that fits decides."""


def _gestures(does: str, prompt: str) -> bool:
    """Return True if words of a prompt ask for one gesture of arms, head or trunk, which is drawn in any posture, and
    for no bearing, which is drawn on the posture itself."""
    if _SEVERAL.search(does) or any(each.words.strip() in does.lower() for each in stated_bearings(prompt)):
        return False
    named = named_actions(does)
    return len(named) == 1 and named <= GESTURES


def _rises(found: re.Match[str]) -> bool:
    """Return True for who rises from the knees or from a crouch: who rises from a seat is known."""
    sits = (found["named"] or "").lower() in ("sitting", "seated")
    return not sits and named_actions(found["does"]) in ({"stand-up"}, {"get-up"})


def _article(noun: str, like: str) -> str:
    article = indefinite_article(noun)
    return article.capitalize() if like[0].isupper() else article
