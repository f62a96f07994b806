"""Movements of work and everyday life: a load lifted onto a shelf, shoes tied, a curtsy, a cower, rowing."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT

_SHELVES = {"high": 0.3, "": 0.06, "low": -0.22}
"""Metres of the wrists over the shoulders when the load is put down."""


def shelf_lift(rng: random.Random, height: str = "", *, heavy: bool = True) -> Gesture:
    """A load that is lifted from the floor with bent knees, held before the belly, and put onto a shelf.

    Args:
        rng: decides sizes and times.
        height: `high`, `low` or empty, of the shelf.
        heavy: it is lifted slowly, with a pause on the way.

    Raises:
        KeyError: no such height.
    """
    pace, starts = rng.uniform(0.95, 1.1) * (1.2 if heavy else 0.9), rng.uniform(0.2, 0.5)
    up, width = _SHELVES[height], rng.uniform(-0.02, 0.04)
    below = both(HandPlace((0.19 + width, 0.2, 0.34), "floor", (0.8, 0.0, -0.4)))
    belly = both(HandPlace((width, -0.32, 0.3), "shoulder", (0.8, -0.5, -0.8)))
    chest = both(HandPlace((width, -0.08, 0.26), "shoulder", (0.8, -1.0, 0.0)))
    put = both(HandPlace((width, up, 0.44 if up < 0.2 else 0.36), "shoulder", (0.8, -1.0, 0.1)))

    def sequel(feet: StandingFeet) -> Sequel:
        stance = {side: replace(foot, out=foot.out + 0.05).flat() for side, foot in feet.items()}
        wide: dict[str, Point] = dict.fromkeys(SIDES, (0.45, 0.1, 1.0))
        down = Posture((0.0, 0.52, -0.14), (34, 0, 0), (22, 0, 0), (-30, 0, 0), hands=below, feet=stance, knees=wide)
        half = Posture((0.0, 0.74, -0.1), (24, 0, 0), (14, 0, 0), (-22, 0, 0), hands=belly, feet=stance, knees=wide)
        held = Posture((0.0, 0.93, -0.03), (-5, 0, 0), (-3, 0, 0), (2, 0, 0), hands=belly, feet=stance)
        dips = Posture((0.0, 0.87, -0.03), (2, 0, 0), (0, 0, 0), (-4, 0, 0), hands=chest, feet=stance)
        toes = {side: replace(foot, out=foot.out + 0.05).tiptoe(34) for side, foot in feet.items()}
        high = Posture(
            (0.0, 0.96 if up > 0.2 else 0.92, 0.06),
            (4 if up > 0 else 10, 0, 0),
            (2 if up > 0 else 10, 0, 0),
            (-60 * up, 0, 0),
            hands=put,
            feet=toes if up > 0.2 else stance,
        )
        done = Sequel([starts])
        done.then(0.8 * pace, down, 0.3 * pace)
        done.then(0.5 * pace, half)
        done.then(0.5 * pace, held, 0.3 * pace)
        if up > -0.1:
            done.then(0.4 * pace, dips, 0.1 * pace)
        done.then(0.6 * pace, high, 0.35)
        rests = {side: foot.flat() for side, foot in feet.items()}
        done.then(0.7, Posture((0.0, 0.94, 0.0), feet=rests))
        return done

    return on_feet(sequel, ["shelf-lift", f"shelf-{height}" if height else ""], rng.uniform(0.4, 0.8))


def shoe_tied(rng: random.Random, side: str = "", *, both_shoes: bool = False) -> Gesture:
    """A body that goes down on one knee, ties the shoe of the foot ahead with both hands, and stands up.

    Args:
        rng: decides sizes and times.
        side: of the shoe; empty = either.
        both_shoes: the other one follows.
    """
    first, pace, starts = side or rng.choice(SIDES), rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.5)
    rounds, ahead, behind = rng.choice((2, 3)), 0.3, -0.34

    def hands(feet: StandingFeet, lifted: float, apart: float) -> dict[str, HandPlace]:
        """Wrists over the front foot, which is the left one."""
        out, far = feet[LEFT].out, ahead + feet[LEFT].forward + 0.02
        here = (out + apart, 0.16 + lifted, far)
        there = (-out + 0.05 + apart, 0.16 + lifted, far)
        return {
            LEFT: HandPlace(here, "floor", (1.0, 0.1, -0.3)),
            RIGHT: HandPlace(there, "floor", (1.0, 0.1, -0.3)),
        }

    def sequel(feet: StandingFeet) -> Sequel:
        planted = feet[LEFT].flat(ahead)
        half = Posture(
            (0.0, 0.72, 0.02),
            (16, 0, 0),
            (16, 0, 0),
            (-6, 0, 0),
            1.0,
            feet={LEFT: planted, RIGHT: feet[RIGHT].tiptoe(58, behind + 0.2)},
        )
        kneels = {LEFT: planted, RIGHT: FootPlace((0.1, 0.12, behind - 0.06), (0.0, -0.95, 0.3))}
        knees: dict[str, Point] = {LEFT: (0.25, 0.3, 1.0), RIGHT: (0.1, -0.4, 1.0)}
        low = Posture(
            (0.0, 0.47, -0.08),
            (30, 0, 0),
            (54, -4, 4),
            (-6, 0, 0),
            hands=hands(feet, 0.0, 0.0),
            feet=kneels,
            knees=knees,
        )
        pulled = replace(low, spine=(50, -4, 4), hands=hands(feet, 0.07, 0.1))
        looped = replace(low, hands=hands(feet, 0.03, 0.03))
        done = Sequel([starts])
        done.then(0.55 * pace, half)
        done.then(0.6 * pace, low, 0.2)
        for _ in range(rounds):
            done.then(0.35 * pace, looped, 0.1)
            done.then(0.3 * pace, low)
            done.then(0.35 * pace, pulled, 0.15)
            done.then(0.3 * pace, low, 0.1)
        rises = replace(half, hands=dict.fromkeys(SIDES, HandPlace((0.02, 0.06, 0.1), "knee", (1.0, 0.2, -0.3))))
        done.then(0.55 * pace, rises)
        done.then(0.6, Posture((0.0, 0.94, 0.0), feet={side: foot.flat() for side, foot in feet.items()}))
        return done

    def twice(feet: StandingFeet) -> Sequel:
        done = sequel(feet)
        swapped = {LEFT: replace(feet[RIGHT], side=LEFT), RIGHT: replace(feet[LEFT], side=RIGHT)}
        more = sequel(swapped).mirrored()
        later = [done.times[-1] + 0.2 + time - more.times[0] for time in more.times[1:]]
        return Sequel([*done.times, *later], [*done.postures, *more.postures[1:]])

    told = ["shoe-tied"]
    return on_feet(twice if both_shoes else sequel, told, rng.uniform(0.3, 0.6), side=first, mirror=first == RIGHT)


def curtsy(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """One foot goes behind the other, the knees bend, the head bows, and the hands hold a skirt out to the sides.

    Args:
        rng: decides sizes and times.
        side: of the foot that goes behind; empty = right.
        times: how many; None = one.
    """
    times, pace, starts = times or 1, rng.uniform(1.0, 1.2), rng.uniform(0.2, 0.5)
    low, heel = rng.uniform(0.7, 0.76), rng.uniform(54, 60)
    skirt = both(HandPlace((0.24, -0.4, 0.06), "shoulder", (0.8, 0.2, -0.8)))
    spread = both(HandPlace((0.34, -0.3, 0.08), "shoulder", (0.6, 0.4, -0.8)))

    def sequel(feet: StandingFeet) -> Sequel:
        crossed = {LEFT: feet[LEFT].flat(), RIGHT: replace(feet[RIGHT], out=-0.14).tiptoe(heel, -0.26)}
        held = Posture((0.0, 0.94, 0.0), hands=skirt)
        stepped = Posture((0.03, 0.9, -0.05), (3, 0, 0), (2, 0, 0), hands=spread, feet=crossed)
        knees: dict[str, Point] = {LEFT: (0.35, 0.1, 1.0), RIGHT: (0.45, -0.1, 1.0)}
        bent = Posture((0.02, low, -0.08), (8, 0, 0), (8, 0, 0), (20, 0, 0), hands=spread, feet=crossed, knees=knees)
        done = Sequel([starts])
        done.then(0.5 * pace, held)
        for _ in range(times):
            done.then(0.45 * pace, stepped)
            done.then(0.55 * pace, bent, 0.35)
            done.then(0.55 * pace, stepped)
            flat = {side: foot.flat() for side, foot in feet.items()}
            done.then(0.45 * pace, Posture((0.0, 0.94, 0.0), hands=skirt, feet=flat))
        done.then(0.5, Posture((0.0, 0.94, 0.0), feet={side: foot.flat() for side, foot in feet.items()}))
        return done

    told = ["curtsy"]
    return on_feet(sequel, told, rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT, times=times)


def cower(rng: random.Random, seconds: float | None = None) -> Gesture:
    """A body that shrinks back and down with the forearms before the bowed head, trembles, and rises again.

    Args:
        rng: decides sizes and times.
        seconds: to be filled; None = for about five seconds.
    """
    pace, starts, low = rng.uniform(0.9, 1.1), rng.uniform(0.2, 0.5), rng.uniform(0.56, 0.64)
    front, glances = rng.choice(SIDES), rng.uniform(6, 12)
    stays = max((seconds or 5.4) - 3.4, 1.2)
    shield = {
        LEFT: HandPlace((-0.12, 0.18, 0.2), "trunk", (0.7, -0.6, 0.5)),
        RIGHT: HandPlace((-0.06, 0.24, 0.16), "trunk", (0.7, -0.6, 0.5)),
    }
    knees: dict[str, Point] = {LEFT: (0.1, 0.1, 1.0), RIGHT: (0.1, 0.1, 1.0)}

    def sequel(feet: StandingFeet) -> Sequel:
        back = {LEFT: feet[LEFT].flat(), RIGHT: feet[RIGHT].tiptoe(34, -0.28)}
        shrinks = Posture((0.0, 0.84, -0.18), (0, 0, -6), (14, 4, -10), (14, 0, -6), hands=shield, feet=back)
        down = Posture((0.0, low, -0.2), (16, 0, -8), (38, 6, -14), (22, 0, -8), hands=shield, feet=back, knees=knees)
        done = Sequel([starts])
        done.then(0.42 * pace, shrinks)
        done.then(0.55 * pace, down)
        sunk, left = 1.0, stays
        while left > 0.0:
            shaken = replace(down, pelvis=(0.012 * sunk, low - 0.012, -0.2), spine=(40 - sunk, 6, -14 + 1.5 * sunk))
            done.then(0.22, shaken)
            sunk, left = -sunk, left - 0.22
        peeks = replace(down, spine=(30, 4, -10), neck=(2, 0, glances))
        done.then(0.5, peeks, 0.35)
        done.then(0.9 * pace, Posture((0.0, 0.93, 0.0), feet={side: foot.flat() for side, foot in feet.items()}))
        return done

    return on_feet(sequel, ["cower"], rng.uniform(0.3, 0.6), side=front, mirror=front == RIGHT)


def rowing(rng: random.Random, times: int | None = None, seconds: float | None = None) -> Gesture:
    """A body that sits low and rows: legs, trunk and arms pull one after the other, and come back in turn.

    Args:
        rng: decides sizes and times.
        times: how many strokes; None = as many as fill the time.
        seconds: to be filled; None = for three strokes.
    """
    pace, seat, lean = rng.uniform(0.95, 1.12), rng.uniform(0.22, 0.26), rng.uniform(20, 27)
    stroke = 2.2 * pace
    times = times or max(2, round((seconds or 3 * stroke) / stroke))
    feet: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((0.11, 0.0, 0.34), (0.1, 0.7, 0.7)))
    knees: dict[str, Point] = dict.fromkeys(SIDES, (0.3, 1.0, 0.25))
    reaches = both(HandPlace((-0.06, -0.14, 0.47), "shoulder", (0.8, -0.8, 0.0)))
    level = both(HandPlace((-0.06, -0.24, 0.42), "shoulder", (0.8, -0.8, 0.0)))
    pulled = both(HandPlace((-0.02, -0.27, 0.16), "shoulder", (0.9, -0.2, -0.8)))
    lowered = both(HandPlace((-0.04, -0.33, 0.22), "shoulder", (0.9, -0.4, -0.6)))

    def at(back: float, trunk: float, hands: dict[str, HandPlace]) -> Posture:
        """Hips `back` metres from the feet, the trunk leant by degrees."""
        bend = (0.5 * trunk, 0, 0), (0.5 * trunk, 0, 0), (-0.5 * trunk, 0, 0)
        return Posture((0.0, seat, 0.34 - back), *bend, hands=hands, feet=feet, knees=knees)

    far = 0.74
    catch, driven = at(0.42, lean, reaches), at(far - 0.04, 0.55 * lean, level)
    finish, away = at(far, -0.7 * lean, pulled), at(far - 0.02, 0.5 * lean, level)
    done = Sequel([rng.uniform(0.1, 0.3)], [catch])
    for _ in range(times):
        done.then(0.42 * pace, driven)
        done.then(0.34 * pace, finish, 0.06)
        done.then(0.14 * pace, at(far, -0.6 * lean, lowered))
        done.then(0.44 * pace, away)
        done.then(0.8 * pace, catch, 0.04)
    return done.gesture(rng, ["rowing"], times=times)
