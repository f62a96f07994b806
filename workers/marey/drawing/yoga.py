"""Poses of yoga that are held: warriors, tree, mountain, chair, triangle, and the downward dog."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT

_OUTWARD: Point = (0.88, -0.45, 0.1)
_AHEAD: Point = (0.1, -0.45, 0.88)
_HALF_OUT: Point = (0.55, -0.45, 0.7)
"""Directions of a foot that stands."""
_UP = both(HandPlace((0.15, 0.5, 0.02), "trunk", (1.0, 0.1, 0.4)))
_JOINED = both(HandPlace((0.045, 0.47, 0.03), "trunk", (1.0, 0.1, 0.2)))
_WIDE = both(HandPlace((0.54, 0.0, 0.0), "shoulder", (0.3, -1.0, -0.3)))
_AT_SIDES = both(HandPlace((0.1, -0.5, 0.05), "shoulder", (0.4, -0.3, -1.0)))
_AT_HEART = both(HandPlace((0.035, -0.16, 0.2), "trunk", (1.0, -0.5, 0.0)))


def _warrior_two(feet: StandingFeet) -> tuple[Posture, Posture]:
    del feet
    apart = {LEFT: FootPlace((0.6, 0.07, 0.0), _OUTWARD), RIGHT: FootPlace((0.54, 0.07, 0.0), _AHEAD)}
    knees: dict[str, Point] = {LEFT: (1.0, 0.0, 0.1), RIGHT: (0.3, 0.0, 1.0)}
    wide = Posture((0.03, 0.74, 0.0), neck=(0, 0, 50), hands=_WIDE, feet=apart, knees=knees)
    return wide, replace(wide, pelvis=(0.17, 0.65, 0.0), neck=(0, 0, 72))


def _warrior_one(feet: StandingFeet) -> tuple[Posture, Posture]:
    stance = {LEFT: feet[LEFT].flat(0.52), RIGHT: FootPlace((0.13, 0.07, -0.42), _HALF_OUT)}
    strides = Posture((0.0, 0.8, 0.06), (2, 0, 0), hands=_AT_SIDES, feet=stance)
    return strides, Posture((0.0, 0.69, 0.13), (-2, 0, 0), (-6, 0, 0), (-14, 0, 0), hands=_UP, feet=stance)


def _warrior_three(feet: StandingFeet) -> tuple[Posture, Posture]:
    planted = feet[LEFT].flat()
    half = {LEFT: planted, RIGHT: FootPlace((0.06, 0.2, -0.42), (0.05, -0.9, 0.1))}
    leans = Posture((0.0, 0.89, 0.0), (30, 0, 0), (6, 0, 0), (-12, 0, 0), 0.0, _UP, half, over=LEFT)
    back = {LEFT: planted, RIGHT: FootPlace((0.07, 0.8, -0.86), (0.0, -0.6, -0.8))}
    level = Posture((0.0, 0.845, 0.03), (78, 0, 0), (4, 0, 0), (-34, 0, 0), 0.0, _UP, back, over=LEFT)
    return leans, level


def _tree(feet: StandingFeet) -> tuple[Posture, Posture]:
    knees: dict[str, Point] = {LEFT: (0.05, 0.0, 1.0), RIGHT: (1.0, -0.1, 0.25)}
    calf = {LEFT: feet[LEFT].flat(), RIGHT: FootPlace((0.0, 0.3, 0.03), (0.1, -0.95, 0.25))}
    thigh = {LEFT: feet[LEFT].flat(), RIGHT: FootPlace((0.0, 0.55, 0.05), (0.05, -0.98, 0.15))}
    lifts = Posture((0.01, 0.93, 0.0), hands=_AT_HEART, feet=calf, knees=knees, over=LEFT)
    return lifts, replace(lifts, pelvis=(0.01, 0.94, 0.0), hands=_JOINED, feet=thigh)


def _mountain(feet: StandingFeet) -> tuple[Posture, Posture]:
    put = {side: foot.flat() for side, foot in feet.items()}
    stands = Posture((0.0, 0.945, 0.0), (-1, 0, 0), (-2, 0, 0), (-2, 0, 0), hands=_AT_SIDES, feet=put)
    open_hands = both(HandPlace((0.13, -0.49, 0.1), "shoulder", (0.4, -0.3, -1.0)))
    return stands, replace(stands, hands=open_hands, spine=(-4, 0, 0))


def _chair(feet: StandingFeet) -> tuple[Posture, Posture]:
    put = {side: foot.flat() for side, foot in feet.items()}
    bends = Posture((0.0, 0.8, -0.12), (14, 0, 0), (4, 0, 0), (-10, 0, 0), 0.0, _UP, put)
    return bends, Posture((0.0, 0.63, -0.26), (30, 0, 0), (6, 0, 0), (-22, 0, 0), 0.0, _UP, put)


def _triangle(feet: StandingFeet) -> tuple[Posture, Posture]:
    del feet
    apart = {LEFT: FootPlace((0.5, 0.07, 0.0), _OUTWARD), RIGHT: FootPlace((0.46, 0.07, 0.0), _AHEAD)}
    wide = Posture((0.0, 0.8, 0.0), neck=(0, 0, 40), hands=_WIDE, feet=apart)
    reaches = {
        LEFT: HandPlace((0.62, 0.3, 0.08), "floor", (0.3, 0.3, 1.0)),
        RIGHT: HandPlace((0.0, 0.52, 0.04), "shoulder", (0.6, 0.2, -1.0)),
    }
    return wide, Posture((-0.07, 0.79, -0.05), (4, -34, 0), (2, -36, 0), (0, 10, 30), 0.0, reaches, apart)


def _downward_dog(feet: StandingFeet) -> tuple[Posture, Posture]:
    put = {side: foot.flat(-0.52) for side, foot in feet.items()}
    floor = both(HandPlace((0.18, 0.05, 0.6), "floor", (0.7, 0.3, -0.3)))
    bends = Posture((0.0, 0.6, -0.2), (84, 0, 0), (24, 0, 0), (-8, 0, 0), 0.0, floor, put)
    return bends, Posture((0.0, 0.72, -0.1), (106, 0, 0), (8, 0, 0), (6, 0, 0), 0.0, floor, put)


POSES: Mapping[str, Callable[[StandingFeet], tuple[Posture, Posture]]] = {
    "warrior-one": _warrior_one,
    "warrior-two": _warrior_two,
    "warrior-three": _warrior_three,
    "tree": _tree,
    "mountain": _mountain,
    "chair": _chair,
    "triangle": _triangle,
    "downward-dog": _downward_dog,
}
"""The posture on the way to each pose, and the pose, by its name; those of one side with the left leg in front, or
standing."""
_EVEN = frozenset({"mountain", "chair", "downward-dog"})


def yoga_pose(rng: random.Random, pose: str, side: str = "", hold: float | None = None) -> Gesture:
    """A pose of yoga that is taken, held with quiet breath, and left again.

    Args:
        rng: decides times.
        pose: key of `POSES`.
        side: of the leg in front, or of the one that stands; empty = either.
        hold: seconds that it is held; None = for about four.

    Raises:
        KeyError: no such pose.
    """
    shape, pace, starts = POSES[pose], rng.uniform(1.0, 1.2), rng.uniform(0.2, 0.4)
    hold = rng.uniform(3.6, 4.4) if hold is None else hold
    side = "" if pose in _EVEN else side or rng.choice(SIDES)
    breaths = max(round(hold / 1.6), 1)

    def sequel(feet: StandingFeet) -> Sequel:
        on_way, held = shape(feet)
        done = Sequel([starts])
        done.then(1.0 * pace, on_way)
        done.then(0.9 * pace, held)
        left, up, ahead = held.pelvis or (0.0, 0.94, 0.0)
        inhaled = replace(held, pelvis=(left, up + 0.006, ahead), spine=(held.spine[0] - 1.2, *held.spine[1:]))
        for _ in range(breaths):
            done.then(0.5 * hold / breaths, inhaled)
            done.then(0.5 * hold / breaths, held)
        done.then(0.9 * pace, on_way)
        done.then(0.9 * pace, Posture((0.0, 0.94, 0.0), feet={one: foot.flat() for one, foot in feet.items()}))
        return done

    return on_feet(sequel, ["yoga", pose], rng.uniform(0.3, 0.6), side=side, mirror=side == RIGHT)
