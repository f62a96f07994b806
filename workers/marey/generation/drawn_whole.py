"""Motions that are drawn whole, without a network: movements whose form is known better than a network learned it.

Networks that learned an action from few takes lead into it for long, do it twice, begin in the air, or end in another
posture. What is drawn begins and ends with a body that stands, on the side, as often and in the form that the prompt
names. Walks, runs, dances and everything else stay theirs.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.generation.fine import FINE
from marey.generation.fine_wish import FineWish
from marey.generation.redrawn import drawn_alone
from marey.generation.stated import stated_features
from marey.generation.striking import stands
from marey.generation.whole_body import CHOICES, is_drawn
from marey.motion.features import FeatureLayout, encode_all
from marey.posing.limbs import FPS
from marey.posing.still import standing_still

Float32 = NDArray[np.float32]

NETWORKS_FIRST: frozenset[str] = frozenset()
"""Actions of which networks make the better motions, where these show them."""
NODS_S = (2.6, 4.0)
"""Seconds of a body that nods, where nothing is said of them; a stated number takes what it takes."""
NOD_S = 0.75
"""Seconds of one nod of a stated number."""


@dataclass(frozen=True, eq=False)
class DrawnWhole:
    """A motion that is drawn whole.

    Attributes:
        features: (T, D), in the layout's own units.
        exact: its number, pace and end are as asked for already.
    """

    features: Float32 = field(repr=False)
    exact: bool = False


def drawn_whole(layout: FeatureLayout, action: str, wish: FineWish, seed: int, frames: int | None) -> DrawnWhole | None:
    """Return a motion that shows an action as its prompt asks, drawn on a body that stands; None if it is a network's.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        seed: of the motion.
        frames: that it keeps; None = as many as it takes.
    """
    stated = stated_features(layout, action, wish, frames, seed)
    if stated is not None:
        return DrawnWhole(stated, exact=True)
    if action in ALONE and ALONE[action](wish):
        rng = np.random.default_rng([seed, len(action)])
        body = standing_still(frames or _frames(action, wish, rng), random.Random(f"{seed} stands"))  # noqa: S311
        joints = FINE[action].draw(body, FPS, wish, rng)
        return None if joints is None else DrawnWhole(encode_all(layout, joints))
    if action in NETWORKS_FIRST:
        return None
    alone = drawn_alone(layout, action, wish, seed, frames)
    return None if alone is None else DrawnWhole(alone)


def _frames(action: str, wish: FineWish, rng: np.random.Generator) -> int:
    """Return the frames of a body that stands until its movement is drawn; most movements bring their own."""
    seconds = float(rng.uniform(*NODS_S))
    if action == "nod" and wish.count is not None:
        seconds = wish.count * NOD_S + 0.4 * NODS_S[0]
    return round(seconds * FPS)


ALONE: Mapping[str, Callable[[FineWish], bool]] = {
    **{action: is_drawn(action) for action in CHOICES},
    "nod": lambda wish: True,
    "punch": stands,
}
"""Actions of `FINE`, by what prompts are drawn without what a network made."""
