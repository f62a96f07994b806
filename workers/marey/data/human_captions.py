"""Human captions: `human_captions.toml`, by three authors without access to the grammar or any prompt.

The grammar joins a subject, a verb phrase and an adverb. People also write "Before waving, she walks up to the fence"
or "left arm up, then the right": a model trained without such sentences followed 78 % of another author's prompts, and
95 % of those by the grammar's author.
"""

from __future__ import annotations

import random
import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from marey.data.describe import LOCOMOTION, Facts
from marey.data.english import conjugate, mentioned_again, possessive
from marey.data.grammar import grammar
from marey.data.phrases import fields, fill, filled_if_any, phrase_of, with_adverb

STYLED_SHARE = 0.5
OWN_SHARE = 0.5  # share of the sequences with captions of their own
_ACT = re.compile(r"{([abc])(?:_(ing|base|noun))?}")
_FORMS = {None: "third", "ing": "gerund", "base": "base"}


@dataclass(frozen=True)
class HumanCaptions:
    """Content of `human_captions.toml`.

    Attributes:
        actions: captions by action, or by action with `_one` or `_both` hands.
        same: captions by action, for one side after the other.
        pairs: captions by `first-second`.
        two, stop, three: frames for any actions; `stop` for an action in place after travel.
    """

    actions: dict[str, tuple[str, ...]]
    same: dict[str, tuple[str, ...]]
    pairs: dict[str, tuple[str, ...]]
    two: tuple[str, ...]
    stop: tuple[str, ...]
    three: tuple[str, ...]


@lru_cache(maxsize=1)
def human_captions() -> HumanCaptions:
    """Load the captions of the package."""
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name("human_captions.toml").read_text("utf-8"))
    actions, same, pairs = (
        {name: tuple(rows) for name, rows in table[key].items()} for key in ("acts", "same", "pairs")
    )
    frames = {name: tuple(rows) for name, rows in table["frames"].items()}
    return HumanCaptions(actions, same, pairs, **frames)


def human_caption(facts: Facts, rng: random.Random) -> str | None:
    """Draw a caption of one action, with its style as a sentence or an adverb; None if no author wrote one."""
    rows = human_captions().actions.get(_key(facts), ())
    text = _some(rows, fields(facts, rng, "the"), rng) if facts.repeats == 1 else None
    if text is None or rng.random() > STYLED_SHARE:
        return text
    style = grammar().styles[facts.style]
    if text.endswith(".") and rng.random() < 0.5:
        return f"{text} {rng.choice(style.sentence)}"
    return _styled(text, rng.choice(style.after))


def human_sequence(parts: Sequence[Facts], rng: random.Random) -> str | None:
    """Draw a caption of two or three actions; it may mention them in another order than they happen."""
    own = _own(parts, rng) if len(parts) == 2 and rng.random() < OWN_SHARE else None
    text = own or _framed(parts, rng)
    style = grammar().styles[parts[0].style]
    if text is None or len({facts.style for facts in parts}) > 1 or rng.random() > STYLED_SHARE:
        return text
    return _styled(text, rng.choice(style.after))


def _key(facts: Facts) -> str:
    sided = {"left": "_one", "right": "_one", "both": "_both"}.get(facts.side, "")
    return facts.action + sided if facts.action in ("raise", "wave") else facts.action


def _own(parts: Sequence[Facts], rng: random.Random) -> str | None:
    """Draw a caption for this pair of actions, or None."""
    first, second = parts
    values = {f"{name}_side": facts.side for name, facts in zip("ab", parts, strict=True) if facts.side}
    if first.action == second.action:
        one_each = {first.side, second.side} == {"left", "right"}
        return _some(human_captions().same.get(first.action, ()), values, rng) if one_each else None
    for facts in parts:  # a turn and a hand have separate fields
        if facts.action == "turn":
            values["side"] = facts.side
        elif facts.side:
            values |= {name: _limbs(facts.side, name) for name in ("hands", "arms")}
    return _some(human_captions().pairs.get(f"{first.action}-{second.action}", ()), values, rng)


def _limbs(side: str, name: str) -> str:
    return f"both {name}" if side == "both" else f"the {side} {name[:-1]}"


def _framed(parts: Sequence[Facts], rng: random.Random) -> str | None:
    """Fill a frame with each action in the form that the frame requires."""
    stops = parts[0].action in LOCOMOTION and parts[1].action not in LOCOMOTION
    frames = (
        human_captions().three if len(parts) == 3 else human_captions().two + (human_captions().stop if stops else ())
    )
    frame = rng.choice(frames)
    who = rng.choice(grammar().subjects)
    values = {"who": who, "Who": who[:1].upper() + who[1:], "again": mentioned_again(possessive(who))}
    for name, form in _ACT.findall(frame):
        said = _said(parts["abc".index(name)], form, rng)
        if said is None:
            return None
        values[f"{name}_{form}" if form else name] = said
    text = fill(frame, values)
    return None if text is None else text[:1].upper() + text[1:] if text.endswith(".") else text


def _said(facts: Facts, form: str, rng: random.Random) -> str | None:
    """Express an action as a verb phrase, or as a noun with its article."""
    if form != "noun":
        return conjugate(with_adverb(phrase_of(facts, rng, "the"), ""), _FORMS[form or None])
    if facts.repeats > 1:
        return None
    nouns = [noun for noun in grammar().actions[facts.action].nouns if noun.startswith(("a ", "an "))]
    return _some(nouns, fields(facts, rng, "the"), rng)


def _styled(text: str, after: str) -> str:
    if not after:
        return text
    return f"{text[:-1]}, {after}." if text.endswith(".") else f"{text}, {after}"


def _some(rows: Sequence[str], values: dict[str, str], rng: random.Random) -> str | None:
    """Draw and fill a row whose fields are all known."""
    found = filled_if_any(rows, values, rng)
    return None if found is None else found[0]
