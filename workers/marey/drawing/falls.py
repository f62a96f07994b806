"""Bodies that fall to the floor and stay there."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.tumbling import FLOOR, OWN, Limb, Tumble, Whole, pair
from marey.posing.standing import LEFT, RIGHT

FORMS = {"back": 4, "front": 3, "knees": 4, "knees-side": 2, "side": 3, "sit": 2, "spin": 2}
"""How a body falls, and how often of 20 times, if that is left open."""
_TEMPOS = {"quick": (0.8, 0.95), "": (0.95, 1.2), "slow": (1.4, 2.0)}
"""Factors of the seconds before a body falls; the fall itself takes as long as it does under gravity."""
_CHEST = Limb((-0.12, -0.2, 0.2), towards=(0.9, -0.6, 0.2))
_BELLY = Limb((-0.14, -0.36, 0.19), towards=(0.9, -0.3, 0.1))
_FLUNG = Limb((0.5, 0.02, 0.22), towards=(0.5, -0.7, -0.4))
_KNEELS = {side: Limb((0.1, 0.11, -0.06), FLOOR, (0.05, -0.9, 0.4)) for side in SIDES}
"""Feet of a body whose knees went down before them."""


def _arms_out(rng: random.Random, back: bool) -> dict[str, Limb]:
    """Hands on the floor of a body on its back or its front."""
    hands = {}
    for side in SIDES:
        out, up = rng.uniform(0.3, 0.62), rng.uniform(-0.42, 0.22)
        towards = (0.7, -0.7, -0.2) if back else (0.9, -0.3, 0.2)
        hands[side] = Limb((max(out, 0.42) if up > -0.25 else out, up, -0.06 if back else 0.06), towards=towards)
    return hands


def on_back(rng: random.Random, at: tuple[float, float], yaw: float = 0.0) -> Whole:
    """A body on its back."""
    feet = {side: Limb((rng.uniform(0.1, 0.26), -0.88, -0.05), towards=(0.5, -0.3, 0.8)) for side in SIDES}
    if rng.random() < 0.5:
        feet[rng.choice(SIDES)] = Limb((0.22, rng.uniform(-0.66, -0.5), -0.03), towards=(0.6, -0.7, 0.3))
    neck = (rng.uniform(-4, 6), 0, rng.uniform(-45, 45))
    return Whole(at, 0.14, (-87, 0, yaw), (rng.uniform(-2, 4), 0, 0), neck, _arms_out(rng, True), feet, 1.0, 0.3)


def _on_front(rng: random.Random, at: tuple[float, float]) -> Whole:
    """A body on its front, the head turned aside."""
    feet = {side: Limb((rng.uniform(0.1, 0.2), -0.88, 0.0), towards=(0.25, -0.95, -0.2)) for side in SIDES}
    neck = (rng.uniform(-14, -4), 0, rng.uniform(30, 60) * rng.choice((1, -1)))
    return Whole(at, 0.14, (88, 0, 0), (rng.uniform(-3, 1), 0, 0), neck, _arms_out(rng, False), feet, 1.0, 0.25)


def _on_right(rng: random.Random, at: tuple[float, float]) -> Whole:
    """A body on its right side, its legs a little bent."""
    bent = rng.uniform(0.1, 0.4)
    feet = {
        side: Limb((0.08, -0.8 + 0.35 * bent + late, 0.5 * bent), towards=(0, -0.8, 0.5))
        for side, late in ((LEFT, 0.05), (RIGHT, 0.0))
    }
    hands = {
        RIGHT: Limb((0.24, rng.uniform(-0.05, 0.15), rng.uniform(0.3, 0.42)), towards=(0.4, -0.9, 0.3)),
        LEFT: Limb((-0.02, rng.uniform(-0.3, -0.1), rng.uniform(0.3, 0.38)), towards=(0.6, -0.8, -0.1)),
    }
    tilt, spine = (rng.uniform(-8, 8), 86, 0), (20 * bent, rng.uniform(-4, 4), 0)
    return Whole(at, 0.16, tilt, spine, (rng.uniform(0, 14), rng.uniform(2, 10), 0), hands, feet, 1.0, 0.05)


def die(rng: random.Random, form: str = "", *, side: str = "", hit: bool | None = None, slow: bool = False) -> Gesture:
    """A body that falls dead, or faints, or loses its footing.

    Args:
        rng: decides everything that is not given.
        form: back, front, knees (then onto the front), knees-side, side, sit (then onto the back) or spin.
        side: left or right, to which it falls, where the form has a side.
        hit: something strikes it first.
        slow: it takes its time to go down.
    """
    form = form or rng.choices(list(FORMS), list(FORMS.values()))[0]
    tempo = "slow" if slow else rng.choice(["quick", "", "", "slow"])
    pace = rng.uniform(*_TEMPOS[tempo])
    done = Tumble(times=[rng.uniform(0.15, 0.8)])
    hit = rng.random() < 0.55 if hit is None else hit
    if hit:
        _struck(rng, done, form)
    {
        "back": _fall_back,
        "front": _fall_front,
        "knees": _fall_from_knees,
        "knees-side": _fall_from_knees_aside,
        "side": _fall_aside,
        "sit": _sink_back,
        "spin": _spin_and_fall,
    }[form](rng, done, pace)
    rests = done.poses[-1]
    done.then(rng.uniform(0.15, 0.25), replace(rests, neck=(0.6 * rests.neck[0], rests.neck[1], rests.neck[2])))
    done.then(0.3, rests, rng.uniform(0.5, 3.2))
    lies = {"back": "back", "front": "front", "knees": "front", "sit": "back", "spin": "back"}.get(form, "side")
    turned = done.mirrored() if (side == LEFT if side else rng.random() < 0.5) else done
    kinds = ["die", f"die-{form}", f"die-on-{lies}", "die-hit" if hit else "die-faint", f"die-{tempo}" if tempo else ""]
    untrue = {"back": "forward|face", "front": "back", "side": "back|forward|face"}[lies]
    return turned.gesture(rng, kinds, untrue=rf"\b({untrue})" + ("" if hit else r"|\bshot|kill|knock"))


def _struck(rng: random.Random, done: Tumble, form: str) -> None:
    """A jerk of the trunk by what kills the body, hands to the wound."""
    back = -1.0 if form in ("back", "sit", "spin") else 1.0
    spine = (back * rng.uniform(12, 22), rng.uniform(-6, 6), rng.uniform(-14, 14))
    hands = rng.choice((pair(_CHEST), pair(_BELLY), {RIGHT: _CHEST}, {LEFT: _BELLY}))
    jerk = Whole((0.0, 0.05 * back), 0.97, (6 * back, 0, 0), spine, (0.6 * spine[0], 0, 0), pair(_FLUNG), splay=0.2)
    done.then(rng.uniform(0.15, 0.2), jerk)
    held = replace(jerk, height=0.94, spine=(rng.uniform(4, 16), spine[1], 0), neck=(10, 0, 0), hands=hands)
    done.then(rng.uniform(0.3, 0.45), held, rng.choice((0.0, rng.uniform(0.1, 0.7))))


def _buckle(rng: random.Random, done: Tumble, pace: float, lean: float, at: tuple[float, float] = (0.0, 0.0)) -> None:
    """Knees that give way a little."""
    hands = done.poses[-1].hands
    buckled = Whole(
        at, rng.uniform(0.84, 0.92), (lean, 0, 0), (10, rng.uniform(-5, 5), 0), (18, 0, 0), hands, splay=0.25
    )
    done.then(rng.uniform(0.35, 0.5) * pace, buckled)


def _fall_back(rng: random.Random, done: Tumble, pace: float) -> None:
    """Backward over the heels, stiff or with knees that bend."""
    stiff = rng.random() < 0.4
    _buckle(rng, done, pace, -6.0, (0.0, -0.08))
    lies = on_back(rng, (rng.uniform(-0.08, 0.08), -rng.uniform(0.86, 0.94) if stiff else -rng.uniform(0.6, 0.74)))
    way = Whole((0.0, 0.5 * lies.at[1]), 0.66 if stiff else 0.5, (-36, 0, 0), (12, 0, 0), (14, 0, 0), pair(_FLUNG))
    done.then(rng.uniform(0.4, 0.5), way, fall=True)
    hands = {side: replace(limb, at=(0.5, 0.05, -0.02)) for side, limb in lies.hands.items()}
    feet = {side: Limb((0.0, 0.02, 0.02), OWN) for side in SIDES}
    done.then(rng.uniform(0.24, 0.3), replace(lies, spine=(6, 0, 0), neck=(8, 0, 0), hands=hands, feet=feet), fall=True)
    done.then(rng.uniform(0.3, 0.45), lies)


def _fall_front(rng: random.Random, done: Tumble, pace: float) -> None:
    """Forward over the toes, flat onto the front, the hands before it or at its sides."""
    _buckle(rng, done, pace, 8.0, (0.0, 0.1))
    lies = _on_front(rng, (rng.uniform(-0.05, 0.05), rng.uniform(0.8, 0.86)))
    catch = rng.random() < 0.6
    hands = pair(Limb((0.26, -0.04, 0.28), towards=(0.8, -0.6, -0.3))) if catch else {}
    feet = {side: Limb((0.09, 0.1, -0.02), FLOOR, (0.05, -0.85, 0.5)) for side in SIDES}
    way = Whole((0.0, 0.46), 0.76, (38, 0, 0), (4, 0, 0), (-10, 0, 0), hands, feet, splay=0.2)
    done.then(rng.uniform(0.4, 0.5), way, fall=True)
    hit = replace(lies, hands=pair(Limb((0.3, -0.1, 0.1), towards=(0.9, -0.3, -0.3))) if catch else lies.hands)
    done.then(rng.uniform(0.27, 0.33), replace(hit, neck=(-12, 0, 0.6 * lies.neck[2])), fall=True)
    done.then(rng.uniform(0.3, 0.5), lies)


def _to_knees(rng: random.Random, done: Tumble, pace: float) -> Whole:
    """Down onto both knees, in front of where the feet were."""
    hands = done.poses[-1].hands
    _buckle(rng, done, pace, 2.0, (0.0, 0.04))
    kneels = Whole(
        (0.0, rng.uniform(0.28, 0.32)), 0.55, (4, 0, 0), (rng.uniform(8, 16), 0, 0), (22, 0, 0), hands, _KNEELS
    )
    done.then(rng.uniform(0.36, 0.44), kneels, fall=True)
    sways = replace(kneels, at=(0.0, kneels.at[1] - 0.04), height=0.53, tilt=(-2, rng.uniform(-4, 4), 0))
    done.then(rng.uniform(0.3, 0.5) * pace, sways, rng.choice((0.0, rng.uniform(0.1, 0.9))))
    return sways


def _fall_from_knees(rng: random.Random, done: Tumble, pace: float) -> None:
    """Onto the knees, then forward onto the face."""
    kneels = _to_knees(rng, done, pace)
    lies = _on_front(rng, (rng.uniform(-0.06, 0.06), rng.uniform(0.72, 0.78)))
    way = replace(
        kneels, at=(0.0, 0.5), height=0.48, tilt=(36, 0, 0), neck=(10, 0, 0), hands=kneels.hands or pair(_BELLY)
    )
    done.then(rng.uniform(0.38, 0.46), way, fall=True)
    feet = {side: Limb((0.1, 0.08, -0.06), FLOOR, (0.1, -0.6, -0.8)) for side in SIDES}
    done.then(rng.uniform(0.24, 0.3), replace(lies, feet=feet, neck=(-8, 0, 0.7 * lies.neck[2])), fall=True)
    done.then(rng.uniform(0.3, 0.5), lies)


def _fall_from_knees_aside(rng: random.Random, done: Tumble, pace: float) -> None:
    """Onto the knees, then over to the right."""
    kneels = _to_knees(rng, done, pace)
    lies = _on_right(rng, (-rng.uniform(0.4, 0.5), 0.24))
    way = replace(kneels, at=(-0.2, 0.26), height=0.42, tilt=(4, 32, 0), spine=(8, 8, 0), splay=0.05)
    done.then(rng.uniform(0.36, 0.44), way, fall=True)
    feet = {side: replace(limb, at=(0.08, -0.62, -0.2), towards=(0, -0.7, -0.6)) for side, limb in lies.feet.items()}
    done.then(rng.uniform(0.2, 0.26), replace(lies, feet=feet), fall=True)
    done.then(rng.uniform(0.35, 0.5), lies)


def _fall_aside(rng: random.Random, done: Tumble, pace: float) -> None:
    """To the right over the right foot."""
    _buckle(rng, done, pace, 0.0, (-0.1, 0.0))
    lies = _on_right(rng, (-rng.uniform(0.66, 0.76), rng.uniform(-0.06, 0.06)))
    way = Whole((-0.4, 0.02), 0.6, (4, 34, 0), (8, 6, 0), (6, -6, 0), {RIGHT: _FLUNG}, splay=0.1)
    done.then(rng.uniform(0.4, 0.5), way, fall=True)
    feet = {RIGHT: Limb((0.0, 0.01, 0.0), OWN), LEFT: Limb((0.0, 0.12, 0.02), OWN)}
    done.then(rng.uniform(0.24, 0.3), replace(lies, feet=feet), fall=True)
    done.then(rng.uniform(0.3, 0.45), lies)


def _sink_back(rng: random.Random, done: Tumble, pace: float) -> None:
    """Down onto the seat, then onto the back."""
    _buckle(rng, done, pace, -2.0, (0.0, -0.1))
    lies = on_back(rng, (rng.uniform(-0.05, 0.05), -rng.uniform(0.44, 0.52)))
    hands = pair(Limb((0.32, -0.36, 0.04), towards=(0.7, -0.3, -0.8)))
    seat = Whole((0.0, lies.at[1]), 0.15, (-14, 0, 0), (14, 0, 0), (16, 0, 0), hands, rest=1.0, splay=0.3)
    done.then(rng.uniform(0.42, 0.5), seat, fall=True)
    done.then(rng.uniform(0.12, 0.4) * pace, replace(seat, tilt=(-20, 0, 0)))
    feet = {side: Limb((0.02, 0.0, 0.0), OWN) for side in SIDES}
    done.then(rng.uniform(0.36, 0.44), replace(lies, feet=feet, neck=(6, 0, 0)), fall=True)
    done.then(rng.uniform(0.4, 0.6), lies)


def _spin_and_fall(rng: random.Random, done: Tumble, pace: float) -> None:
    """Struck round to the left, then down onto the back."""
    yaw = rng.uniform(55, 95)
    feet = {RIGHT: Limb((-0.04, 0.02, 0.2), OWN)}
    turned = Whole((0.02, 0.02), 0.9, (2, 0, 0.45 * yaw), (4, 0, 25), (8, 0, 20), pair(_FLUNG), feet, splay=0.2)
    done.then(rng.uniform(0.3, 0.4) * min(pace, 1.2), turned)
    lies = on_back(rng, (-0.62, -0.3), yaw)
    way = replace(turned, at=(-0.28, -0.12), height=0.56, tilt=(-32, 0, 0.8 * yaw), spine=(10, 0, 10), neck=(10, 0, 5))
    done.then(rng.uniform(0.4, 0.5), way, fall=True)
    bent = pair(Limb((0.12, -0.62, 0.14), towards=(0.2, -0.5, 0.8)))
    done.then(rng.uniform(0.26, 0.32), replace(lies, feet=bent, neck=(6, 0, 0)), fall=True)
    done.then(rng.uniform(0.3, 0.45), lies)
