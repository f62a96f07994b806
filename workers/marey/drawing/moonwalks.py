"""Moonwalks: ways backward on which one flat foot glides back while the body stands on the toes of the other."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_FLAT = FootPlace((0.09, 0.07, 0.0), drags=True)
_ON_TOES = FootPlace((0.09, 0.165, 0.0), (0.05, -0.88, 0.45), drags=True)
_ARMS = {LEFT: (0.12, -0.44, -0.12), RIGHT: (0.12, -0.4, 0.18)}
"""Hands while the left foot is ahead."""


def moonwalk(rng: random.Random, *, steps: int | None = None, seconds: float | None = None) -> Gesture:
    """A body that stands and glides backward.

    Args:
        rng: decides everything that is not given.
        steps: how many glides; None = as many as fill the time.
        seconds: to be filled; None = for four to six seconds.
    """
    pace, far = rng.uniform(0.5, 0.62), rng.uniform(0.24, 0.29)
    steps = steps or max(2, round(((seconds or rng.uniform(4.0, 6.0)) - 1.4) / pace))
    at = {LEFT: 0.0, RIGHT: 0.0}
    glides = LEFT
    done = Sequel([rng.uniform(0.2, 0.4)])
    done.then(0.35, _on_toes(at, glides))
    for _ in range(steps):
        at[glides] = at[OTHER_SIDE[glides]] - far
        done.then(0.72 * pace, _on_toes(at, glides))
        glides = OTHER_SIDE[glides]
        done.then(0.28 * pace, _on_toes(at, glides))
    end = min(at.values())
    feet = {side: replace(_FLAT, at=(0.09, 0.07, end)) for side in SIDES}
    done.then(0.45, Posture((0.0, 0.93, end), feet=feet), 0.3)
    told = done.either(rng)
    return told.gesture(rng, ["moonwalk"], times=steps)


def _on_toes(at: dict[str, float], glides: str) -> Posture:
    """A body that stands on the toes of one foot, while the other, flat one glides.

    Args:
        at: metres forward of each foot.
        glides: side of the foot that does.
    """
    stands = OTHER_SIDE[glides]
    feet = {
        glides: replace(_FLAT, at=(0.09, 0.07, at[glides])),
        stands: replace(_ON_TOES, at=(0.09, 0.165, at[stands])),
    }
    middle = 0.45 * at[glides] + 0.55 * at[stands]
    swung = {side: hand if at[LEFT] >= at[RIGHT] else _ARMS[OTHER_SIDE[side]] for side, hand in _ARMS.items()}
    hands = {side: HandPlace(hand, "shoulder", (0.5, -0.5, -0.8)) for side, hand in swung.items()}
    lean = 2.5 if glides == LEFT else -2.5
    return Posture((0.0, 0.9, middle), (5, lean, 0), (4, -lean, 0), (7, 0, 0), hands=hands, feet=feet)
