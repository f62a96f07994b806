"""Verbs of ways that readers do not know, in words that they do: "backpedals" as "walks backward"."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache

from marey.vocabulary.inflection import forms_of_other, in_present_form_of, verb_forms

_WALK = "walk"
_WAYS: Mapping[str, tuple[tuple[str, ...], str, str]] = {
    "backpedal": (("backpedal", "back-pedal"), r"(?: back(?:wards?)?)?", " backward"),
    "waddle": (("waddle", "toddle"), "", " in tiny steps"),
    "weave": (
        ("weave", "wend", "thread"),
        r" (?:his|her|their|its) way\b(?! (?:through|between|around|past|among|in and out))",
        "",
    ),
    "power-walk": (("power-walk", "powerwalk", "speed-walk", "racewalk", "race-walk"), "", " quickly"),
}
"""Verbs of a way, the words behind them that belong to them, and what stands behind "walks" in their place."""
_NOUN = r"(?<!\ba )(?<!\ban )(?<!\bthe )(?<!\bhis )(?<!\bher )(?<!-)"
_FREEZES = re.compile(
    r"^(?P<who>\W*(?:(?:a|an|the|my)\ (?:[\w-]+\ ){1,3}|(?:he|she|they|suddenly)\ )?)freez(?:e(?P<s>s)?|(?P<ing>ing))\b"
    r"(?!\ (?:to|the|his|her|a|water|food|solid|up)\b)",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that stops moving, of which the readers make one who is cold."""
_SITS = re.compile(
    r"""(?P<noun>\b(?:a|the)\ )?
    \b(?:plonk|plop|plunk|plump|flop|flump|slump|sink|drop|collapse|throw|lower|ease|fling|settle)
    (?P<end>e?s|p?ing|p?ed)?(?:\ (?:him|her|it|them)sel(?:f|ves))?(?:\ (?P<how>\w+ly))?(?:\ (?:back|down))*
    \ (?P<where>(?:on|onto|in|into)(?:\ to)?\ (?:(?:a|an|the|his|her|their|its)\ )?(?:[\w-]+\ )?
    (?:chair|sofa|couch|armchair|stool|bench|seat|settee|throne))\b""",
    re.IGNORECASE | re.VERBOSE,
)
"""A body that sits down in a way of its own, of which the readers make two movements, or a fall."""
_FREEZES_THEN = re.compile(
    r"(?P<joint>(?:[,;.]|\band|\bthen|\bhe|\bshe) )freeze(?P<s>s)?(?: in place)?(?=\s*(?:[,;.]|$|and\b|then\b))",
    re.IGNORECASE,
)
"""The same behind another movement."""
_COLD = re.compile(
    r"\b(?:cold|freezing|snow\w*|ic[ey]\w*|winter\w*|arctic|blizzard|frost\w*|shiver\w*|trembl\w*|teeth|death)\b",
    re.IGNORECASE,
)
"""Words of who is cold, not still."""


def with_known_verbs(prompt: str) -> str:
    """Return a prompt in which verbs that no reader knows are told by those of the vocabulary, in the same form."""
    for verb, pattern in _patterns().items():
        behind = _WAYS[verb][2]
        prompt = pattern.sub(lambda found, behind=behind: f"{_forms()[found['verb'].lower()]}{behind}", prompt)
    prompt = _SITS.sub(_sits, prompt)
    if _COLD.search(_FREEZES.sub("", prompt)):
        return prompt
    return _FREEZES.sub(lambda it: f"{it['who']}stand{'ing' if it['ing'] else (it['s'] or '').lower()} still", prompt)


def with_sudden_stops(prompt: str) -> str:
    """Return a prompt in which a body that freezes behind another movement stands still, unless someone is cold."""
    if _COLD.search(prompt):
        return prompt
    return _FREEZES_THEN.sub(lambda it: f"{it['joint']}stand{(it['s'] or '').lower()} still", prompt)


def _sits(found: re.Match[str]) -> str:
    """Return a body that sits down on the same seat; a noun, such as "a drop onto the bench", as it is."""
    if found["noun"]:
        return found[0]
    sits = in_present_form_of(found["end"] or "", "sit")
    how = f" {found['how']}" if found["how"] else ""
    return f"{sits} down{how} {found['where']}"


@lru_cache(maxsize=1)
def _patterns() -> Mapping[str, re.Pattern[str]]:
    """Return the pattern of the forms of each way, and of the words that belong to it."""
    found = dict[str, re.Pattern[str]]()
    for name, (verbs, words, _) in _WAYS.items():
        forms = sorted({form for verb in verbs for form in verb_forms(verb)}, key=len, reverse=True)
        found[name] = re.compile(rf"{_NOUN}\b(?P<verb>{'|'.join(map(re.escape, forms))})\b{words}", re.IGNORECASE)
    return found


@lru_cache(maxsize=1)
def _forms() -> Mapping[str, str]:
    """Return the form of "walk" for each form of the verbs."""
    found = dict[str, str]()
    for verbs, _, _ in _WAYS.values():
        for verb in verbs:
            found |= forms_of_other(verb, _WALK)
    return found
