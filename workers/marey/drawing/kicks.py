"""Kicks, also of a ball, and balancing on one leg. All are drawn for the left leg and
mirrored for the right one."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both, near
from marey.drawing.stances import turn_about_foot
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN, StandingBody

_LEG = 0.785
"""Metres from hip to ankle of a leg that is almost straight."""
_HIP = 0.83
_HIGH = 1.42, 1.48
"""Metres of the foot over the floor in a kick that is called high."""


def _side(rng: random.Random, done: Sequel, kinds: list[str], *, stands: bool = False) -> Gesture:
    """The gesture of a leg that is drawn; the side that is told is that of the leg, or of the one that stands."""
    leg = rng.choice(SIDES)
    told = OTHER_SIDE[leg] if stands else leg
    return (done if leg == LEFT else done.mirrored()).gesture(rng, kinds, told)


def _guard(rng: random.Random) -> dict[str, HandPlace]:
    return {side: HandPlace(near(rng, (0.08, -0.02, 0.26), 0.03), "trunk", (0.5, -1.0, -0.1)) for side in SIDES}


def _swinging(rng: random.Random, share: float) -> dict[str, HandPlace]:
    """Arms that swing against the left leg: the left one back and the right one forward, as far as `share`."""
    far = share * rng.uniform(0.2, 0.32)
    low = {LEFT: (0.14, -0.42, -far), RIGHT: (0.1, -0.4, far)}
    return {side: HandPlace(at, "shoulder", (0.5, -0.6, -0.8)) for side, at in low.items()}


def kick(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(["kick-front", "kick-side", "kick-round", "kick-low"], (5, 2, 2, 2))[0]
    guard = rng.random() < 0.5
    done = _kicked(rng, form, guard, times=times or 1)
    return replace(_side(rng, done, ["kick", form, "kick-guard" if guard else ""]), times=times or 1)


_SPUN = ((0, 0.0), (1, 25.0), (2, 185.0), (3, 262.0), (4, 285.0), (5, 345.0), (6, 360.0))
"""Postures of a kick by their number, and degrees by which a spinning body has turned at them."""


def spin_kick(rng: random.Random, side: str = "") -> Gesture:
    """A kick with the heel or the sole of a body that turns all the way round on its other foot.

    Args:
        rng: decides everything that is not given.
        side: of the leg that kicks.
    """
    side = side or rng.choice(SIDES)
    done = _kicked(rng, "kick-side", guard=False)
    told = done if side == LEFT else done.mirrored()
    times, degrees = zip(*((done.times[number], turned) for number, turned in _SPUN), strict=True)
    gesture = told.gesture(rng, ["kick", "kick-spin"], side)

    def change(body: StandingBody) -> None:
        gesture.change(body)
        turn_about_foot(body, OTHER_SIDE[side], times, [SIGN[side] * each for each in degrees])

    return replace(gesture, change=change)


def high_kick(rng: random.Random, side: str = "") -> Gesture:
    """A kick ahead whose foot comes up to the head, with the leg of `side` unless it is empty."""
    side = side or rng.choice(SIDES)
    done = _kicked(rng, "kick-front", guard=False, up=rng.uniform(*_HIGH))
    return (done if side == LEFT else done.mirrored()).gesture(rng, ["kick", "kick-front", "kick-high"], side)


def _kicked(rng: random.Random, form: str, guard: bool, up: float = 0.0, times: int = 1) -> Sequel:
    """The postures of kicks with the left leg; `up`: metres of the foot over the floor, 0 = by chance."""
    height = {"kick-front": (0.7, 1.2), "kick-side": (0.62, 1.0), "kick-round": (0.7, 1.1), "kick-low": (0.52, 0.66)}
    up = up or rng.uniform(*height[form])
    high = min((up - 0.5) / 0.7, 1.15)
    over: Point = (rng.uniform(0.02, 0.05), rng.uniform(0.9, 0.93), rng.uniform(-0.02, 0.03))
    arms = _guard(rng) if guard else _swinging(rng, -1.0)
    away = _guard(rng) if guard else _swinging(rng, 1.0)
    wind, lift, out, hold = rng.uniform(0.25, 0.4), rng.uniform(0.22, 0.34), rng.uniform(0.15, 0.22), 0.08
    back = Posture(over, (6, 0, 0), (4, 0, 0), over=RIGHT, hands=arms)
    back = replace(
        back, feet={LEFT: FootPlace((0.12, rng.uniform(0.19, 0.26), -rng.uniform(0.15, 0.32)), (0.1, -0.85, 0.3))}
    )
    chamber, struck, knee = _STRIKES[form](up)
    lean = -rng.uniform(8, 16) - 22 * high if form in ("kick-front", "kick-low") else -4.0
    roll = {"kick-side": 14 + 26 * high, "kick-round": 10 + 24 * high}.get(form, 0.0)
    yaw = {"kick-round": -rng.uniform(35, 60), "kick-side": 8.0}.get(form, 0.0)
    ready = Posture(over, (0.3 * lean, 0.6 * roll, 0.4 * yaw), (8, 0, 0), over=RIGHT, hands=arms)
    ready = replace(ready, feet={LEFT: chamber}, knees={LEFT: knee})
    hit = replace(ready, tilt=(lean, roll, yaw), spine=(10 - 0.2 * lean, -0.2 * roll, -0.2 * yaw), hands=away)
    hit = replace(hit, feet={LEFT: struck})
    done = Sequel([rng.uniform(0.15, 0.8)])
    if guard:
        done.then(rng.uniform(0.35, 0.55), Posture(hands=arms), rng.uniform(0.05, 0.4))
    for _ in range(times):
        done.then(wind, back)
        done.then(lift, ready)
        done.then(out, hit, hold)
        done.then(1.3 * out, replace(ready, hands=away if not guard else arms))
        done.then(rng.uniform(0.35, 0.55), Posture(hands=arms) if guard else STAND, 0.1)
    if guard:
        done.then(rng.uniform(0.5, 0.8), STAND)
    return done


def _ahead(up: float) -> tuple[FootPlace, FootPlace, Point]:
    far = math.sqrt(_LEG**2 - (up - _HIP) ** 2) + max(0.2 * (up - 1.1), 0.0)  # the hips rise with a high leg
    return (
        FootPlace((0.08, 0.5 + 0.2 * (up - 0.5), 0.16), (0, -0.5, 0.85)),
        FootPlace((0.06, up, far), (0, 0.6, 0.8)),
        (0.1, 0.5, 1.0),
    )


def _aside(up: float) -> tuple[FootPlace, FootPlace, Point]:
    far = math.sqrt(_LEG**2 - (up - _HIP - 0.04) ** 2) - 0.03
    return FootPlace((0.16, 0.5, 0.1), (0.2, -0.4, 0.9)), FootPlace((far, up, 0.04), (0.1, 0.1, 1.0)), (0.4, 0.5, 0.8)


def _around(up: float) -> tuple[FootPlace, FootPlace, Point]:
    far = math.sqrt(_LEG**2 - (up - _HIP - 0.03) ** 2) - 0.03
    start = FootPlace((0.46, 0.3 + 0.25 * up, -0.16), (0.3, -0.6, 0.4))
    return start, FootPlace((-0.1, up, 0.97 * far), (-0.4, 0.2, 0.8)), (0.6, 0.5, 0.8)


_STRIKES = {"kick-front": _ahead, "kick-low": _ahead, "kick-side": _aside, "kick-round": _around}
"""Where the foot is before and at the end of a strike at a height, and where the knee points."""


def kick_ball(rng: random.Random) -> Gesture:
    steps = rng.choices((0, 1, 2, 3), (2, 4, 3, 2))[0]
    hard = rng.random() < 0.6
    stride, pace = rng.uniform(0.34, 0.5), rng.uniform(0.3, 0.4)
    done = Sequel([rng.uniform(0.15, 0.8)])
    plant = _run_up(rng, done, steps, stride, pace)
    stand = {RIGHT: FootPlace((0.09, 0.07, plant))} if steps else {}
    if not steps:
        wound = Posture((0.03, 0.9, 0.0), (8, 0, 10), over=RIGHT, hands=_swinging(rng, -1.0))
        foot = FootPlace((0.12, rng.uniform(0.3, 0.42), -rng.uniform(0.4, 0.5)), (0.1, -0.9, -0.1))
        done.then(rng.uniform(0.35, 0.5), replace(wound, feet={LEFT: foot}))
    through = rng.uniform(0.14, 0.17) if hard else rng.uniform(0.165, 0.2)
    high = rng.uniform(0.55, 0.85) if hard else rng.uniform(0.47, 0.58)
    struck = Posture((0.03, 0.89, 0.02), (-4, 0, -4), (8, 0, 0), (10, 0, 0), over=RIGHT, hands=_swinging(rng, 0.3))
    struck = replace(struck, feet={**stand, LEFT: FootPlace((0.07, 0.12, plant + 0.1), (0, -0.75, 0.65))})
    done.then(through, struck)
    follow = replace(struck, tilt=(-rng.uniform(8, 20), 0, -12), spine=(14, 0, 6), hands=_swinging(rng, 1.2))
    far = math.sqrt(_LEG**2 - (high - _HIP) ** 2) - 0.04
    follow = replace(
        follow, feet={**stand, LEFT: FootPlace((rng.uniform(-0.04, 0.05), high, plant + far), (0, -0.3, 0.9))}
    )
    done.then(1.15 * through, follow, 0.08)
    if steps:
        end = Posture((0.0, 0.92, plant), feet={one: FootPlace((0.09, 0.07, plant)) for one in SIDES})
        done.then(rng.uniform(0.45, 0.65), end, rng.uniform(0.2, 0.9))
    else:
        done.then(rng.uniform(0.45, 0.65), STAND, rng.uniform(0.2, 0.7))
    return _side(
        rng, done, ["kick-ball", "kick-ball-run" if steps > 1 else "", "kick-ball-hard" if hard else "kick-ball-soft"]
    )


def _run_up(rng: random.Random, done: Sequel, steps: int, stride: float, pace: float) -> float:
    """Add steps up to a ball, the last one with the left foot drawn back; return where the right foot stands, metres
    ahead.

    Args:
        stride, pace: metres and seconds of a step.
    """
    at = {LEFT: 0.0, RIGHT: 0.0}
    for k in range(steps):
        side = RIGHT if (steps - k) % 2 else LEFT  # the last step is that of the standing foot
        at[side] = max(at.values()) + (stride if k else 0.7 * stride)
        last = k == steps - 1
        swing = 1.0 if side == RIGHT else -1.0
        middle = 0.5 * (at[LEFT] + at[RIGHT]) if not last else at[RIGHT] - 0.08
        walk = Posture((-0.05 if last else 0.0, 0.89, middle), (4, 0, 0), hands=_swinging(rng, -swing))
        feet = {one: FootPlace((0.09, 0.07, at[one])) for one in SIDES}
        if last:
            feet[LEFT] = FootPlace(
                (0.12, rng.uniform(0.3, 0.45), at[RIGHT] - rng.uniform(0.42, 0.52)), (0.1, -0.9, -0.1)
            )
            walk = replace(walk, tilt=(8, 0, 12), hands=_swinging(rng, -1.2))
        done.then(pace if not last else 1.1 * pace, replace(walk, feet=feet))
    return at[RIGHT]


_BALANCES = {
    "balance-knee": (FootPlace((0.1, 0.42, 0.16), (0, -0.6, 0.8)), (0.1, 0.5, 1.0)),
    "balance-low": (FootPlace((0.1, 0.25, 0.1), (0.05, -0.5, 0.85)), (0.1, 0.3, 1.0)),
    "balance-stork": (FootPlace((0.1, 0.42, -0.33), (0, -0.6, -0.75)), (0.1, -0.3, 1.0)),
    "balance-tree": (FootPlace((-0.03, 0.5, 0.03), (-0.15, -0.95, 0.2)), (1.0, 0.1, 0.35)),
    "balance-side": (FootPlace((0.46, 0.22, 0.02), (0.3, -0.35, 0.9)), (0.3, 0.2, 1.0)),
    "balance-ahead": (FootPlace((0.08, 0.38, 0.6), (0, 0.3, 0.95)), (0.0, 1.0, 0.5)),
    "balance-plane": (FootPlace((0.09, 0.82, -0.7), (0, -0.3, -0.95)), (0.0, -1.0, 0.2)),
}
"""Where the lifted foot is and where its knee points."""
_ARMS = {
    "out": HandPlace((0.48, -0.02, 0.06), "shoulder", (0.1, -0.9, -0.4)),
    "low": HandPlace((0.36, -0.32, 0.06), "shoulder", (0.3, -0.3, -0.9)),
    "hips": HandPlace((0.2, -0.4, 0.04), "trunk", (0.9, 0.0, -0.7)),
    "chest": HandPlace((0.02, -0.14, 0.24), "trunk", (0.9, -0.6, 0.0)),
}


def balance(rng: random.Random) -> Gesture:
    form = rng.choices(list(_BALANCES), (5, 2, 3, 3, 2, 2, 2))[0]
    foot, knee = _BALANCES[form]
    arms = rng.choices(["out", "low", "hips", "chest", ""], (5, 2, 2, 2, 1))[0]
    if form == "balance-plane":
        arms = "out"
    foot = replace(foot, at=near(rng, foot.at, 0.03 if form not in ("balance-tree", "balance-plane") else 0.01))
    pitch = {"balance-plane": (rng.uniform(46, 62), 0, 0), "balance-ahead": (-6, 0, 0)}.get(
        form, (0, rng.uniform(0, 4), 0)
    )
    hips: Point = (0.02, 0.93, -0.02 if form != "balance-plane" else 0.0)
    up = Posture(
        hips, pitch, (0.25 * pitch[0], 0, 0), (-0.7 * pitch[0], 0, 0), over=RIGHT, feet={LEFT: foot}, knees={LEFT: knee}
    )
    up = replace(up, hands=both(_ARMS[arms]) if arms else {})
    done = Sequel([rng.uniform(0.1, 0.7)])
    done.then(rng.uniform(0.25, 0.45), Posture((hips[0], 0.9, hips[2]), over=RIGHT))
    done.then(rng.uniform(0.5, 1.1), up)
    end = done.times[-1] + rng.uniform(1.8, 4.5)
    wobble = rng.choice((0.4, 0.4, 1.2))
    while done.times[-1] < end:
        sway = rng.uniform(-4, 4) * wobble
        hands = {one: replace(hand, at=near(rng, hand.at, 0.05 * wobble)) for one, hand in up.hands.items()}
        if arms == "chest" or arms == "hips":
            hands = up.hands
        spine = (up.spine[0] + rng.uniform(-3, 3) * wobble, sway, 0.5 * sway)
        moved = replace(up, spine=spine, hands=hands)
        moved = replace(moved, pelvis=(hips[0] + rng.uniform(-0.012, 0.012) * wobble, *hips[1:]))
        done.then(
            rng.uniform(0.4, 0.9), replace(moved, feet={LEFT: replace(foot, at=near(rng, foot.at, 0.015 * wobble))})
        )
    done.then(rng.uniform(0.5, 0.9), Posture((hips[0], 0.9, hips[2]), over=RIGHT))
    done.then(rng.uniform(0.3, 0.5), STAND)
    told = form if form in ("balance-knee", "balance-stork", "balance-tree", "balance-plane") else ""
    kinds = ["balance", told, "balance-arms" if arms == "out" and form != "balance-plane" else ""]
    return _side(rng, done, kinds, stands=True)
