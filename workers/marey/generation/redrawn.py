"""Motions that do not show their action at all are drawn instead, as the made clips of the training data are.

A network that learned an action from few takes makes, for some prompts and seeds, another one, or none. What its rule
of the selector calls a failure is then no loss.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import Gesture
from marey.drawing.kinds import DRAWINGS
from marey.generation.fine_wish import FineWish
from marey.motion.features import FeatureLayout, encode_all
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, RIGHT, StandingBody
from marey.posing.still import standing_still
from marey.quality.record import SHOWN
from marey.selector.motion import SHORTEST, Motion
from marey.selector.rules import RULES

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

FAILS = SHOWN
"""Grade of the selector below which a motion does not show its action, and has the flag `off-prompt`."""
ALWAYS = frozenset({"aim", "laugh", "shoot"})
"""Actions that networks make after a long lead, or walking about, though their rule finds them."""
FORMS: Mapping[str, Mapping[str, re.Pattern[str]]] = {
    "kick": {
        "kick-round": re.compile(r"\bround(?:house)?[ -]?kick|\broundhouse"),
        "kick-side": re.compile(r"\bside[ -]?kick|\bkick\w* (?:sideways|to the side)"),
        "kick-low": re.compile(r"\blow[ -]?kick|\bkick\w* low\b|\bkick\w* .*\b(?:shins?|ankles?)\b"),
    }
}
"""Forms of an action that networks do not tell apart, by their kind, and their words."""
TRIES = 40
"""Movements of random kind, side and length, of which those are left out that the prompt does not ask for."""
DRAWN = 6
"""Movements that are drawn and graded at most."""
SHORTER = 0.85
"""Share of its own length to which a movement is cut at most, where the length is fixed: at its end the body waits."""


def redrawn(features: Float32, layout: FeatureLayout, action: str, wish: FineWish, seed: int) -> Float32 | None:
    """Return features (T', D) of a drawn movement in place of a motion that does not show its action; None if it does,
    or nothing better can be drawn.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        seed: of the motion.
    """
    if action not in DRAWINGS or action not in RULES or len(features) < SHORTEST:
        return None
    if _grade(layout.decode(features), action, "") >= FAILS:
        return None
    return drawn_alone(layout, action, wish, seed, len(features) if wish.fixed else None)


def drawn_alone(layout: FeatureLayout, action: str, wish: FineWish, seed: int, frames: int | None) -> Float32 | None:
    """Return features (T, D) of a movement that is drawn on a body that stands; None if none of those that the prompt
    asks for shows the action.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        seed: of the motion.
        frames: of the motion; None = as many as it takes.
    """
    if action not in DRAWINGS or action not in RULES or (frames is not None and frames < SHORTEST):
        return None
    rng = random.Random(f"{seed} {action}")  # noqa: S311
    for number, gesture in enumerate(_asked_for(action, wish, rng, frames)):
        if number == DRAWN:
            break
        joints = _drawn(gesture, frames, rng)
        side = wish.side if gesture.side in (LEFT, RIGHT) else ""
        if _grade(joints, action, side) >= SHOWN:
            return encode_all(layout, joints)
    return None


def _grade(joints: Array, action: str, side: str) -> float:
    return RULES[action](Motion(joints, FPS), side)


def _stated_form(action: str, text: str) -> str:
    """Return the form of an action that a text names, in lower case; empty if it names none."""
    return next((kind for kind, words in FORMS.get(action, {}).items() if words.search(text)), "")


def _asked_for(action: str, wish: FineWish, rng: random.Random, frames: int | None) -> Iterator[Gesture]:
    """Yield movements of which the prompt says nothing that is not true, and that have room."""
    text = wish.prompt.lower()
    form = _stated_form(action, text)
    for _ in range(TRIES):
        gesture = DRAWINGS[action](rng)
        other_side = wish.side and gesture.side in (LEFT, RIGHT) and gesture.side != wish.side
        too_long = frames is not None and SHORTER * gesture.seconds * FPS > frames
        untrue = gesture.untrue and re.search(gesture.untrue, text)
        other_form = form and form not in gesture.kinds
        if not (gesture.base or other_side or too_long or untrue or other_form):
            yield gesture


def _drawn(gesture: Gesture, frames: int | None, rng: random.Random) -> Array:
    body = StandingBody(standing_still(frames or max(round(gesture.seconds * FPS), SHORTEST), rng))
    gesture.change(body)
    return body.solved()
