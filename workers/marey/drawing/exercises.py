"""Jumping jacks, push-ups and sit-ups."""

from __future__ import annotations

import math
import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.floor import SUPINE, on_back
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both, near
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, direction, eased

Array = NDArray[np.floating]

_PARTS = (0.2, 0.32, 0.52, 0.72, 0.84, 1.0)
"""Shares of a jump at which the feet leave the floor, rise, are highest, fall, land, and the knees are bent most."""
_ASIDE = 0.12  # share of the way between its places at which a foot rises and falls


def jumping_jacks(rng: random.Random, *, times: int | None = None) -> Gesture:
    times = times or rng.randint(2, 6)
    half = rng.uniform(0.36, 0.52)
    wide, hop, dip = rng.uniform(0.3, 0.42), rng.uniform(0.07, 0.12), rng.uniform(0.04, 0.09)
    start, crouch = rng.uniform(0.2, 0.7), 0.3
    low, high = rng.uniform(-82, -72), rng.uniform(62, 84)
    ahead, bend = rng.uniform(0, 14), rng.uniform(2, 16)
    places = [0.09, wide]

    def stands(k: int) -> Posture:
        if k in (0, 2 * times):
            return Posture((0.0, 0.9 - dip, -0.02), (5, 0, 0), (4, 0, 0))
        up = 0.9 - dip - 0.25 * places[k % 2] ** 2
        feet = {side: FootPlace((places[k % 2], 0.07, 0.0)) for side in SIDES}
        return Posture((0.0, up, -0.02), (5, 0, 0), (4, 0, 0), feet=feet)

    def leaving(k: int) -> Posture:
        """Straight legs, before the feet leave the floor from place k, or after they come back to it."""
        stood = stands(k)
        return Posture((0.0, 0.91 - 0.6 * places[k % 2] ** 2 * (k not in (0, 2 * times)), 0.0), feet=stood.feet)

    def flies(k: int, share: float) -> Posture:
        """In the air, a share of the way from place k to the next."""
        out = (1 - share) * places[k % 2] + share * places[(k + 1) % 2]
        up = hop * (1.0 if share == 0.5 else 0.7)
        feet = {side: FootPlace((out, 0.09 + up, 0.0), (0.15, -0.72, 0.7)) for side in SIDES}
        return Posture((0.0, 0.9 + up - 0.3 * out**2, 0.0), feet=feet)

    done = Sequel([start])
    done.then(crouch, stands(0))
    for k in range(2 * times):
        flight = [flies(k, share) for share in (_ASIDE, 0.5, 1 - _ASIDE)]
        parts = zip(_PARTS, (0.0, *_PARTS), (leaving(k), *flight, leaving(k + 1), stands(k + 1)), strict=False)
        for part, before, posture in parts:
            done.then((part - before) * half, posture)
    done.then(0.4, STAND)

    def change(body: StandingBody) -> None:
        pose(body, done.times, done.postures)
        t = np.arange(len(body.joints)) / FPS
        phase = np.clip((t - start - crouch) / half, 0.0, 2 * times)
        opened = 0.5 - 0.5 * np.cos(np.pi * phase)
        way = eased((t - start) / 0.35) * (1 - eased((t - done.times[-2]) / 0.45))
        angles = low + (high - low) * opened
        upper = _directions(angles, ahead)
        fore = _directions(angles + bend * np.sin(np.pi * opened), ahead + 6)
        for side in SIDES:
            body.move_arm(side, way, upper, fore, 0.0)

    kinds = ("jacks", "jacks-many") if times > 3 else ("jacks",)
    return Gesture(done.times[-1] + rng.uniform(0.3, 0.8), kinds, change)


def _directions(elevation: Array, ahead: float) -> Array:
    """Directions (T, 3) of an arm beside the body at elevations (T,) in degrees; see `direction`."""
    return np.stack([direction(90 - ahead, one) for one in elevation])


_LONGEST = 8.0
"""Seconds of all repetitions."""
_TRUNK = 0.545
"""Metres from the hips to the shoulders of a straight body, along it."""
_ON_KNEES, _ON_TOES = (0.06, 0.39), (0.155, 0.795)
"""Metres of what it stands on over the floor, and from there to its hips."""


def straight_body(shoulders: float, look: float, foot: float, hand: HandPlace, *, knees: bool = False) -> Posture:
    """A straight body, face down, on its hands.

    Args:
        shoulders: metres of the shoulders over the floor.
        look: degrees of the neck, forward.
        foot: metres ahead of the ankles, or of the knees.
        hand: where both hands are.
        knees: it is on its knees, not on its toes.
    """
    base, leg = _ON_KNEES if knees else _ON_TOES
    slope = math.asin((shoulders - base) / (leg + _TRUNK))
    far = leg + 0.08
    pelvis = (0.0, base + far * math.sin(slope), foot + far * math.cos(slope))
    shank = 0.41 if knees else 0.0
    toes = (0, -0.95, 0.3) if not knees else (0, -0.3, -0.9)
    ankle = FootPlace((0.08, base + 0.4 * shank, foot - 0.9 * shank), toes)
    down_pole: dict[str, Point] = dict.fromkeys(SIDES, (0.0, -1.0, 0.1))
    tilt = (90 - math.degrees(slope), 0.0, 0.0)
    return Posture(pelvis, tilt, (0, 0, 0), (look, 0, 0), 0.0, both(hand), dict.fromkeys(SIDES, ankle), down_pole)


