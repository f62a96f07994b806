"""The pace at which a prompt asks for its action: "slowly", "in the blink of an eye", "at half speed". The words are in
`paces.toml`."""

from __future__ import annotations

import re
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

Pace = Literal["slow", "fast", ""]

_FILE = Path(__file__).with_name("paces.toml")
_PERSON = r"(?: (?:him|her|them|it|me|you|us))?"
_ARTICLE = r"(?: (?:a|an|the|his|her|their|its|my|your|our))?"
_DENIED = re.compile(r"(?:\bnot|n[’']t|\bnever)(?: (?:too|so|very|at all|that|be|do|go))* $")
_OF_THING = re.compile(r"\b(?:the|a|an|this|that) $")
_SHARE = re.compile(
    r"(?P<times>\d+(?:[.,]\d+)?) ?(?:x|×|times) (?:the )?(?:normal |usual |real )?(?:speed|pace|tempo)\b"
    r"|(?P<number>\d{1,3}) ?(?:%|percent|per cent) (?:of )?(?:the |its |his |her )?"
    r"(?:normal|usual|speed|pace|tempo|original)\b"
    r"|(?P<share>0[.,]\d+) ?(?:x )?(?:speed|pace|tempo)\b"
)
_LONG = re.compile(r"\bsl(o)\1{2,}w(?:ly)?\b|\bslo+w{2,}(?:ly)?\b")


def stated_pace(prompt: str) -> Pace:
    """Return the pace at which a prompt asks for its action; empty if it does not say, or says both.

    Args:
        prompt: of one action, as a user typed it.
    """
    text = " ".join(_LONG.sub("slow", prompt.lower().replace("’", "'")).split())
    found = set[Pace]()
    for pace, pattern in _patterns():
        for match in pattern.finditer(text):
            before = text[: match.start()]
            adverb = match["adverb"] is not None
            if adverb and match[0].endswith("ly") and (_OF_THING.search(before) or text[match.end() :].startswith("-")):
                continue  # "the slowly rising sun"
            found.add(_opposite(pace) if _DENIED.search(before) else pace)
    for match in _SHARE.finditer(text):
        value = float((match["times"] or match["share"] or match["number"]).replace(",", "."))
        share = value / 100 if match["number"] else value
        if share != 1:
            found.add("fast" if share > 1 else "slow")
    return found.pop() if len(found) == 1 else ""


def _opposite(pace: Pace) -> Pace:
    return "fast" if pace == "slow" else "slow"


@lru_cache(maxsize=1)
def _patterns() -> tuple[tuple[Pace, re.Pattern[str]], ...]:
    """Return the pattern of each pace; of its groups, the one that is not empty says how the words were found."""
    table: dict[str, Any] = tomllib.loads(_FILE.read_text("utf-8"))
    things, nouns = ("|".join(table[name].split()) for name in ("things", "nouns"))
    found = list[tuple[Pace, re.Pattern[str]]]()
    for pace in ("slow", "fast"):
        words: dict[str, Any] = table[pace]
        adjectives, weak, adverbs = (_any_of(words[name].split()) for name in ("adjectives", "weak", "adverbs"))
        phrases = "|".join(map(_phrase, sorted(words["phrases"], key=len, reverse=True)))
        near = rf"(?: (?:and )?\w+){{0,1}} (?:{nouns})\b"
        parts = (
            rf"(?P<phrase>{phrases})",
            rf"(?P<weak>{weak})[ -](?:{nouns})",
            rf"(?P<adverb>{adverbs})",
            rf"(?P<adjective>{adjectives})(?:(?={near})|(?![ -](?:\w+ )?(?:{things})\b))",
        )
        found.append((pace, re.compile(rf"(?<![\w-])(?:{'|'.join(parts)})(?![\w])")))
    return tuple(found)


def _any_of(words: list[str]) -> str:
    return "|".join(map(re.escape, sorted(words, key=len, reverse=True)))


def _phrase(words: str) -> str:
    return re.escape(words).replace(r"\ \[him\]", _PERSON).replace(r"\ \[a\]", _ARTICLE).replace(r"\ ", "[ -]")
