"""Bodies that throw themselves to a side, as goalkeepers do, and that slide over the floor feet first."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import Gesture
from marey.drawing.rolls import steps_in
from marey.drawing.tumbling import OWN, Limb, Tumble, Whole, pair, stood
from marey.posing.standing import LEFT, RIGHT

_READY = pair(Limb((0.22, -0.28, 0.36), towards=(0.8, -0.6, -0.2)))
_REACHING = {
    RIGHT: Limb((0.02, 0.5, 0.16), towards=(0.8, 0.1, 0.5)),
    LEFT: Limb((-0.06, 0.48, 0.2), towards=(0.8, 0.1, 0.6)),
}
_HELD = {
    RIGHT: Limb((0.02, 0.02, 0.34), towards=(0.4, -0.9, 0.3)),
    LEFT: Limb((-0.02, 0.02, 0.32), towards=(0.6, -0.8, 0.2)),
}
"""Hands that hold a ball before the face."""


def side_dive(rng: random.Random, side: str = "") -> Gesture:
    """A body that crouches, pushes off, flies to a side with both hands ahead, and lands on that side.

    Args:
        rng: decides everything that is not given.
        side: left or right, to which it dives.
    """
    far, lasts = rng.uniform(1.55, 1.85), rng.uniform(0.46, 0.54)
    done = Tumble(times=[rng.uniform(0.2, 0.6)])
    wide = pair(Limb((0.12, 0.0, 0.0), OWN))
    low = Whole((0.0, -0.04), 0.82, (16, 0, 0), (14, 0, 0), (-14, 0, 0), _READY, wide, splay=0.3)
    stepped = {LEFT: Limb((0.12, 0.0, 0.0), OWN), RIGHT: Limb((0.36, 0.0, 0.04), OWN)}
    load = Whole((-0.26, -0.02), 0.7, (18, 14, 0), (14, 6, 0), (-8, -10, 0), _READY, stepped, splay=0.3)
    trails = Limb((0.16, -0.78, 0.04), towards=(0.1, -0.7, 0.6))
    off = Whole((-0.68, 0.02), 0.86, (8, 46, 0), (2, 10, 0), (0, -14, 0), _REACHING, splay=0.15)
    off = replace(off, feet={LEFT: trails, RIGHT: Limb((0.38, 0.05, 0.04), OWN, (0.2, -0.6, 0.7))})
    air_feet = {LEFT: Limb((0.2, -0.8, -0.02), towards=(0.1, -0.9, 0.3)), RIGHT: Limb((0.08, -0.66, 0.2))}
    air = Whole((-0.66 * far, 0.04), 0.7, (2, 80, 0), (-2, 6, 0), (-4, -12, 0), _REACHING, air_feet, splay=0.1)
    lies = Whole((-far, 0.04), 0.17, (2, 88, 0), (2, 0, 0), (2, -6, 0), _REACHING, air_feet, 1.0, 0.08)
    bent = {
        LEFT: Limb((0.1, -0.62, 0.3), towards=(0, -0.8, 0.5)),
        RIGHT: Limb((0.06, -0.7, 0.2), towards=(0, -0.8, 0.5)),
    }
    held = replace(lies, spine=(16, 0, 0), neck=(10, -4, 0), hands=_HELD, feet=bent)
    done.then(0.4, low, rng.uniform(0.05, 0.4))
    done.then(0.26, load)
    done.then(0.24, off)
    begins = done.times[-1]
    done.then(0.55 * lasts, air)
    done.then(0.45 * lasts, lies)
    done.flights.append((begins, begins + lasts))
    done.then(0.25, replace(lies, at=(-far - 0.14, 0.04)))
    done.then(0.45, replace(held, at=(-far - 0.16, 0.04)), rng.uniform(0.5, 1.2))
    right = side == RIGHT if side else rng.random() < 0.5
    return (done if right else done.mirrored()).gesture(rng, ["side-dive"], RIGHT if right else LEFT)


def cover_dive(rng: random.Random, *, runs: bool = True) -> Gesture:
    """A body that throws itself ahead and down, as behind cover, and lands on its chest with both arms ahead.

    Args:
        rng: decides everything that is not given.
        runs: it takes some steps before.
    """
    far, lasts = rng.uniform(1.15, 1.4), rng.uniform(0.4, 0.46)
    done = Tumble(times=[rng.uniform(0.1, 0.3)])
    z = steps_in(rng, done, 0.9) if runs else 0.0
    ahead = pair(Limb((0.0, 0.46, 0.3), towards=(0.8, 0.1, 0.5)))
    trails = pair(Limb((0.12, -0.88, 0.03), towards=(0.2, -0.95, -0.2)))
    swung = pair(Limb((0.2, -0.3, -0.2), towards=(0.7, 0.1, -0.7)))
    load = Whole((0.0, z + 0.02), 0.68, (40, 0, 0), (18, 0, 0), (-26, 0, 0), swung, stood(0, z), splay=0.25)
    toes = {side: Limb((0.0, 0.06, z), OWN) for side in (LEFT, RIGHT)}
    off = Whole((0.0, z + 0.42), 0.82, (54, 0, 0), (2, 0, 0), (-30, 0, 0), ahead, toes, splay=0.12)
    air = Whole((0.0, z + 0.4 + 0.6 * far), 0.62, (84, 0, 0), (-8, 0, 0), (-34, 0, 0), ahead, trails, splay=0.12)
    lands = Whole((0.0, z + 0.4 + far), 0.15, (86, 0, 0), (-4, 0, 0), (-30, 0, 0), ahead, trails, 1.0, 0.2)
    flat = pair(Limb((0.14, 0.26, 0.06), towards=(0.9, -0.3, 0.2)))
    done.then(0.3 if runs else 0.45, load)
    done.then(0.24, off)
    begins = done.times[-1]
    done.then(0.55 * lasts, air)
    done.then(0.45 * lasts, lands)
    done.flights.append((begins, begins + lasts))
    slid = z + 0.4 + far + rng.uniform(0.15, 0.3)
    done.then(0.3, replace(lands, at=(0.0, slid)))
    done.then(0.4, replace(lands, at=(0.0, slid), hands=flat, neck=(-14, 0, 0)), rng.uniform(0.4, 0.9))
    return done.gesture(rng, ["cover-dive"])


def ground_slide(rng: random.Random, *, rises: bool = True) -> Gesture:
    """A body that runs up, slides on one hip with a leg ahead, and gets up.

    Args:
        rng: decides everything that is not given.
        rises: it gets up at the end.
    """
    done = Tumble(times=[rng.uniform(0.1, 0.3)])
    z = steps_in(rng, done, 0.9)
    far = rng.uniform(1.5, 1.9)

    def slides(at: float, height: float, tilt: float, rest: float) -> Whole:
        """On the right hip, the left leg ahead and the right one bent below it."""
        feet = {
            LEFT: Limb((0.02, 0.02, at + 0.74), OWN, (0.1, 0.9, 0.5)),
            RIGHT: Limb((-0.06, -0.02, at + 0.36), OWN, (0.9, 0.1, 0.4)),
        }
        hands = {LEFT: Limb((0.34, 0.06, 0.22)), RIGHT: Limb((0.42, -0.26, -0.02), towards=(0.4, 0.2, -0.9))}
        return Whole((0.0, at), height, (tilt, 14, 0), (16, -10, 0), (18, -4, 0), hands, feet, rest, 0.5)

    done.then(0.24, slides(z + 0.35, 0.5, -22, 0.0), fall=True)
    done.then(0.2, slides(z + 0.85, 0.15, -40, 1.0), fall=True)
    for share, seconds in ((0.55, 0.24), (0.85, 0.26), (1.0, 0.3)):
        done.then(seconds, slides(z + 0.85 + share * (far - 0.85), 0.14, -44 + 6 * share, 1.0))
    end = z + far
    done.then(0.2, done.poses[-1], rng.uniform(0.1, 0.4))
    if rises:
        ahead = pair(Limb((0.24, -0.3, 0.3), towards=(0.8, -0.6, 0)))
        low = Whole(
            (0.0, end + 0.26), 0.46, (30, 0, 0), (26, 0, 0), (-14, 0, 0), ahead, stood(0, end + 0.36), splay=0.35
        )
        done.then(0.6, low)
        done.then(0.6, Whole((0.0, end + 0.36), feet=stood(0, end + 0.36)), 0.3)
    return done.either(rng).gesture(rng, ["ground-slide"])