def reach_of(shoulders: float, *, knees: bool = False) -> float:
    """Metres by which the shoulders of a straight body are ahead of its ankles, or of its knees."""
    base, leg = _ON_KNEES if knees else _ON_TOES
    return (leg + _TRUNK) * math.cos(math.asin((shoulders - base) / (leg + _TRUNK)))


def push_ups(rng: random.Random, *, times: int | None = None) -> Gesture:
    knees = rng.random() < 0.25
    tempo = rng.choice(["quick", "", "", "slow"])
    half = {"quick": (0.4, 0.55), "": (0.6, 0.9), "slow": (1.1, 1.6)}[tempo]
    down = rng.uniform(*half)
    times = times or rng.randint(1, min(5, int(_LONGEST / (2 * down + 0.3))))
    top, bottom = rng.uniform(0.49, 0.52), rng.uniform(0.2, 0.29)
    wide, ahead = rng.uniform(0.22, 0.34), rng.uniform(-0.03, 0.06)
    elbow: Point = (rng.uniform(0.4, 1.0), 0.3, -0.8)
    foot = -rng.uniform(0.65, 0.8)
    hand = HandPlace((wide, 0.05, foot + reach_of(top, knees=knees) + ahead), "floor", elbow)

    def at(shoulders: float, look: float) -> Posture:
        return straight_body(shoulders, look, foot, hand, knees=knees)

    look = rng.uniform(-30, -8)
    done = Sequel([rng.uniform(0.2, 0.8)], [at(top, look)])
    for _ in range(times):
        done.then(down * rng.uniform(0.95, 1.1), at(bottom + rng.uniform(-0.01, 0.02), look), rng.uniform(0.0, 0.2))
        done.then(0.85 * down * rng.uniform(0.95, 1.15), at(top, look + rng.uniform(-4, 4)), rng.uniform(0.02, 0.25))
    kinds = ["push-ups", f"push-ups-{tempo}" if tempo else "", "push-ups-knees" if knees else ""]
    return done.gesture(rng, [*kinds, "push-ups-one" if times == 1 else ""], times=times)


_CRUNCHES = {
    "sit-ups-head": HandPlace((0.06, 0.15, -0.03), "trunk", (1.0, 0.3, 0.3)),
    "sit-ups-chest": HandPlace((-0.07, -0.12, 0.16), "trunk", (1.0, -0.8, 0.2)),
    "sit-ups-reach": HandPlace((0.02, 0.06, -0.06), "knee", (0.6, -0.2, -0.6)),
}


def sit_ups(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choice(list(_CRUNCHES))
    crunch = rng.random() < 0.3
    tempo = rng.choice(["quick", "", "", "slow"])
    rise = rng.uniform(*{"quick": (0.5, 0.7), "": (0.75, 1.1), "slow": (1.2, 1.7)}[tempo])
    times = times or rng.randint(1, min(5, int(_LONGEST / (2.2 * rise + 0.3))))
    hand = _CRUNCHES[form]
    legs: dict[str, FootPlace] = dict.fromkeys(SIDES, FootPlace((0.11, 0.07, rng.uniform(0.4, 0.5))))
    lying = on_back(0.0, feet=legs, knees=rng.uniform(0.0, 0.25))
    arms = both(hand if form != "sit-ups-reach" else HandPlace(near(rng, (0.12, -0.45, 0.02), 0.03), "trunk"))
    lying = Posture(lying.pelvis, lying.tilt, lying.spine, (6, 0, 0), 0.0, arms, lying.feet, lying.knees)
    tilt = SUPINE + (rng.uniform(12, 20) if crunch else rng.uniform(45, 66))
    spine = rng.uniform(36, 46) if crunch else rng.uniform(26, 40)
    pelvis = (0.0, 0.13 if crunch else 0.15, 0.0)
    up = Posture(pelvis, (tilt, 0, 0), (spine, 0, 0), (rng.uniform(8, 20), 0, 0), 0.0, both(hand), legs, lying.knees)
    done = Sequel([rng.uniform(0.15, 0.7)], [lying])
    for _ in range(times):
        done.then(rise * rng.uniform(0.92, 1.08), up, rng.uniform(0.0, 0.3))
        done.then(rise * rng.uniform(0.95, 1.2), lying, rng.uniform(0.02, 0.3))
    kinds = ["sit-ups", form if form == "sit-ups-head" else "", "crunches" if crunch else "sit-ups-full"]
    return done.gesture(rng, [*kinds, "sit-ups-slow" if tempo == "slow" else ""], times=times)
