"""Actions that the words of a prompt have the body do beside what was read of it, and that its motion does not show.

A reader that takes one action for all of a prompt leaves out what else is said, and the rule of that action finds
nothing wrong. Each other verb of an action is looked for in the words, and its action graded by its own rule.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from marey.motion.skeleton import HUMANML3D, Skeleton
from marey.selector.motion import SHORTEST, Motion
from marey.selector.rules import RULES
from marey.vocabulary.bearing_words import BarePrompt
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.gazes import without_gaze
from marey.vocabulary.inflection import third_person, verb_forms
from marey.vocabulary.scope import every_action, match_scope

VERBS: Mapping[str, str] = {
    "jump": "jump",
    "hop": "hop",
    "kick": "kick",
    "punch": "punch",
    "wave": "wave",
    "clap": "clap",
    "bow": "bow",
    "kneel": "kneel",
    "sit-down": "sit",
    "squat": "squat",
    "crouch": "crouch",
    "crawl": "crawl",
    "spin": "spin",
    "roll": "roll",
    "cartwheel": "cartwheel",
    "throw": "throw",
    "die": "collapse",
    "lie-down": "lie",
    "flip": "backflip",
    "leap": "leap",
}
"""Verbs that name one action, whose rule tells for certain that it is not shown, by that action."""
ALIKE: tuple[frozenset[str], ...] = (
    frozenset({"spin", "turn", "turn-around", "jump-turn", "twist", "dance", "cartwheel", "flip"}),
    frozenset({"jump", "jump-forward", "hop", "leap", "flip", "jumping-jacks", "dodge", "jump-turn", "shoot-basket"}),
    frozenset({"die", "lie", "lie-down", "flinch", "roll", "sit-floor", "get-up"}),
    frozenset({"sit", "sit-down", "stand-up", "sit-floor", "kneel", "squat", "crouch", "get-up", "sneak", "lie-down"}),
    frozenset({"punch", "karate", "fight-stance", "kick", "block", "slash", "stab", "kick-ball", "swim"}),
    frozenset({"bow", "bend-over", "pick-up", "squat", "crouch"}),
    frozenset({"wave", "raise-arm", "signal", "guide", "cheer", "clap", "arm-circles", "conduct"}),
    frozenset({"throw", "shoot", "shoot-basket", "cast-spell", "punch", "kick-ball"}),
    frozenset({"crawl", "swim", "climb-ladder", "roll"}),
)
"""Actions whose words are often said of each other: one is not missed where another one is read."""
MISSED = 0.25
"""Grade under which an action is not shown at all."""
UNSHOWN_MOST = 0.4
"""Best match of a motion that leaves out an action of its prompt."""
_OTHERWISE = re.compile(
    r"\b(?:like|as if|as though|about to|ready to|tries|trying|pretend\w*|imagin\w*|instead|when|until|while someone"
    r"|someone|somebody|something|another|others?|opponent|enemy|both of|each other)\b"
)
"""Words of what is not done, or by someone else."""


def unshown_actions(
    prompt: str, read: Iterable[str], joints: NDArray[np.floating], skeleton: Skeleton, fps: float
) -> tuple[str, ...]:
    """Return the actions that the words of a prompt name beside those that are read, and that a motion does not show.

    Args:
        prompt: as a user typed it.
        read: ids of the actions that are read, which the match judges.
        joints: (T, 22, 3), metres.
        skeleton: of the joints.
        fps: of the joints.
    """
    beside = named_beside(prompt, frozenset(read))
    if not beside or skeleton.name != HUMANML3D.name or len(joints) < SHORTEST:
        return ()
    motion = Motion(joints, fps)
    return tuple(action for action in beside if RULES[action](motion, "") < MISSED)


def named_beside(prompt: str, read: frozenset[str]) -> tuple[str, ...]:
    """Return the actions of `VERBS` that a prompt has the body do and that are not read, nor like one that is."""
    text = without_gaze(BarePrompt.of(prompt).text).lower()
    if not read or _OTHERWISE.search(text):
        return ()
    scope = match_scope(text, every_action())
    if "negation" in scope.flags:
        return ()
    actions, known = load_vocabulary().actions, {each.action for each in scope.actions if each.verdict == "known"}
    told = {other for name in read if name in actions for other in (*actions[name].implies, actions[name].kind_of)}
    alike = set[str]().union(*(group for group in ALIKE if group & read))
    found = (name for name in VERBS if name in known and _done(name).search(text))
    return tuple(name for name in found if name not in read | told | alike)


@lru_cache(maxsize=len(VERBS))
def _done(action: str) -> re.Pattern[str]:
    """Return the pattern of the verb of an action where it is what the body does next, not a noun."""
    verb = VERBS[action]
    forms = "|".join(sorted({verb, third_person(verb)} & set(verb_forms(verb)) | {third_person(verb)}, key=len))
    return re.compile(rf"(?:\b(?:and|then|he|she|they)|[,;.])\s+(?:\w+ly\s+)?(?:{forms})\b(?!['-]|\s+of\b)")
