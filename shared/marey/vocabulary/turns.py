"""How far a prompt asks a body to turn: "90 degrees", "a half turn", "in a circle", and, of walks and runs, not at all.
The words are in `turns.toml`."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

STRAIGHT = 15.0
"""Degrees by which a way that is not said to turn may turn."""
WHOLE = 360.0
LEAST_SCALE, MOST_SCALE = 0.75, 1.4
"""Bounds of the speed of a spin that becomes whole, in relation to the speed that it had."""
MOST = 1080
"""More degrees than these are not read."""

_FILE = Path(__file__).with_name("turns.toml")
_WORDS = re.compile(r"[a-z][a-z'-]*")
_DEGREES = re.compile(r"(?<![\d.,])(\d{2,4})(?:[ -]?(?:°|deg(?:ree)?s?\b))")
_BARE = re.compile(
    r"\b(?:turn|turns|turning|rotate|rotates|rotating|pivot|pivots|pivoting|spin|spins|spinning|jump|jumps|a|by|does|do|full)"
    r" (45|90|135|180|270|360|540|720)\b(?! ?(?:times|x\b|seconds?|s\b|frames|%|m\b|met))"
    r"|\b(45|90|135|180|270|360|540|720)[ -](?:turn|spin|pivot|rotation|jump|about)"
)
_CIRCLES = re.compile(r"\b(?:semi-?)?circles?\b|\bin a (?:ring|loop)\b|\barc\b")

_LIMBS = re.compile(
    r"\b(?:left|right)[ -](?:arm|hand|palm|fist|wrist|elbow|shoulder|leg|foot|knee|ankle|hip|ear|eye|thigh|shin)s?\b"
)
"""Words of sides that are no ways."""
_OWN = r"(?:(?:his|her|their|its|the|one's|both)\ )?"
_NO_TURN = re.compile(
    rf"""
    \b(?:at|with|in|keep\w*|hold\w*|maintain\w*|set\w*|pick\w*\ up|quicken\w*|slow\w*|same)\ (?:\w+\ ){{0,4}}?pace\b
    |\bpaced\b
    |\b(?:along|down|on|up|through|across|over|follow\w*)\ (?:an?|the|this|that)
        \ (?:(?!wind|curv|twist|circ|round|bend)[\w-]+\ ){{0,3}}?(?:path|trail|track)\b
    |\b(?:straight|upright|bent|stiff|stooped|hunched|curved|arched|rounded|tall|aching|sore|bad)\ back\b
    |\bback\ (?:is\ |held\ |kept\ )?(?:very\ )?(?:straight|upright|bent|stooped|hunched|tall|rounded|arched)\b
    |\b(?:his|her|their|its|the|one's)\ back\b
    |\b(?:lean|arch|hold|pull|throw|tilt|tip|roll)\w*\ (?:\w+\ ){{0,3}}?back\b
    |\bshoulders?\ (?:\w+\ )?(?:back|rounded)\b
    |\b(?:look|glanc|peer|star)\w*\ (?:\w+\ )?(?:back|around|about|round)\b
    |\bone\ (?:\w+\ ){{0,2}}(?:in\ front\ of|after|before|behind)\ the\ other\b
    |\bswing\w*\ {_OWN}(?:arms?|hips?|elbows?)\b
    |\b(?:arms?|hips?|hands?|elbows?)\ (?:\w+\ )?swing\w*\b
    |\bturn\w*\ {_OWN}head\b
    |\bin\ one\ direction\b
    """,
    re.VERBOSE,
)
"""Words that speak of a turn elsewhere: of a pace, a plain path, the back, the arms."""
_IN_PLACE = re.compile(
    r"\b(?:in place|on the spot|on (?:his|her|their|its|the|one) (?:heels?|spot)|pivot\w*|stationary|standing|stands?"
    r"|(?:where|as) (?:he|she|they|it) stands?|about[ -](?:face|turn))\b"
)
_GOES = re.compile(
    r"\b(?:walk|run|jog|sprint|march|strid|stroll|wander|sneak|tiptoe|rush|dash|skip|trot|step|continu|advanc|travel|limp"
    r"|stagger|crawl|jump|hop|danc|driv|rid(?:e|ing)|skat|approach|proceed|retreat|veer|curv|swerv|keep)\w*\b"
    r"|\b(?:go|goes|going|come|comes|coming|moves?|moving|heads?|heading|races?|racing|paces|pacing|rounds|rounding"
    r"|carr(?:y|ies|ying) on|corners?|circles?|arcs?|paths?|roads?|streets?|track|bend|along|crossing)\b"
)
"""Words of bodies that go somewhere, and of where they go."""


@dataclass(frozen=True)
class Turn:
    """How far a body should turn from the first frame to the last, to either side.

    Attributes:
        least, most: degrees, 0 or more.
        even: all along its way, as on a circle.
        whole: as many whole turns as are nearest; `least` and `most` are not looked at.
    """

    least: float = 0.0
    most: float = STRAIGHT
    even: bool = False
    whole: bool = False

    @property
    def is_exact(self) -> bool:
        """True if words say how far."""
        return self.least == self.most and not self.whole

    def of(self, made: float) -> float:
        """Return the degrees, 0 or more, for a motion that turns by `made`."""
        size = abs(made)
        if self.whole:
            nearest = max(round(size / WHOLE), 1) * WHOLE
            return nearest if LEAST_SCALE <= nearest / max(size, 1.0) <= MOST_SCALE else size
        return min(max(size, self.least), self.most)


def stated_turn(prompt: str, action: str) -> Turn | None:
    """Return how far a prompt asks its action to turn; None = as it comes.

    Args:
        prompt: of one action, as a user typed it.
        action: its id.
    """
    table = _table()
    text = _plain(prompt)
    is_way, usual = action in table.ways, table.usual.get(action)
    if action == "spin":
        return Turn(whole=True)
    if not is_way and usual is None:
        return None
    found = set(table.angles(text))
    if (
        is_way
        and not found
        and not table.turning.intersection(_WORDS.findall(_NO_TURN.sub(" ", _LIMBS.sub(" ", text))))
    ):
        return Turn()
    if len(found) > 1:
        return None
    even = action != "turn-around" and action != "jump-turn" and _CIRCLES.search(text) is not None
    if found:
        angle = found.pop()
        return Turn(angle, angle, even)
    if not usual:
        return None
    low, high = table.extent(text, usual)
    return Turn(low, high, even)


def turns_in_place(prompt: str) -> bool:
    """Return True if a prompt of a turn speaks of no way on which the body turns: "turns left", "pivots in place".

    Args:
        prompt: as a user typed it.
    """
    text = _plain(prompt)
    return _IN_PLACE.search(text) is not None or _GOES.search(text) is None


def stated_spins(prompt: str) -> int | None:
    """Return how many whole turns a prompt asks for by an angle: two of "spins 720 degrees"; None = it names none."""
    found = set(_table().angles(_plain(prompt)))
    angle = found.pop() if len(found) == 1 else 0.0
    return int(angle // WHOLE) if angle and angle % WHOLE == 0 else None


@dataclass(frozen=True)
class _Table:
    """Contents of `turns.toml`."""

    usual: dict[str, tuple[float, ...]]
    ways: frozenset[str]
    turning: frozenset[str]
    phrases: tuple[tuple[float, re.Pattern[str]], ...]
    extents: tuple[tuple[tuple[float, float], re.Pattern[str]], ...]
    round: re.Pattern[str]

    def angles(self, text: str) -> Iterator[float]:
        """Yield the degrees that a text names."""
        numbers = [match[1] for match in _DEGREES.finditer(text)]
        numbers += [match[1] or match[2] for match in _BARE.finditer(text)]
        yield from (float(number) for number in numbers if 0 < int(number) <= MOST)
        if not numbers:
            named = [angle for angle, pattern in self.phrases if pattern.search(text)]
            yield from named or ([WHOLE] if self.round.search(text) else [])

    def extent(self, text: str, usual: tuple[float, ...]) -> tuple[float, ...]:
        """Return the degrees of a turn whose words name none, by the first extent that they speak of."""
        return next((degrees for degrees, pattern in self.extents if pattern.search(text)), usual)


@lru_cache(maxsize=1)
def _table() -> _Table:
    table: dict[str, Any] = tomllib.loads(_FILE.read_text("utf-8"))
    return _Table(
        usual={action: tuple(map(float, bounds)) for action, bounds in table["actions"].items()},
        ways=frozenset(table["ways"]["actions"].split()),
        turning=frozenset(table["ways"]["turning"].split()),
        phrases=tuple((float(angle), _any_of(phrases)) for angle, phrases in table["degrees"].items()),
        extents=tuple((tuple(each["degrees"]), _any_of(each["phrases"])) for each in table["extents"].values()),
        round=_any_of(table["round"]["phrases"]),
    )


def _plain(prompt: str) -> str:
    return " ".join(prompt.lower().replace("’", "'").split())


def _any_of(phrases: list[str]) -> re.Pattern[str]:
    words = "|".join(re.escape(phrase).replace(r"\ ", "[ -]") for phrase in sorted(phrases, key=len, reverse=True))
    return re.compile(rf"(?<![\w-])(?:{words})(?![\w])")
