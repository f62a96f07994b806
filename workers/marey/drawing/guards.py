"""Stances of fighters, and bodies that stand in guard."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.stances import settle, step, turn_hips
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, LEGS, OTHER_SIDE, StandingBody, envelope

Array = NDArray[np.floating]

_NECK = (12,)
_LONGEST = 9.3
_GUARDS = {
    "guard-boxing": (((0.03, 0.12), (0.02, 0.1), (0.27, 0.34)), ((0.02, 0.1), (0.03, 0.1), (0.17, 0.23))),
    "guard-karate": (((0.02, 0.14), (-0.22, -0.06), (0.34, 0.43)), ((0.04, 0.14), (-0.32, -0.2), (0.16, 0.24))),
    "guard-open": (((0.1, 0.22), (-0.18, 0.0), (0.32, 0.42)), ((0.1, 0.22), (-0.2, -0.02), (0.28, 0.38))),
    "guard-low": (((0.06, 0.16), (-0.32, -0.2), (0.3, 0.4)), ((0.06, 0.16), (-0.34, -0.22), (0.22, 0.3))),
}
"""Limits of the places of the leading hand and of the other; see `StandingBody.hold`."""
Stance = Callable[[StandingBody, Array], None]


def drawn_stance(rng: random.Random, lead: str, start: float, end: float | None) -> Stance:
    """A stance with one foot ahead and bent knees: a function of a body and the way (T,) into it.

    Args:
        rng: draws the stance.
        lead: the leg ahead.
        start: seconds at which the body steps into it, negative for a body that stands so from the first frame on.
        end: seconds at which it steps back, or None.
    """
    length, width, share = rng.uniform(0.26, 0.5), rng.uniform(0.22, 0.4), rng.uniform(0.25, 0.75)
    turn, sink, lean = rng.uniform(12, 40), rng.uniform(0.03, 0.1), rng.uniform(4, 16)
    hips, twist = rng.uniform(6, 18), rng.uniform(6, 20)
    first, follows = rng.choice((lead, OTHER_SIDE[lead])), OTHER_SIDE[lead]

    def stand(body: StandingBody, way: Array) -> None:
        feet = body.joints[:, LEGS[lead][2]] - body.joints[:, LEGS[follows][2]]
        now = body.local(feet, lead)[0]
        wider, longer = width - now[0], length - now[2]
        moves = {
            lead: ((share * wider, share * longer), 4.0),
            follows: (((1 - share) * wider, (share - 1) * longer), turn),
        }
        aside = (share - 0.5) * wider * (1.0 if lead == LEFT else -1.0)
        for side, (move, yaw) in moves.items():
            late = 0.0 if side == first else 0.3
            step(body, side, move, start + late, 0.36, turn=yaw)
            if end is not None:
                step(body, side, (-move[0], -move[1]), end + 0.3 - late, 0.36, turn=-yaw)
        sign = -1.0 if lead == LEFT else 1.0
        body.shift(-sink * way, (share - 0.5) * longer * way, aside * way)
        turn_hips(body, sign * hips * way)
        body.lean(sign * twist * way, "up")
        body.lean(-sign * 0.8 * (hips + twist) * way, "up", _NECK)
        body.lean(lean * way, "left")
        body.lean(0.3 * lean * way, "left", _NECK)

    return stand


def near(rng: random.Random, place: Sequence[float], wide: float = 0.03) -> tuple[float, ...]:
    """A place at random within `wide` metres of another, on each axis."""
    return tuple(one + rng.uniform(-wide, wide) for one in place)


def begun(rng: random.Random, lead: str) -> tuple[float, float, Stance | None]:
    """Draw how a fight begins: when the guard is reached, when it begins (negative: before the clip), and the stance
    of the legs, None for legs that stay as they are."""
    if rng.random() < 0.3:
        start = rng.uniform(0.1, 0.6)
        return start + rng.uniform(0.5, 0.7), start, None
    start = -2.0 if rng.random() < 0.6 else rng.uniform(0.1, 0.4)
    return max(start + 0.9, rng.uniform(0.15, 0.6)), start, drawn_stance(rng, lead, start, None)


def fight_stance(rng: random.Random) -> Gesture:
    form, lead = rng.choices(list(_GUARDS), (5, 3, 2, 2))[0], rng.choices(SIDES, (3, 2))[0]
    begins, ends = rng.random() < 0.5, rng.random() < 0.35
    start = -2.0 if begins else rng.uniform(0.1, 0.6)
    hold = rng.uniform(4.4, 6.4) if ends else rng.uniform(2.8, 7.4)
    end = (0.0 if begins else start + 0.7) + hold
    seconds = min(end + (1.3 if ends else 0.0), _LONGEST)
    stance = drawn_stance(rng, lead, start, end if ends else None)
    hands = {}
    for one, limits in zip((lead, OTHER_SIDE[lead]), _GUARDS[form], strict=True):
        hands[one] = np.array([rng.uniform(*limit) for limit in limits])
    mood = rng.choice(["still", "bounce", "bounce", "weave"])
    rate, high = rng.uniform(1.3, 2.4), rng.uniform(0.018, 0.034) if mood == "bounce" else 0.005
    sway, slow = rng.uniform(0.02, 0.05) if mood == "weave" else rng.uniform(0.003, 0.014), rng.uniform(0.3, 0.7)
    phases = [rng.uniform(0, 6.28) for _ in range(6)]
    busy = rng.uniform(0.006, 0.02)
    elbows = (rng.uniform(0.3, 0.9), -1.0, -0.2)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = envelope(frames, start, 0.75, end - start - 0.75 if ends else 60.0, 0.8)
        stance(body, way)
        side_to_side = np.sin(2 * np.pi * slow * t + phases[0])
        beat = 0.5 - 0.5 * np.cos(2 * np.pi * rate * t + phases[1])
        body.shift(
            -high * way * beat, 0.5 * sway * way * np.sin(np.pi * slow * t + phases[2]), sway * way * side_to_side
        )
        body.lean(100 * sway * way * side_to_side, "forward")
        settle(body)
        for k, one in enumerate((lead, OTHER_SIDE[lead])):
            path = np.stack(
                [np.sin(2 * np.pi * f * t + phases[2 + k + n]) for n, f in enumerate((0.7, 1.1, 0.9))], axis=-1
            )
            moved = busy * path + (0.4 * high * beat)[:, None] * np.array([0.0, -1.0, 0.0])
            body.hold(one, way, hands[one] + moved, lag=0.03, pole=elbows)

    kinds = ["guard", form, f"guard-{mood}", "guard-lead"]
    kinds += [] if begins else ["guard-enter"]
    return Gesture(seconds, tuple(kinds), change, lead)


def on_guard(body: StandingBody, stance: Stance | None, start: float, end: float | None) -> Array:
    """Take a stance, if there is one, from `start` to `end` in seconds, or to the last frame; return the way into the
    guard and out of it, (T,) 0 to 1."""
    way = envelope(len(body.joints), start, 0.55, 60.0 if end is None else end - start, 0.6)
    if stance:
        stance(body, way)
    return way
