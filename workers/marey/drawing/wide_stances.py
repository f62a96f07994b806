"""Movements over a wide bent stance: the stamps of sumo, and the slow forms of tai chi."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import ELBOW_DOWN, FootPlace, HandPlace, Point, Posture, mirrored
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_TOES_OUT: Point = (0.62, -0.45, 0.64)
_KNEES_OUT: dict[str, Point] = dict.fromkeys(SIDES, (0.8, 0.0, 0.6))


def sumo_stomps(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """A wide squat out of which one leg after the other is lifted high to its side and stamped down.

    Args:
        rng: decides sizes and times.
        side: of the first leg; empty = right.
        times: how many stamps; None = two, or as many as fit one side that is named.
    """
    first, pace, starts = side or RIGHT, rng.uniform(0.95, 1.1), rng.uniform(0.2, 0.4)
    times, high = times or 2, rng.uniform(0.56, 0.7)
    on_knees = both(HandPlace((0.02, 0.1, 0.06), "knee", (1.0, 0.2, -0.3)))
    apart: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((0.38, 0.07, 0.0), _TOES_OUT))
    squat = Posture((0.0, 0.58, -0.1), (14, 0, 0), (10, 0, 0), (-16, 0, 0), 0.0, on_knees, apart, _KNEES_OUT)
    # of the right leg, over the left one
    loads = replace(squat, pelvis=(0.27, 0.74, -0.04), tilt=(12, -6, 0), spine=(10, -8, 0))
    air = {LEFT: apart[LEFT], RIGHT: FootPlace((0.66, high, 0.02), (0.75, -0.5, 0.4))}
    lifts = replace(squat, pelvis=(0.36, 0.84, 0.0), tilt=(6, -26, 0), spine=(6, -18, 0), neck=(-6, 12, 0), feet=air)
    falls = replace(lifts, pelvis=(0.2, 0.76, -0.03), tilt=(10, -10, 0), spine=(8, -8, 0))
    falls = replace(falls, feet={LEFT: apart[LEFT], RIGHT: FootPlace((0.5, 0.26, 0.0), _TOES_OUT)})

    def sequel(feet: StandingFeet) -> Sequel:
        done = Sequel([starts])
        half = {LEFT: apart[LEFT], RIGHT: feet[RIGHT].flat()}
        done.then(0.45 * pace, Posture((0.06, 0.86, -0.02), (8, 0, 0), (6, 0, 0), (-8, 0, 0), feet=half))
        done.then(0.5 * pace, squat, 0.3)
        for number in range(times):
            way = [(0.5, loads, 0.05), (0.55, lifts, 0.3), (0.26, falls, 0.0), (0.12, squat, 0.0)]
            low = replace(squat, pelvis=(0.0, 0.53, -0.1))
            for seconds, posture, hold in way:
                done.then(seconds * pace, posture if number % 2 == 0 else mirrored(posture), hold)
            done.then(0.14, low, 0.15)
            done.then(0.3 * pace, squat, 0.1)
        done.then(0.5 * pace, Posture((0.06, 0.86, -0.02), (6, 0, 0), (4, 0, 0), feet=half))
        done.then(0.5, Posture((0.0, 0.94, 0.0), feet={one: foot.flat() for one, foot in feet.items()}))
        return done

    return on_feet(sequel, ["sumo-stomp"], 0.4, side=first, mirror=first == LEFT, times=times)


def tai_chi(rng: random.Random, seconds: float | None = None) -> Gesture:
    """Slow forms of tai chi: the arms rise and sink, hands like clouds over a weight that goes from side to side, and a
    push ahead.

    Args:
        rng: decides sizes and times.
        seconds: to be filled; None = for about fourteen.
    """
    pace, starts = rng.uniform(0.95, 1.08), rng.uniform(0.15, 0.3)
    clouds = max(1, min(6, round(((seconds or 14.0) / pace - 8.6) / 1.9)))

    def hands(left: Point, right: Point) -> dict[str, HandPlace]:
        return {LEFT: HandPlace(left, "shoulder", ELBOW_DOWN), RIGHT: HandPlace(right, "shoulder", ELBOW_DOWN)}

    def sequel(feet: StandingFeet) -> Sequel:
        stands = {one: foot.flat() for one, foot in feet.items()}
        wide = {one: FootPlace((0.27, 0.07, 0.0), (0.25, -0.45, 0.86)) for one in SIDES}
        done = Sequel([starts])
        done.then(1.3 * pace, Posture((0.0, 0.92, 0.0), hands=hands((0.0, 0.0, 0.42), (0.0, 0.0, 0.42)), feet=stands))
        pressed = hands((0.04, -0.36, 0.26), (0.04, -0.36, 0.26))
        done.then(1.2 * pace, Posture((0.0, 0.85, -0.05), (4, 0, 0), hands=pressed, feet=stands))
        steps = {LEFT: FootPlace((0.2, 0.12, 0.0), (0.2, -0.6, 0.78)), RIGHT: stands[RIGHT]}
        ball = hands((-0.1, -0.36, 0.26), (-0.08, -0.06, 0.3))
        done.then(0.7 * pace, Posture((-0.07, 0.85, -0.04), (4, 0, 0), hands=ball, feet=steps))
        # the weight on the left foot, the left hand before the face and the right one at the belly, turned left
        cloud = Posture(
            (0.14, 0.81, -0.05), (4, 0, 10), (2, 0, 24), (0, 0, 6), 0.0,
            hands((0.02, 0.02, 0.32), (-0.2, -0.34, 0.24)), wide,
        )  # fmt: skip
        changes = Posture(
            (0.1, 0.82, -0.05), (4, 0, 8), (2, 0, 20), (0, 0, 4), 0.0,
            hands((0.16, -0.24, 0.3), (-0.16, -0.08, 0.34)), wide,
        )  # fmt: skip
        done.then(0.9 * pace, cloud)
        for number in range(clouds):
            left = number % 2 == 0
            done.then(0.6 * pace, changes if left else mirrored(changes))
            done.then(1.3 * pace, mirrored(cloud) if left else cloud)
        side = LEFT if clouds % 2 == 0 else RIGHT
        other = OTHER_SIDE[side]
        bow = {side: feet[side].flat(0.34, left=0.04), other: FootPlace((0.2, 0.07, -0.1), (0.5, -0.45, 0.74))}
        lifted = {**bow, side: replace(feet[side], out=feet[side].out + 0.04).tiptoe(20, 0.16, 0.05)}
        gathers = both(HandPlace((0.02, -0.14, 0.16), "shoulder", (0.6, -1.0, -0.4)))
        pushes = both(HandPlace((0.0, -0.04, 0.44), "shoulder", (0.6, -1.0, -0.1)))
        done.then(0.9 * pace, Posture((0.0, 0.83, -0.12), (2, 0, 0), hands=gathers, feet=lifted))
        done.then(0.5 * pace, Posture((0.0, 0.82, -0.02), (2, 0, 0), hands=gathers, feet=bow))
        done.then(1.2 * pace, Posture((0.0, 0.81, 0.16), (6, 0, 0), hands=pushes, feet=bow), 0.2)
        done.then(0.8 * pace, Posture((0.0, 0.86, 0.02), (2, 0, 0), hands=pressed, feet=bow))
        done.then(0.9, Posture((0.0, 0.94, 0.0), feet=stands))
        return done

    return on_feet(sequel, ["tai-chi"], rng.uniform(0.3, 0.5))
