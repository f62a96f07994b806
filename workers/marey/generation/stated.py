"""Movements whose prompt states their form, and that are drawn for that: arms that are raised to a height
or in a direction, a number of claps, and steps aside by number or at a pace.

A network knows the action, but neither how high the hand is to go nor how often or how fast it is done. What states
nothing stays as the network makes it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish
from marey.generation.raising import stated_raise
from marey.generation.whole_body import drawn_in_place
from marey.motion.features import FeatureLayout, encode_all

Float32 = NDArray[np.float32]
Statement = Callable[[FineWish, random.Random, float | None], Gesture | None]
"""`(wish, rng, seconds)`: the movement that the prompt states, None if it states none; seconds that it has to fill, or
None."""

STATED: Mapping[str, Statement] = {"raise-arm": stated_raise}
"""Movements by action."""


def stated_features(layout: FeatureLayout, action: str, wish: FineWish, frames: int, seed: int) -> Float32 | None:
    """Return features (T, D) of the movement that a prompt states; None if it states no form.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        frames: of the motion that the network made, kept if the wish is for a fixed length.
        seed: of the motion.
    """
    state = STATED.get(action)
    if state is None:
        return None
    rng = random.Random(f"{seed} {action}")  # noqa: S311
    if state(wish, rng, None) is None:
        return None
    joints = drawn_in_place(lambda seconds: state(wish, rng, seconds), 1, frames if wish.fixed else None, rng)
    return None if joints is None else encode_all(layout, joints)
