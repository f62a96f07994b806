"""Gaits that a prompt wants in place: "jogs on the spot". Networks go away from it, or freeze on one leg."""

from __future__ import annotations

import random
import re

from marey.drawing.gesture import Gesture
from marey.drawing.in_place import gait_in_place
from marey.generation.fine_wish import FineWish
from marey.generation.turning import waits_of
from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.lengths import stated_length
from marey.vocabulary.paces import stated_pace

SECONDS, BESIDE_S = (4.5, 5.5), (3.0, 3.6)
"""Seconds alone and beside other movements, where none are stated."""
_MARCHES, _JOGS = re.compile(r"\bmarch\w*"), re.compile(r"\b(?:jog|trot)\w*")
_KNEES_HIGH = re.compile(r"\b(?:high|raised) knees?\b|\bknees? (?:\w+ ){0,2}(?:high|up)\b|\bhigh[ -]step\w*")


def gait_asked_for_in_place(action: str, wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the gait in place that a prompt asks for; None for one that goes somewhere.

    Args:
        action: id of the gait.
        wish: what the prompt asks for.
        rng: decides what the prompt does not say.
        seconds: that it has to fill, or None.
    """
    text = wish.prompt.lower()
    if not goes_in_place(text, action):
        return None
    gait = "march" if _MARCHES.search(text) else "jog" if _JOGS.search(text) else action
    usual = rng.uniform(*(BESIDE_S if any(wish.beside) else SECONDS))
    return gait_in_place(
        rng,
        gait,
        seconds=seconds or stated_length(text).seconds or usual,
        pace=stated_pace(text),
        knees_high=_KNEES_HIGH.search(text) is not None,
        waits=waits_of(wish, rng),
    )
