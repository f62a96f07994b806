"""Hands that wash, wipe and scrub."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace
from marey.posing.limbs import FPS
from marey.posing.standing import OTHER_SIDE, StandingBody, stations, swings

Array = NDArray[np.floating]

_RUBS = {
    "wash-window": {"at": ((0.02, 0.16), (-0.02, 0.22), (0.38, 0.45)), "size": (0.13, 0.24), "rate": (0.8, 1.5)},
    "wash-table": {"at": ((-0.02, 0.16), (-0.44, -0.34), (0.3, 0.4)), "size": (0.1, 0.18), "rate": (0.9, 1.7)},
    "wash-hands": {"at": ((0.02, 0.05), (-0.34, -0.2), (0.26, 0.34)), "size": (0.07, 0.09), "rate": (1.3, 2.2)},
    "wash-face": {"at": ((0.05, 0.09), (0.02, 0.1), (0.15, 0.19)), "size": (0.065, 0.09), "rate": (1.1, 1.8)},
    "wash-body": {"at": ((-0.22, -0.12), (-0.2, -0.1), (0.17, 0.22)), "size": (0.08, 0.12), "rate": (1.0, 1.7)},
    "wash-dishes": {"at": ((0.02, 0.06), (-0.3, -0.2), (0.26, 0.33)), "size": (0.065, 0.1), "rate": (1.1, 1.9)},
}
"""Where the hand rubs, outward, up and forward of the middle of the shoulders; how far to either side of it, metres;
full strokes per second."""
_THINGS = ("window", "table", "wall", "body", "shower", "hands", "face", "shelf", "self", "dishes", "floor", "car")
"""Words of the vocabulary that name what is washed."""
_TOLD = {
    "wash-window": ("window", "wall"),
    "wash-table": ("table",),
    "wash-hands": ("hands",),
    "wash-face": ("face",),
    "wash-body": ("body", "self", "shower"),
    "wash-dishes": ("dishes",),
}
_POLE = (0.8, -1.0, -0.2)


def wash(rng: random.Random) -> Gesture:
    form = rng.choices(list(_RUBS), (5, 4, 4, 2, 2, 3))[0]
    rub = _RUBS[form]
    side = rng.choice(SIDES)
    at = np.array([rng.uniform(*limits) for limits in rub["at"]])
    size, rate = rng.uniform(*rub["size"]), rng.uniform(*rub["rate"])
    kind = rng.choice(["across", "up-down", "circles"]) if form in ("wash-window", "wash-table") else ""
    stroke = _stroke(form, kind, size, rng)
    hold = max(rng.uniform(2.6, 6.4), 3.4 / rate)
    pace = GesturePace(rng.uniform(0.1, 0.7), rng.uniform(0.4, 0.8), hold, rng.uniform(0.5, 0.9))
    whole = rng.random() < 0.3  # from the first frame to the last
    if whole:
        pace = GesturePace.lasting(hold)
    stoop = rng.uniform(*{"wash-table": (16, 30), "wash-face": (14, 26), "wash-dishes": (4, 12)}.get(form, (0, 7)))
    turn, look, nod = rng.uniform(0.0, 0.5), rng.uniform(6, 20), rng.uniform(2, 7)
    moves = rng.uniform(0.06, 0.13) if form in ("wash-window", "wash-table") and rng.random() < 0.6 else 0.0
    braced = form == "wash-table" and rng.random() < 0.4
    rest = np.array([rng.uniform(0.05, 0.2), rng.uniform(-0.48, -0.4), rng.uniform(0.24, 0.34)])
    both = form in ("wash-hands", "wash-face")

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = pace.way(body)
        sine = swings(way, rate)
        later = np.interp(t - 0.25 / rate, t, sine, left=0.0)
        end = frames / FPS
        drift = stations(frames, (0.0, 0.3 * end, 0.7 * end, end), ((0.0,), (-1.0,), (1.0,), (0.0,)))
        body.bow(stoop * way, arms_hang=0.0, head=0.0)
        body.lean(look * way, "left", (12,))
        sway = sine if form not in ("wash-face",) else np.zeros(frames)
        body.lean(turn * nod * sway * way, "up", (6, 9))
        along = sine[:, None] * stroke[0]
        rubbing = at + along + later[:, None] * stroke[1] + drift * np.array([moves, 0.0, 0.0])
        body.hold(side, way, rubbing, lag=0.02, pole=_POLE)
        other = rest if braced else _other_hand(form, at, along, rubbing)
        if other is not None:
            body.hold(OTHER_SIDE[side], way, other, lag=0.02, pole=_POLE)

    told = BOTH if both or form == "wash-dishes" else side
    wide = f"{form}-circles" if kind == "circles" else ""
    kinds = [form, "wash" if form in ("wash-hands", "wash-face", "wash-body") else "wipe", wide]
    untrue = "|".join(thing for thing in _THINGS if thing not in _TOLD[form])
    return Gesture(pace.total(rng) if not whole else hold, tuple(filter(None, kinds)), change, told, untrue=untrue)


def _other_hand(form: str, at: Array, along: Array, rubbing: Array) -> Array | None:
    """Where the second hand is, (3,) or (T, 3), None if it hangs.

    Args:
        at: the middle of the first hand's strokes, (3,).
        along, rubbing: (T, 3) the strokes of the first hand, from their middle and from the shoulders.
    """
    if form == "wash-hands":
        return at + np.array([0.01, -0.02, 0.01]) - along
    if form == "wash-face":
        return rubbing
    if form == "wash-dishes":
        return at * np.array([0.0, 1.0, 1.0]) + np.array([0.05, -0.04, 0.04])
    return None


def _stroke(form: str, kind: str, size: float, rng: random.Random) -> Array:
    """Vectors (2, 3) of a stroke: along the swing, and a quarter of it later; outward, up and forward."""
    flat = form == "wash-table"
    up = np.array([0.0, 0.0, 0.7]) if flat else np.array([0.0, 1.0, 0.0])
    across, none = np.array([1.0, 0.0, 0.0]), np.zeros(3)
    if form in ("wash-window", "wash-table"):
        pair = {"across": (across, none), "up-down": (up, none), "circles": (across, rng.choice((-1.0, 1.0)) * up)}[
            kind
        ]
    else:
        pair = {
            "wash-hands": (np.array([0.25, 0.25, 0.95]), none),
            "wash-face": (up, 0.2 * across),
            "wash-body": (np.array([0.4, 0.9, 0.0]), 0.3 * across),
            "wash-dishes": (across, up),
        }[form]
    return size * np.stack(pair)
