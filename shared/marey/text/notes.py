"""Notes of an animator, told as what is done (ours): postures that lead to each other ("prone to crouch to stand"), who
"returns", who poses on a way, gets out of bed, and what a gesture is for."""

from __future__ import annotations

import re
from itertools import pairwise

from marey.vocabulary.inflection import in_form_of, third_person

_POSTURES = {
    "prone": "lie prone",
    "supine": "lie on the back",
    "lying": "lie",
    "lie": "lie",
    "laying": "lie",
    "crouch": "crouch",
    "crouching": "crouch",
    "crouched": "crouch",
    "squat": "crouch",
    "kneel": "kneel",
    "kneeling": "kneel",
    "sit": "sit",
    "sitting": "sit",
    "seated": "sit",
    "stand": "stand",
    "standing": "stand",
}
"""How a body is in a posture, by the words of a note."""
_COMES = {"lie": "lies down", "crouch": "crouches", "kneel": "kneels down", "sit": "sits down", "stand": "stands up"}
"""How it comes there, by the verb of the posture."""
_LOW = frozenset({"lie"})
"""Postures out of which a body that stands up gets up first."""
_NAME = rf"(?:{'|'.join(sorted(_POSTURES, key=len, reverse=True))})(?:\ position|\ pose)?"
_TO = r"\ ?(?:->|→|>|\bto\b|\binto\b)\ ?(?:an?\ )?"
_CHAIN = re.compile(rf"^\W*(?:from\ )?(?:an?\ )?(?P<chain>{_NAME}(?:{_TO}{_NAME})+)\W*$", re.IGNORECASE | re.VERBOSE)
_NEXT = re.compile(_TO, re.IGNORECASE | re.VERBOSE)
_GAITS = r"(?:walk|stroll|strut|strid|run|jog|march|sprint|catwalk|runway|parad|sashay)\w*"
_ON_A_WAY = re.compile(rf"\b{_GAITS}\b", re.IGNORECASE)
_POSES = re.compile(
    r"(?P<joint>,\ (?:and\ )?(?:then\ )?|\b(?:and|then)\ )(?:strikes?\ (?:a|some)\ poses?|pos(?:e(?P<s>s)?|ing))\b"
    r"(?!\ (?:as|like|for|in)\b)",
    re.IGNORECASE | re.VERBOSE,
)
"""A halt of who goes."""
_RETURNS = re.compile(
    r"\b(?P<turn>turn(?P<s>s)?)(?:\ (?:a)?(?:round|about))?(?P<joint>,\ (?:and\ )?(?:then\ )?|\ (?:and\ )?(?:then\ )?)"
    r"(?:returns?|(?:comes?|goe?s?|heads?)\ back)"
    r"(?=\W*$|[,.;]|\ (?:to\ (?:the\ (?:start|beginning)|where)|the\ same\ way)\b)",
    re.IGNORECASE | re.VERBOSE,
)
"""A turn, and a way back that no verb of a way tells."""
_OUT_OF_BED = re.compile(
    r"\b(?:roll|jump|leap|climb|crawl|spring|tumble|slide|hop)(?P<s>s|ing)?(?:\ (?:slowly|quickly|sleepily))?"
    r"\ out\ of\ (?:(?:his|her|their|the)\ )?bed\b",
    re.IGNORECASE | re.VERBOSE,
)
_PULLS_GUN = re.compile(
    r"\b(?:(?:pull|whip|take|yank)(?P<s>s|ing)?\ out|unholster(?P<s2>s|ing)?)"
    r"(?=\ (?:(?:a|an|the|his|her|their)\ )?(?:\w+\ )?(?:pistol|hand\ ?gun|gun|revolver|side\ ?arm|six[- ]?shooter)\b)",
    re.IGNORECASE | re.VERBOSE,
)
_PURPOSE = re.compile(
    r"(?P<before>\b(?:(?:eyes|brow|forehead|hands?)|salut\w+|wav(?:es?|ing)|nod(?:s|ding)?|bow(?:s|ing)?|curts\w+))"
    r"\ to\ (?:better\ )?(?:follow|watch|see|spot|track|look|gaze|peer|scan|search|greet|thank|acknowledge|honou?r)\b"
    r"(?:\ (?!(?:and|then|before|while)\b)[\w'-]+){0,5}?(?=\W*$|[,.;]|\ (?:and|then|before|while)\b)",
    re.IGNORECASE | re.VERBOSE,
)
"""The end to which a gesture is made."""


_SKIDS = re.compile(
    r"(?P<way>\b(?:run|sprint|jog|dash|race|charge)(?:s|es|ning|ing)?\b[^.;,]*?)(?:,?\ and\ then|,?\ then|,?\ and|,)\ "
    r"(?:(?:he|she|they)\ )?(?:slide|skid)(?P<s>s)?"
    r"(?P<to>\ (?:in)?to\ (?:a|an)\ (?:\w+\ )?(?:halt|stop|standstill))(?=\W*$)",
    re.IGNORECASE | re.VERBOSE,
)
"""A run that ends in a skid, which is part of it."""


def with_notes_told(prompt: str) -> str:
    """Return a prompt in which such notes are told as what is done."""
    chain = _CHAIN.match(prompt)
    if chain is not None:
        return _chain_told(chain["chain"])
    text = _PURPOSE.sub(r"\g<before>", prompt)
    text = _PULLS_GUN.sub(lambda it: in_form_of(it["s"] or it["s2"] or "", "draw"), text)
    text = _OUT_OF_BED.sub(lambda it: f"{in_form_of(it['s'] or '', 'get')} out of bed", text)
    text = _SKIDS.sub(lambda it: f"{it['way']} and slide{it['s'] or ''}{it['to']}", text)
    if _ON_A_WAY.search(text):
        text = _POSES.sub(_stops, text)
        text = _RETURNS.sub(lambda it: f"{it['turn']} around{it['joint']}walk{it['s'] or ''} back", text)
    return text


def _stops(found: re.Match[str]) -> str:
    """Return a halt behind a way, in the form of the verb that is found."""
    third = found["s"] is not None or "strikes" in found[0].lower()
    return f", then stop{'s' if third else ''}"


def _chain_told(chain: str) -> str:
    """Return postures as what a body does to come from one to the next."""
    names = [re.sub(r"\ (?:position|pose)$", "", part.strip().lower()) for part in _NEXT.split(chain)]
    verbs = [_POSTURES[name].split()[0] for name in names]
    told = [third_person(verbs[0]) + _POSTURES[names[0]][len(verbs[0]) :]]
    for (before, verb), name in zip(pairwise(verbs), names[1:], strict=True):
        comes = {"stand": "gets up", "sit": "sits upright"}.get(verb, "") if before in _LOW else ""
        comes = comes or _COMES[verb]
        told.append(comes + (_POSTURES[name][len(verb) :] if verb in _LOW else ""))
    return told[1] if verbs[0] == "stand" and len(told) == 2 else ", then ".join(told)
