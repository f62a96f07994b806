"""English for captions: verb forms, articles, numbers in words."""

from __future__ import annotations

import re

_DOUBLE = {
    "run",
    "jog",
    "step",
    "put",
    "let",
    "spin",
    "cut",
    "jab",
    "drag",
    "hop",
    "stop",
    "slip",
    "nod",
    "trot",
    "plod",
    "get",
    "dip",
    "drop",
    "hit",
    "flap",
    "bid",
    "begin",
    "leg",
    "wag",
    "set",
    "strut",
    "slog",
    "skip",
}
_IRREGULAR = {"be": "is", "have": "has"}
_WORDS = ["zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
_VERB = re.compile(r"<([a-z]+)>")
_HIS = re.compile(r"\b(he|man|guy|boy|gentleman|grandfather|fellow|schoolboy|sportsman)\b")
_HER = re.compile(r"\b(she|woman|lady|girl|grandmother|schoolgirl|sportswoman)\b")


def third(verb: str) -> str:
    """Form the third person: `walk` to `walks`, `push` to `pushes`, `carry` to `carries`."""
    if verb in _IRREGULAR:
        return _IRREGULAR[verb]
    if re.search(r"(s|sh|ch|x|z|o)$", verb):
        return verb + "es"
    if re.search(r"[^aeiou]y$", verb):
        return verb[:-1] + "ies"
    return verb + "s"


def gerund(verb: str) -> str:
    """Form the gerund: `walk` to `walking`, `run` to `running`, `wave` to `waving`."""
    if verb in _DOUBLE:
        return verb + verb[-1] + "ing"
    if verb.endswith("e") and not verb.endswith(("ee", "oe", "ye", "be")):
        return verb[:-1] + "ing"
    return verb + "ing"


def conjugate(phrase: str, form: str) -> str:
    """Put each <verb> of a phrase into a form: `third` (walks), `gerund` (walking) or `base` (walk)."""
    how = {"third": third, "gerund": gerund, "base": str}[form]
    return _VERB.sub(lambda match: how(match.group(1)), phrase)


def number(value: float, *, words: bool) -> str:
    """Format a whole number, with `words` in words up to twelve."""
    whole = round(value)
    return _WORDS[whole] if words and 0 <= whole < len(_WORDS) else str(whole)


def possessive(subject: str) -> str:
    """Possessive of a subject: `his`, `her` or `their`."""
    return "his" if _HIS.search(subject) else "her" if _HER.search(subject) else "their"


def mentioned_again(owner: str) -> str:
    """Pronoun for the owner of a `possessive`: `he`, `she` or `the person`."""
    return {"his": "he", "her": "she"}.get(owner, "the person")


def with_adjective(subject: str, adjective: str) -> str:
    """Insert an adjective: `a person`, `old` to `an old person`; not for pronouns and indefinite subjects."""
    match = re.fullmatch(r"(a|an|the) (.+)", subject)
    if not match or not adjective:
        return subject
    article = "the" if match[1] == "the" else "an" if adjective[0] in "aeiou" else "a"
    return f"{article} {adjective} {match[2]}"


def sentence(text: str) -> str:
    """Format a sentence: capital letter, single spaces, one full stop."""
    text = re.sub(r"\s+", " ", text).strip().rstrip(".")
    text = re.sub(r"\s+,", ",", text)
    return text[:1].upper() + text[1:] + "."
