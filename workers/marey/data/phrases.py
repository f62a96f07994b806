"""Select phrases of an action, without those that have an unmeasured field or a false condition."""

from __future__ import annotations

import random
import re
from collections.abc import Sequence

from marey.data.describe import LOCOMOTION, Facts
from marey.data.english import number
from marey.data.grammar import grammar

_FIELD = re.compile(r"{(\w+)}")
PAIR = (  # phrases for both hands
    "two hands", "two arms", "the two hands", "the left and the right hand", "the left and the right arm",
    "both of the hands", "one hand and the other", "the hands on both sides",
)  # fmt: skip
MANNER_SHARE = 0.35
RIGHT_ANGLE = 16.0  # degrees about 90 within which a turn is called a right angle


def pace_of(facts: Facts) -> str | None:
    """Classify the pace as slow, medium or fast; None if the body does not travel."""
    slow, fast = {"run": (1.9, 3.2), "dash": (2.2, 3.4)}.get(facts.action, (0.75, 1.45))
    if facts.action not in LOCOMOTION or facts.gait.path < 0.8:
        return None
    return "slow" if facts.gait.speed < slow else "fast" if facts.gait.speed > fast else "medium"


def height_of(facts: Facts) -> str | None:
    """Height of the raised hand (the lower one of both)."""
    if facts.side not in ("left", "right", "both"):
        return None
    hands = [h for h, name in zip(facts.hands, ("left", "right"), strict=True) if facts.side in (name, "both")]
    head, peak = min(h.head for h in hands), min(h.peak for h in hands)
    if head > 0.12:
        return "above_head"
    if head > -0.1:
        return "head_high"
    return "shoulder_high" if -0.18 < peak < 0.1 else None


def lasting_of(facts: Facts) -> str | None:
    """Classify the duration of a gesture as short or long, or None."""
    if facts.action not in ("raise", "wave"):
        return None
    return "short" if facts.gait.duration < 3.5 else "long" if facts.gait.duration > 5.5 else None


def fields(facts: Facts, rng: random.Random, pronoun: str) -> dict[str, str]:
    """Values of the fields of phrases, without unmeasured ones."""
    words = rng.random() < 0.5
    out = {"seconds": number(facts.gait.duration, words=words)} if facts.gait.duration > 1.4 else {}
    if facts.action in LOCOMOTION:
        if facts.gait.path > 1.5:
            out["metres"] = number(facts.gait.path, words=words)
        if 2 <= facts.gait.steps <= 20:
            out["steps"] = number(facts.gait.steps, words=words)
        if facts.action == "turn":
            out["degrees"] = str(round(abs(facts.gait.turn) / 10) * 10)
            if abs(abs(facts.gait.turn) - 90) < RIGHT_ANGLE:
                out["right_angle"] = rng.choice(
                    ["a right angle", "90 degrees", "ninety degrees", "a quarter of a circle"]
                )
    if facts.side:
        hands = f"{facts.side} hands" if facts.side == "both" else f"{facts.side} hand"
        both = facts.side == "both"
        out |= {"side": facts.side, "it": "them" if both else "it", "is": "are" if both else "is"}
        out |= {"sided": "with both hands" if both else rng.choice([f"{facts.side}-handed", f"with the {facts.side}"])}
        out |= {"arms": hands.replace("hand", "arm"), "wrists": hands, "hands": hands}
        out |= {"hands_his": hands if facts.side == "both" else f"{pronoun} {hands}"}
        if both:
            out["pair"] = rng.choice(PAIR)
        else:
            out |= {"one": f"{facts.side} one", "one_side": facts.side}
            out["other"] = "right" if facts.side == "left" else "left"
        if facts.action == "wave":
            swings = max(h.swings for h in facts.hands) // 2
            if swings >= 2:
                out["count"] = number(swings, words=words)
    g = grammar()
    if pace := pace_of(facts):
        out["pace"] = rng.choice(g.pace[pace])
    if height := height_of(facts):
        out["height"] = rng.choice(g.height[height])
    if lasting := lasting_of(facts):
        out["lasting"] = rng.choice(g.lasting[lasting])
    return out


def fill(phrase: str, values: dict[str, str]) -> str | None:
    """Fill the fields of a phrase; None if one was not measured."""
    if any(name not in values for name in _FIELD.findall(phrase)):
        return None
    text = _FIELD.sub(lambda match: values[match.group(1)], phrase)
    return text.replace("the both ", "both ").replace("The both ", "Both ")


def details(facts: Facts) -> list[str]:
    """Names of the details that are true of the motion."""
    names = ["duration"]
    if facts.action in LOCOMOTION:
        names += ["travel", "steps"] + (["turn"] if facts.action == "turn" else [])
    if facts.action in ("wave", "raise", "guide"):
        if height := height_of(facts):
            names.append(height)
        others = [h for h, name in zip(facts.hands, ("left", "right"), strict=True) if name != facts.side]
        if facts.side != "both" and others and others[0].peak < -0.28:
            names.append("idle_arm")
        if facts.action == "wave":
            names.append("waves")
    if facts.action in ("wave", "raise", "guide", "bow", "call") and facts.gait.path < 0.1:
        names.append("in_place")
    if facts.action in ("bow", "call"):
        names.append("deep_lean" if facts.lean > 40 else "slight_lean" if facts.lean < 25 else "")
    elif facts.lean < 8:
        names.append("upright")
    return [name for name in names if name]


def filled(phrases: Sequence[str], values: dict[str, str], rng: random.Random) -> tuple[str, str]:
    """Draw a phrase whose fields were all measured; return it filled and as in the grammar."""
    found = filled_if_any(phrases, values, rng)
    assert found is not None, f"no phrase without fields among {phrases[:3]}"
    return found


def filled_if_any(phrases: Sequence[str], values: dict[str, str], rng: random.Random) -> tuple[str, str] | None:
    """Draw a phrase like `filled`; None if every phrase has an unmeasured field."""
    for phrase in rng.sample(phrases, len(phrases)):
        text = fill(phrase, values)
        if text is not None:
            return text, phrase
    return None


def phrase_of(facts: Facts, rng: random.Random, pronoun: str) -> str:
    """Draw and fill a verb phrase, with verbs in angle brackets; after a pace it ends in `and` (`with_adverb`)."""
    words = grammar().actions[facts.action]
    manners = words.manners.get(facts.style, ())
    values = fields(facts, rng, pronoun)
    if manners and rng.random() < MANNER_SHARE:
        return rng.choice(manners) + _repeated(facts, rng)
    said, phrase = filled(words.phrases, values, rng)
    text = said + _repeated(facts, rng)
    return text + " and" if phrase.endswith("{pace}") else text


def _repeated(facts: Facts, rng: random.Random) -> str:
    return _times(facts.repeats, rng) if facts.repeats > 1 else ""


def with_adverb(phrase: str, after: str) -> str:
    """Append an adverb to a phrase: `walks slowly and` gets `sadly`, or loses its `and`."""
    return f"{phrase} {after}".strip() if after else phrase.removesuffix(" and")


def _times(repeats: int, rng: random.Random) -> str:
    if rng.random() < 0.3:
        return rng.choice(["", " repeatedly", " again and again" if repeats > 2 else ""])
    return " twice" if repeats == 2 else f" {number(repeats, words=True)} times"
