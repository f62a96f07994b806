"""Squats, bends to the floor, and things that are picked up or set down."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import arms_of
from marey.drawing.postures import STAND, HandPlace, Point, Posture
from marey.drawing.sequels import TEMPOS, Sequel, both, near
from marey.posing.standing import LEFT

_SQUATS = {
    "squat-ahead": ((0.0, -0.04, 0.5), "shoulder", (0.4, -1.0, 0.0)),
    "squat-clasped": ((-0.16, -0.1, 0.24), "trunk", (0.7, -1.0, 0.0)),
    "squat-head": ((-0.05, 0.14, -0.02), "trunk", (1.0, 0.2, -0.1)),
    "squat-hips": ((0.07, -0.42, 0.04), "trunk", (0.9, 0.0, -0.7)),
    "squat-hang": (None, "", (0.0, 0.0, 0.0)),
}
"""The place of the hands, its anchor and where the elbows point; see `HandPlace`."""
_PAST_FACE = (0.08, 0.08, 0.26)  # hands go past the face on their way behind the head


def squat(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(list(_SQUATS), (4, 3, 2, 2, 3))[0]
    times = times or rng.choices((1, 2, 3), (5, 2, 3))[0]
    tempo = rng.choice(["quick", "", "", "slow"] if times < 3 else ["quick", ""])
    deep = rng.random() < 0.5
    height = rng.uniform(0.36, 0.5) if deep else rng.uniform(0.5, 0.65)
    back = (0.94 - height) * rng.uniform(0.22, 0.38)
    pitch, spine = rng.uniform(10, 24), rng.uniform(4, 18)
    at, anchor, elbow = _SQUATS[form]
    hands = both(HandPlace(near(rng, at), anchor, elbow)) if at else {}
    wide = rng.uniform(0.2, 0.8)
    knees: dict[str, Point] = dict.fromkeys(SIDES, (wide, 0.1, 1.0))
    down = Posture((0.0, height, -back), (pitch, 0, 0), (spine, 0, 0), (-0.7 * pitch, 0, 0), 0.8, hands, knees=knees)
    keep = form in ("squat-clasped", "squat-head", "squat-hips")
    up = Posture(hands=hands) if keep else STAND
    done = Sequel([rng.uniform(0.1, 0.8)])
    past = Posture(hands=both(HandPlace(_PAST_FACE, "trunk", (0.9, -0.5, 0.0))))
    if keep:
        if form == "squat-head":
            done.then(rng.uniform(0.4, 0.6), past)
        done.then(rng.uniform(0.4, 0.6), up, 0.1)
    fall = rng.uniform(*TEMPOS[tempo])
    hold = rng.uniform(0.8, 2.5) if times == 1 and rng.random() < 0.3 else rng.uniform(0.0, 0.35)
    for k in range(times):
        low = replace(down, pelvis=(0.0, height + rng.uniform(-0.03, 0.03) * (k > 0), -back))
        done.carried(fall * rng.uniform(0.9, 1.1), low, hold)
        done.carried(fall * rng.uniform(0.8, 1.1), up, rng.uniform(0.02, 0.25))
    if keep:
        if form == "squat-head":
            done.then(rng.uniform(0.35, 0.5), past)
        done.then(rng.uniform(0.4, 0.6), STAND)
    kinds = [
        "squat",
        "squat-deep" if deep else "",
        f"squat-{tempo}" if tempo else "",
        form if form in ("squat-ahead", "squat-head") else "",
    ]
    if times > 1:
        kinds = ["squat-repeated"]
    return done.gesture(rng, kinds, times=times)


def bend_over(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(["bend-toes", "bend-hang", "bend-knees", "bend-one"], (4, 3, 2, 2))[0]
    side = rng.choice(SIDES) if form == "bend-one" else ""
    times = times or (rng.choices((1, 2, 3), (6, 1, 1))[0] if form == "bend-toes" else 1)
    tempo = rng.choice(["quick", "", "", "slow"])
    fall, hold = rng.uniform(*TEMPOS[tempo]), rng.uniform(0.2, 2.2)
    pitch, spine = rng.uniform(54, 66), rng.uniform(40, 52)
    if form == "bend-knees":
        pitch, spine = rng.uniform(50, 58), rng.uniform(33, 40)
    hands = {
        "bend-toes": both(
            HandPlace((rng.uniform(0.02, 0.1), rng.uniform(0.08, 0.2), rng.uniform(0.08, 0.18)), "floor")
        ),
        "bend-hang": {},
        "bend-knees": both(HandPlace((0.02, rng.uniform(0.04, 0.1), 0.05), "knee", (0.8, 0.0, -0.6))),
        "bend-one": {
            side: HandPlace((rng.uniform(-0.1, 0.15), rng.uniform(0.08, 0.3), rng.uniform(0.1, 0.25)), "floor")
        },
    }[form]
    low = Posture(
        (0.0, rng.uniform(0.855, 0.885), -rng.uniform(0.05, 0.1)),
        (pitch, 0, 0),
        (spine, 0, (-12.0 if side == LEFT else 12.0) * bool(side)),
        (rng.uniform(-10, 20) if form != "bend-knees" else rng.uniform(-25, 0), 0, 0),
        rng.uniform(0.75, 1.0),
        hands,
    )
    done = Sequel([rng.uniform(0.1, 0.8)])
    for k in range(times):
        done.then(fall * rng.uniform(0.9, 1.1), low, hold if times == 1 else 0.15 + 0.1 * k)
        done.then(fall * rng.uniform(0.9, 1.3), STAND, 0.1)
    told = [form if form != "bend-hang" else "", f"bend-{tempo}" if tempo else ""]
    kinds = ["bend", *told] if times == 1 else ["bend-repeated"]
    return done.gesture(rng, kinds, side, times)


_CATCHES = {
    "pick-stoop": {"up": (0.7, 0.82), "back": (0.08, 0.16), "pitch": (50, 62), "spine": (40, 52)},
    "pick-squat": {"up": (0.37, 0.5), "back": (0.08, 0.14), "pitch": (18, 28), "spine": (26, 38)},
    "pick-half": {"up": (0.52, 0.66), "back": (0.1, 0.18), "pitch": (36, 46), "spine": (36, 46)},
}
"""How the body gets down: height of the hips, how far they go back, metres, and lean of hips and spine, degrees."""


def pick_up(rng: random.Random) -> Gesture:
    form = rng.choice(list(_CATCHES))
    side = rng.choice([BOTH, *SIDES])
    up, back, pitch, spine = (rng.uniform(*_CATCHES[form][name]) for name in ("up", "back", "pitch", "spine"))
    twist = {BOTH: 0.0, LEFT: -rng.uniform(4, 14)}.get(side, rng.uniform(4, 14))
    tempo = rng.choice(["quick", "", "", "slow"])
    fall, lift = rng.uniform(*TEMPOS[tempo]), rng.uniform(*TEMPOS[tempo])
    out = rng.uniform(0.1, 0.2) if side == BOTH else rng.uniform(-0.05, 0.2)
    floor = HandPlace((out, rng.uniform(0.07, 0.25), rng.uniform(0.22, 0.4)), "floor", (0.7, -0.2, -0.6))
    held = _held(rng, side)
    low = Posture(
        (0.0, up, -back), (pitch, 0, 0), (spine, 0, twist), (-12, 0, 0), 0.7, dict.fromkeys(arms_of(side), floor)
    )
    low = replace(low, knees=dict.fromkeys(SIDES, (rng.uniform(0.25, 0.6), 0.1, 1.0)))
    holding = Posture(spine=(rng.uniform(-6, 2), 0, 0), hands=dict.fromkeys(arms_of(side), held))
    done = Sequel([rng.uniform(0.1, 0.7)])
    action = rng.choices(["pick-up", "pick-put", "pick-drop"], (6, 3, 2))[0]
    if action == "pick-put":
        done.then(rng.uniform(0.4, 0.7), holding, rng.uniform(0.2, 0.8))
    done.carried(fall, low, rng.uniform(0.15, 0.5))
    if action == "pick-put":
        done.carried(lift, STAND)
    elif action == "pick-up":
        done.carried(lift, holding, rng.uniform(0.4, 1.8))
    if action == "pick-drop":
        done.carried(lift, STAND)
    if action == "pick-up" and rng.random() < 0.4:
        done.then(rng.uniform(0.5, 0.8), STAND)
    kinds = (
        ["pick-put"]
        if action == "pick-put"
        else ["pick", form if form != "pick-half" else "", "pick-both" if side == BOTH else "pick-one"]
    )
    return done.gesture(rng, kinds, side)


def _held(rng: random.Random, side: str) -> HandPlace:
    """Where a hand has a thing before the body."""
    out = rng.uniform(-0.06, 0.0) if side == BOTH else rng.uniform(-0.1, 0.05)
    return HandPlace((out, rng.uniform(-0.42, -0.2), rng.uniform(0.22, 0.34)), "shoulder", (0.6, -1.0, -0.4))
