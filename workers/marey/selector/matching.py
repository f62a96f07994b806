"""Match of a motion with the actions of a prompt, in their order."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from marey.quality.record import SHOWN
from marey.selector.gaits import on_the_spot, turn_standing
from marey.selector.motion import SHORTEST, Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import EXACT, RULES, TURNS, WHILE_TURNING, Rule
from marey.vocabulary.counts import STEPPING, is_single_step, stated_count
from marey.vocabulary.courses import WAYS
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.legs import stated_leg
from marey.vocabulary.scope import every_action, match_scope
from marey.vocabulary.turns import stated_turn, turns_in_place

LEAST_PART = 0.5
"""Seconds that each action of several needs."""
CUTS = {2: 14, 3: 9}
"""Moments that are tried as ends of an action, by the number of actions; of more actions 7."""
FEWEST_CUTS = 7

NOT_AS_OFTEN = 0.4
"""Best value of a motion with another number of repetitions than was asked for."""
WALKED = frozenset({"walk-backward", "sidestep"})
"""Ways of steps that do not go ahead."""
ON_THE_SPOT, TURNING = "turn-around", "turn"
"""A way (`WAYS`) and a turn to one side in one sentence are a turn on the way: "walks and turns left 90 degrees"."""
SEVERAL: Mapping[str, int] = {"clap": 3, "jumping-jacks": 2, "nod": 2, "wave": 2, **dict.fromkeys(STEPPING, 4)}
"""Repetitions that the definition of an action asks for; a prompt may ask for fewer."""

_SIDES = {"left": "left", "right": "right", "both": "both", "clockwise": "right", "counterclockwise": "left"}
_WORDS = re.compile(r"[a-z]+")
_BENDS = re.compile(
    r"\b(?:curv(?:e|es|ing|ed)|veer(?:s|ing|ed)?|arc(?:s|ing)?|swerv(?:e|es|ing)|circl(?:e|es|ing)|loops?)\b"
)
"""Words of a way that is not straight."""
_SPOT = re.compile(r"\b(?:in place|on the spot|on one spot|on a treadmill)\b")
_REASON = re.compile(
    r"\b(?:because|since (?:the|his|her|its|their)|as (?:the|his|her|its|their) (?:left|right|other)"
    r"|due to|so as|to (?:spare|protect|rest) )\b.*",
    re.DOTALL,
)
"""Words of why something is done, which may name the other side."""
_STEPS_OF_WAY = re.compile(
    r"\b(?:back(?:wards?)?|sideways|left|right),? (?:for |by )?(?:\w+ ){1,2}(?:steps|paces|strides)\b"
)
_GOES = re.compile(r"\b(?:walk|step|go|mov|pac|strid|march|strafe|head)(?:e?s|ing|e|es)?\b(?<!\bsteps)(?<!\bpaces)")
"""Words of a number of steps of a way back or to a side, and verbs of ways."""
_LETTER = re.compile(r"\b([lr])[ -](?:hand|arm|fist|palm|elbow|leg|foot|knee)\b")


@dataclass(frozen=True)
class WantedAction:
    """An action that a motion should show.

    Attributes:
        action: id in the vocabulary, one that `RULES` has.
        side: `left`, `right`, `both`, or empty: any.
        degrees: of an action of `EXACT`, where the words say how far; None: as in its definition.
        count: how often, of an action that `REPETITIONS` has; None: any number.
        in_place: of a turn whose words speak of no way: one on the spot shows it, too; of a gait that is to stay there.
        winds: of a gait whose words speak of a way that is not straight.
    """

    action: str
    side: str = ""
    degrees: float | None = None
    count: int | None = None
    in_place: bool = False
    winds: bool = False


Step = tuple[WantedAction, ...]
"""Actions of one stretch of time."""
ONCE = frozenset({"die", "lie", "lie-down", "get-up"})
"""Actions that cannot be done again where they end: "he slips and falls" is one fall."""
PARTS: Mapping[str, frozenset[str]] = {
    "jump-turn": frozenset({"turn", "turn-around", "spin"}),
    "draw-bow": frozenset({"aim"}),
}
"""Actions that are part of one: "jumps and turns around", "draws the bow, aims and shoots an arrow"."""


def wanted_of(sentences: Iterable[str]) -> tuple[Step, ...] | None:
    """Return the actions of a prompt in their order.

    Args:
        sentences: the prompt's actions in the order of time, each as a sentence (`TextFeatures.acts`), or the whole
            prompt as one.

    Returns:
        One step a sentence, none for a sentence that names only what is not done; None if a sentence names no action,
        or one that has no rule. Sentences behind each other that name one action of `ONCE` are one step, and so is an
        action with its `PARTS` behind it, and what is told of it behind these.
    """
    steps = [step for step in map(_step, sentences) if step != ()]
    found = tuple(step for step in steps if step is not None)
    if not found or len(found) < len(steps):
        return None
    kept, partly = list[Step](), False
    for step in found:
        told = bool(kept) and (_is_told(kept[-1], step) or (partly and step == kept[-1]))
        partly = told and step != kept[-1]
        if not told:
            kept.append(step)
    return tuple(kept)


def _is_told(before: Step, step: Step) -> bool:
    """Return True if a step tells again what the one before it tells."""
    again = step == before and all(each.action in ONCE for each in step)
    parts = frozenset[str]().union(*(PARTS.get(each.action, frozenset()) for each in before))
    return again or all(each.action in parts for each in step)


def wanted_by_meaning(scope: Mapping[str, Any] | None) -> tuple[Step, ...] | None:
    """Return the action that the sentence encoder reads in a prompt whose words name none.

    Args:
        scope: the prompt's record (`Scope.as_json`), by the text stage.

    Returns:
        One step; None if words decided the scope, the prompt negates, or the action has no rule.
    """
    if scope is None or scope["by"] != "encoder" or "negation" in scope["flags"] or len(scope["actions"]) != 1:
        return None
    name = scope["actions"][0].get("action")
    return ((WantedAction(name),),) if name in RULES else None


def _step(sentence: str) -> Step | None:
    scope = match_scope(sentence, every_action())
    if "negation" in scope.flags and "no-action" in scope.flags:
        return ()
    named = [each.action for each in scope.actions if each.verdict == "known" and each.action in RULES]
    names = list(dict.fromkeys(name for name in named if name is not None))
    first = load_vocabulary().said_first(sentence)
    if first is not None and first in RULES:
        names = [first]
    actions = load_vocabulary().actions
    beside = {other for name in names for other in (*actions[name].implies, actions[name].kind_of)}
    if len(names) > 1:
        beside.add("idle")
    if WALKED & set(names) and _STEPS_OF_WAY.search(sentence.lower()) and len(_GOES.findall(sentence.lower())) < 2:
        beside.add("walk")  # whose noun the steps are
    wanted = [name for name in names if name not in beside] or names
    prompt = sentence if first is None else sentence[len(actions[first].plain_words) :]  # "bows, bows" asks for one bow
    side = side_of(prompt)
    if ON_THE_SPOT in wanted and any(name in WAYS for name in wanted) and side in ("left", "right"):
        wanted = [TURNING]
    counted = wanted[0] if len(wanted) == 1 and wanted[0] in REPETITIONS else None
    return (
        tuple(
            WantedAction(
                name,
                (stated_leg(prompt, name) or side) if actions[name].sided else "",
                degrees=_degrees(prompt, name),
                count=_count(prompt, name) if name == counted else None,
                in_place=_is_in_place(name, wanted, prompt),
                winds=name in WAYS and _BENDS.search(prompt.lower()) is not None,
            )
            for name in wanted
        )
        or None
    )


def _is_in_place(name: str, wanted: Sequence[str], prompt: str) -> bool:
    """Return True for a turn on the spot, and a gait whose words say that it does not travel."""
    if name in WAYS:
        return _SPOT.search(prompt.lower()) is not None
    return name == TURNING and wanted == [TURNING] and turns_in_place(prompt)


def _degrees(sentence: str, action: str) -> float | None:
    stated = stated_turn(sentence, action) if action in EXACT else None
    return stated.most if stated is not None and stated.is_exact else None


def side_of(sentence: str) -> str:
    """Return the side that a sentence names (`left`, `right`, `both`); empty if it names none, or several. A reason
    says nothing of it: "hops on the right foot because the left one hurts"."""
    text = _REASON.sub("", sentence.lower())
    sides = {_SIDES[word] for word in _WORDS.findall(text) if word in _SIDES}
    sides |= {{"l": "left", "r": "right"}[match[1]] for match in _LETTER.finditer(text)}
    return sides.pop() if len(sides) == 1 else ""


def match(motion: Motion, steps: Sequence[Step]) -> float:
    """Return how well a motion shows actions in their order, 0 to 1; from `SHOWN` (`marey.quality.record`) on it shows
    them.

    Args:
        motion: the joints.
        steps: as `wanted_of` returns them, at least one.
    """
    return round(_in_order(motion, [lambda part, step=step: _grade(part, step) for step in steps]), 3)


def _grade(motion: Motion, step: Step) -> float:
    """Grade the actions of a step: at one time, or one after the other as they are named."""
    turning = any(wanted.action in TURNS for wanted in step)
    rules_at_once = {**RULES, **WHILE_TURNING} if turning else RULES
    together = min(_rule(wanted, rules_at_once)(motion, wanted.side) for wanted in step)
    if len(step) == 1:
        return together
    rules: list[Callable[[Motion], float]] = [
        lambda part, wanted=wanted: _rule(wanted, RULES)(part, wanted.side) for wanted in step
    ]
    return max(together, _in_order(motion, rules))


def _rule(wanted: WantedAction, rules: Mapping[str, Rule]) -> Rule:
    rules = {**rules, **WHILE_TURNING} if wanted.winds else rules
    rule = rules[wanted.action] if wanted.degrees is None else EXACT[wanted.action](wanted.degrees)
    if wanted.in_place and wanted.action in WAYS:
        return lambda m, side: max(rule(m, side), on_the_spot(m, runs=wanted.action != "walk"))
    if wanted.in_place:
        on_way, on_spot = rule, turn_standing if wanted.degrees is None else EXACT[ON_THE_SPOT](wanted.degrees)
        return lambda m, side: max(on_way(m, side), on_spot(m, side))
    return rule if wanted.count is None else _counted(rule, wanted.action, wanted.count)


def _counted(rule: Rule, action: str, count: int) -> Rule:
    """Return a rule that passes no motion with another number of repetitions, and those with the number even where the
    definition of the action asks for more of them."""

    def grade(m: Motion, side: str) -> float:
        found = rule(m, side)
        often = len(REPETITIONS[action](m))
        closes = count == 1 and often == 2 and action in STEPPING  # the other foot comes beside the one that steps
        if often != count and not closes:
            return min(found, NOT_AS_OFTEN)
        return max(found, SHOWN) if count < SEVERAL.get(action, 0) else found

    return grade


def _count(prompt: str, action: str) -> int | None:
    """Return how often a prompt asks for an action; of "steps back" it is one step."""
    count = stated_count(prompt, action)
    return 1 if count is None and action in STEPPING and is_single_step(prompt) else count


def _in_order(motion: Motion, rules: Sequence[Callable[[Motion], float]]) -> float:
    """Return the best smallest grade over all ways to cut a motion into one part a rule, in their order."""
    if len(rules) == 1:
        return rules[0](motion)
    ends = _cuts(motion, len(rules))
    if not ends:
        return 0.0
    reached = {end: rules[0](motion.part(0, end)) for end in ends}
    for rule in rules[1:-1]:
        reached = {
            end: max(
                (min(grade, rule(motion.part(begin, end))) for begin, grade in _worth(reached, end, motion)),
                default=0.0,
            )
            for end in ends
        }
    best = 0.0
    for begin, grade in sorted(reached.items(), key=lambda each: -each[1]):
        if grade <= best:
            break
        best = max(best, min(grade, rules[-1](motion.part(begin, motion.frames))))
    return best


def _worth(reached: dict[int, float], end: int, motion: Motion) -> list[tuple[int, float]]:
    """Return the beginnings from which a part up to an end is long enough, with their grades, where these are not 0."""
    return [(begin, grade) for begin, grade in reached.items() if grade > 0 and end - begin >= _least(motion)]


def _least(motion: Motion) -> int:
    return max(round(LEAST_PART * motion.fps), SHORTEST)


def _cuts(motion: Motion, parts: int) -> list[int]:
    """Return the frames at which a part may end; none if the motion is too short for its parts."""
    least, frames = _least(motion), motion.frames
    if frames < parts * least:
        return []
    count = min(CUTS.get(parts, FEWEST_CUTS), frames - 2 * least + 1)
    room = frames - 2 * least
    return sorted({least + round(k * room / max(count - 1, 1)) for k in range(count)})
