"""Stunts: bodies that a blast throws back, dodge rolls, drops from a height, and ways up over an edge."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.falls import on_back
from marey.drawing.gesture import Gesture
from marey.drawing.tumbling import FLOOR, OWN, Limb, Tumble, Whole, pair, stood
from marey.posing.limbs import GRAVITY
from marey.posing.standing import LEFT, RIGHT

_HIPS = 0.94
"""Metres of the hips of a body that stands."""
_FLUNG = pair(Limb((0.56, 0.06, 0.34), towards=(0.4, -0.6, -0.6)))
_GUARDED = pair(Limb((0.16, -0.24, 0.3), towards=(0.8, -0.7, -0.1)))
_SWUNG = pair(Limb((0.4, -0.12, 0.26), towards=(0.4, -0.8, -0.5)))
_TUCKED = pair(Limb((0.12, -0.38, 0.36), towards=(0.1, -0.7, 0.7)))


def blown_back(rng: random.Random) -> Gesture:
    """A body that a blast lifts off its feet and throws onto its back, limbs behind the trunk, where it lies."""
    done = Tumble(times=[rng.uniform(0.3, 0.6)])
    far, lasts = rng.uniform(1.5, 2.0), rng.uniform(0.5, 0.58)
    lies = on_back(rng, (rng.uniform(-0.1, 0.1), -far - 0.3))
    trails = pair(Limb((0.16, -0.68, 0.34), towards=(0.2, 0.2, 0.9)))
    hit = Whole((0.0, -0.1), 0.97, (-14, 0, 0), (30, 0, 0), (26, 0, 0), _FLUNG, stood(0, -0.02), splay=0.2)
    done.then(0.12, hit)
    begins = done.times[-1]
    up = Whole(
        (0.0, -0.42 * far), 1.12, (-40, rng.uniform(-8, 8), 0), (34, 0, 0), (30, 0, 0), _FLUNG, trails, splay=0.3
    )
    done.then(0.5 * lasts, up)
    lands = replace(lies, at=(lies.at[0], -far), spine=(12, 0, 0), neck=(20, 0, 0), feet=trails, hands=_FLUNG)
    done.then(0.5 * lasts, lands)
    done.flights.append((begins, done.times[-1]))
    kicked = pair(Limb((0.18, -0.7, 0.12), towards=(0.3, -0.1, 0.9)))
    done.then(0.16, replace(lies, at=(lies.at[0], -far - 0.2), neck=(6, 0, 0), feet=kicked))
    done.then(rng.uniform(0.3, 0.45), lies, rng.uniform(0.8, 1.6))
    return done.gesture(rng, ["die", "die-back", "die-on-back", "die-hit", "die-blast"])


def dodge_roll(rng: random.Random, side: str = "", *, ahead: bool = False, low: bool = False) -> Gesture:
    """A quick roll out of the way, over one shoulder to a side, or ahead; up again at once.

    Args:
        rng: decides everything that is not given.
        side: left or right, to which it goes, or of the shoulder that it goes over.
        ahead: it goes ahead.
        low: the body stays in a crouch behind it.
    """
    done = Tumble(times=[rng.uniform(0.15, 0.3)])
    far, pace = rng.uniform(1.5, 1.8), rng.uniform(0.94, 1.04)
    yaw = 0.0 if ahead else -88.0

    def at(metres: float) -> tuple[float, float]:
        return (0.0, metres) if ahead else (-metres, 0.0)

    def hands(metres: float, out: float = 0.18) -> dict[str, Limb]:
        x, z = at(metres)
        if ahead:
            return pair(Limb((out, 0.04, z), FLOOR, (0.8, 0.3, -0.5)))
        return {
            LEFT: Limb((x, 0.04, out), FLOOR, (0.4, 0.4, 0.6)),
            RIGHT: Limb((-x, 0.04, -out), FLOOR, (0.4, 0.4, -0.6)),
        }

    def pose(metres: float, height: float, pitch: float, spine: float, neck: float, **more: object) -> Whole:
        made = Whole(at(metres), height, (pitch, 0.0, yaw), (spine, 0, 0), (neck, 0, 0), splay=0.25)
        return replace(made, **more)  # pyright: ignore[reportArgumentType]

    ends = stood(*at(far))
    dips = Whole(at(0.12), 0.7, (20, 0, 0.45 * yaw), (20, 0, 0), (-6, 0, 0), _GUARDED, stood(0, 0), splay=0.3)
    done.then(0.2 * pace, dips)
    springs = pose(
        0.44, 0.62, 62, 34, 10, hands=hands(0.8), feet=pair(Limb((0.1, -0.74, -0.1), towards=(0.1, -0.8, -0.4)))
    )
    done.then(0.18 * pace, springs)
    over = pose(0.48 * far, 0.52, 150, 56, 46, hands=_GUARDED, feet=_TUCKED, rest=1.0)
    done.then(0.18 * pace, over)
    done.then(0.17 * pace, pose(0.7 * far, 0.22, 245, 50, 40, hands=_GUARDED, feet=_TUCKED, rest=1.0))
    seat = pose(far - 0.26, 0.24, 322, 38, 12, hands=_GUARDED, feet=ends, rest=0.7)
    done.then(0.15 * pace, seat)
    rises = replace(pose(far - 0.04, 0.56, 384, 22, -8, hands=_GUARDED, feet=ends), tilt=(384, 0, 0.3 * yaw))
    done.then(0.2 * pace, replace(rises, splay=0.35))
    if low:
        done.then(0.2, replace(rises, at=at(far), height=0.6, tilt=(376, 0, 0), splay=0.35), rng.uniform(0.5, 0.9))
    else:
        done.then(0.36, replace(rises, at=at(far), height=0.95, tilt=(364, 0, 0), spine=(6, 0, 0), splay=0.2), 0.2)
        done.then(0.4, Whole(at(far), tilt=(360, 0, 0), feet=ends), 0.2)
    right = side == RIGHT if side else rng.random() < 0.5
    named = ("right" if right else "left") if not ahead else ""
    return (done if right else done.mirrored()).gesture(rng, ["roll", "roll-dodge"], named)


def jump_down(rng: random.Random, high: float = 0.0, *, heavy: bool = False, low: bool = False) -> Gesture:
    """A drop: a body that stands on something high steps off, falls, and lands in bent knees.

    Args:
        rng: decides everything that is not given.
        high: metres over the floor at which it stands; 0 = about as high as the chest.
        heavy: the landing takes it deep down, a hand to the floor.
        low: it stays in a crouch.
    """
    high = high or rng.uniform(1.0, 1.25)
    far, rise = rng.uniform(0.58, 0.7), 0.1
    share = high / _HIPS

    def up(metres: float = 0.0) -> dict[str, Limb]:
        return {one: replace(limb, at=(0.0, high, metres)) for one, limb in stood(0.0, metres).items()}

    stands = Whole((0.0, 0.0), 1.0 + share, feet=up())
    done = Tumble(poses=[stands], times=[rng.uniform(0.4, 0.6)])
    dip = Whole((0.0, 0.02), 0.8 + share, (28, 0, 0), (18, 0, 0), (14, 0, 0), _SWUNG, up(), splay=0.2)
    done.then(0.4, dip)
    leaves = Whole((0.0, 0.24), 1.0 + share, (16, 0, 0), (4, 0, 0), (16, 0, 0), _SWUNG, up(0.04), splay=0.15)
    done.then(0.2, leaves)
    begins = done.times[-1]
    speed = (2 * GRAVITY * rise) ** 0.5
    lasts = (speed + (speed**2 + 2 * GRAVITY * (high + 0.05)) ** 0.5) / GRAVITY
    bent = pair(Limb((0.12, -0.66, 0.2), towards=(0.1, -0.4, 0.9)))
    arms = pair(Limb((0.46, 0.08, 0.1), towards=(0.2, -0.8, -0.5)))
    done.then(
        0.45 * lasts, Whole((0.0, 0.6 * far), 1.0 + 0.7 * share, (8, 0, 0), (8, 0, 0), (14, 0, 0), arms, bent, 0.0, 0.2)
    )
    reach = pair(Limb((0.11, -0.84, 0.1), towards=(0.1, -0.5, 0.85)))
    done.then(
        0.4 * lasts,
        Whole((0.0, 0.92 * far), 1.0 + 0.2 * share, (8, 0, 0), (6, 0, 0), (16, 0, 0), arms, reach, 0.0, 0.2),
    )
    lands = Whole((0.0, far), 0.95, (14, 0, 0), (8, 0, 0), (8, 0, 0), arms, stood(0, far + 0.02), splay=0.25)
    done.then(0.15 * lasts, lands)
    done.flights.append((begins, done.times[-1]))
    deep = 0.42 if heavy else 0.5 if low else 0.58
    hands: dict[str, Limb] = pair(Limb((0.3, -0.34, 0.3), towards=(0.6, -0.7, -0.3)))
    if heavy:
        hands[RIGHT] = Limb((0.16, 0.06, far + 0.36), FLOOR, (0.9, 0.2, -0.3))
    sunk = Whole((0.0, far - 0.04), deep, (34, 0, 0), (24, 0, 0), (-24, 0, 0), hands, stood(0, far + 0.02), splay=0.4)
    done.then(0.2, sunk, rng.uniform(0.5, 0.9) if low else rng.uniform(0.2, 0.3) if heavy else 0.06)
    if not low:
        done.then(rng.uniform(0.6, 0.8), Whole((0.0, far + 0.02), feet=stood(0, far + 0.02)), rng.uniform(0.3, 0.6))
    return done.gesture(rng, ["jump", "jump-down"])


def climb_over_edge(rng: random.Random, high: float = 0.0) -> Gesture:
    """A body that springs to an edge over its head, pulls itself up, gets a knee over it, and stands on top.

    Args:
        rng: decides everything that is not given.
        high: metres of the edge over the floor; 0 = as high as the hands reach.
    """
    high = high or rng.uniform(1.75, 1.95)
    edge, out = 0.36, 0.24
    share = high / _HIPS
    grips = pair(Limb((out, high + 0.03, edge + 0.03), FLOOR, (0.5, -0.9, -0.3)))
    presses = pair(Limb((out, high + 0.04, edge + 0.06), FLOOR, (0.7, 0.2, -0.7)))
    hangs = pair(Limb((0.08, -0.84, 0.0), towards=(0.1, -0.8, 0.5)))
    done = Tumble(times=[rng.uniform(0.3, 0.5)])
    reach = pair(Limb((0.2, 0.3, 0.3), towards=(0.6, -0.6, 0.0)))
    done.then(0.4, Whole((0.0, 0.0), 0.78, (16, 0, 0), (8, 0, 0), (-30, 0, 0), reach, splay=0.2))
    done.then(0.26, Whole((0.0, 0.04), 1.12, (0, 0, 0), (-4, 0, 0), (-26, 0, 0), grips, hangs, splay=0.1))
    under = (high - 0.62) / _HIPS
    done.then(
        0.3, Whole((0.0, 0.06), max(under, 1.1), (2, 0, 0), (0, 0, 0), (-22, 0, 0), grips, hangs, splay=0.1), 0.15
    )
    walks = {LEFT: Limb((0.1, -0.62, 0.26), towards=(0.1, 0.4, 0.9)), RIGHT: hangs[RIGHT]}
    done.then(
        0.55, Whole((0.0, 0.0), (high - 0.2) / _HIPS, (14, 0, 0), (14, 0, 0), (-10, 0, 0), grips, walks, splay=0.15)
    )
    trails = pair(Limb((0.1, -0.8, -0.22), towards=(0.1, -0.9, 0.2)))
    done.then(0.45, Whole((0.0, 0.12), 0.2 + share, (44, 0, 0), (16, 0, 0), (-26, 0, 0), presses, trails, splay=0.15))
    knee = {RIGHT: Limb((0.0, high, edge + 0.24), OWN), LEFT: Limb((0.1, -0.66, -0.5), towards=(0.1, -0.9, -0.1))}
    done.then(
        0.5, Whole((0.04, edge - 0.08), 0.46 + share, (56, 0, 0), (20, 0, 0), (-30, 0, 0), presses, knee, splay=0.35)
    )
    both = {one: Limb((0.0, high, edge + 0.2), OWN) for one in (LEFT, RIGHT)}
    both[RIGHT] = Limb((0.0, high, edge + 0.24), OWN)
    lifts = {RIGHT: both[RIGHT], LEFT: Limb((0.0, high + 0.16, edge - 0.1), OWN)}
    done.then(
        0.32, Whole((0.0, edge + 0.08), 0.58 + share, (46, 0, 0), (18, 0, 0), (-24, 0, 0), presses, lifts, splay=0.3)
    )
    done.then(0.3, Whole((0.0, edge + 0.16), 0.62 + share, (34, 0, 0), (16, 0, 0), (-12, 0, 0), {}, both, splay=0.3))
    ends = Whole((0.0, edge + 0.22), 1.0 + share, feet=both)
    done.then(0.6, ends, rng.uniform(0.3, 0.6))
    return (done if rng.random() < 0.5 else done.mirrored()).gesture(rng, ["climb-onto", "climb-onto-edge"])
