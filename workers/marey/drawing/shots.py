"""Guns that are fired, with their recoil."""

from __future__ import annotations

import random
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.drawing.aims import GUNS, TWISTS
from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.parts import GesturePace, respond
from marey.drawing.postures import Posture
from marey.drawing.sequels import Sequel
from marey.drawing.stances import settle, step
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, StandingBody, envelope, stations

Array = NDArray[np.floating]

_KICK = 0.05
"""Seconds in which a shot drives the hands back."""
_FIRES = {
    "shoot-rifle": {"gun": "aim-rifle", "back": (0.035, 0.06), "up": (0.012, 0.03), "fall": (0.22, 0.35)},
    "shoot-shotgun": {"gun": "aim-rifle", "back": (0.07, 0.1), "up": (0.04, 0.075), "fall": (0.35, 0.5)},
    "shoot-burst": {"gun": "aim-rifle", "back": (0.034, 0.046), "up": (0.004, 0.012), "fall": (0.1, 0.13)},
    "shoot-pistol": {"gun": "aim-pistol", "back": (0.035, 0.06), "up": (0.04, 0.09), "fall": (0.25, 0.4)},
    "shoot-one": {"gun": "aim-one", "back": (0.035, 0.06), "up": (0.05, 0.11), "fall": (0.25, 0.42)},
}
"""The gun (see `marey.drawing.aims`), metres by which a shot drives the hands back and up, and seconds in which
they come back."""
_WORDS = {
    "shoot-rifle": "rifle",
    "shoot-shotgun": "shotgun",
    "shoot-burst": "machine",
    "shoot-pistol": "pistol",
    "shoot-one": "pistol",
}
_FARTHEST = (0.2, 0.2, 0.44)
"""Metres of a wrist outward, up and ahead of the middle of the shoulders: an elbow that is locked takes no recoil."""
_SHORTEST = 1.9
"""Seconds of a clip of an aimed gun."""
_PUMP = 0.14
"""Metres by which the hand at the barrel pumps a shotgun."""


def shoot(rng: random.Random) -> Gesture:
    form = rng.choices(list(_FIRES), (4, 3, 3, 4, 3))[0]
    fire = _FIRES[form]
    side = rng.choices(SIDES, (1, 2))[0]
    back, up, fall = (rng.uniform(*fire[name]) for name in ("back", "up", "fall"))
    burst, pumps = form == "shoot-burst", form == "shoot-shotgun" and rng.random() < 0.6
    firing = _Firing(rng, fall, burst=burst, pumps=pumps)
    times = firing.times
    hands, degrees = GUNS[fire["gun"]](rng, side), rng.uniform(*TWISTS[fire["gun"]])
    turned = OTHER_SIDE[side] if fire["gun"] == "aim-rifle" else side
    stoop, head, rock = rng.uniform(2, 10), rng.uniform(0, 7), 60 * back * rng.uniform(0.7, 1.3)
    stance = rng.uniform(0.12, 0.26) if rng.random() < 0.55 else 0.0
    lead = OTHER_SIDE[side] if fire["gun"] == "aim-rifle" else side

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        way = firing.pace.way(body)
        if stance:
            start = firing.pace.start
            for one, sign in ((lead, 1.0), (OTHER_SIDE[lead], -1.0)):
                began = -2.0 if firing.aimed else start + (0.0 if sign > 0 else 0.3)
                step(body, one, (0.03, sign * stance / 2), began, 0.35, turn=4.0 if sign > 0 else 14.0)
            body.shift(-0.02 * way)
            settle(body)
        kick = _recoil(frames, times, fall)
        body.lean(stoop * way - rock * kick, "left")
        respond(body, way, turned, degrees, 0.0)
        body.lean((0.8 if turned == LEFT else -0.8) * degrees * way, "up", (12,))
        body.lean(head * way - 0.3 * rock * kick, "left", (12,))
        pump = _pumps(frames, times, fall) if pumps else np.zeros((frames, 1))
        for one, (aimed_at, pole) in hands.items():
            point = np.minimum(aimed_at, _FARTHEST)
            moved = point + kick[:, None] * np.array([0.0, up, -back])
            if one != side:
                moved = moved - pump * np.array([0.0, 0.02, _PUMP])
            body.hold(one, way, moved, lag=0.0, pole=pole)

    count = "" if burst else ("shoot-once" if len(times) == 1 else "shoot-many")
    kinds = ["shoot", form, count, "shoot-pump" if pumps else ""]
    told = side if form == "shoot-one" else BOTH
    untrue = "|".join(word for word in ("rifle", "pistol", "shotgun", "machine") if word != _WORDS[form])
    return Gesture(firing.seconds, tuple(filter(None, kinds)), change, told, len(times), untrue=untrue)


def drawn_pistol(rng: random.Random, side: str = "", shots: int = 0) -> Gesture:
    """A pistol that is drawn from the hip, aimed and fired.

    Args:
        rng: decides everything that is not given.
        side: of the hand; empty = right.
        shots: how many; 0 = it is aimed alone.
    """
    side, pace = side or RIGHT, rng.uniform(0.95, 1.15)
    back, up, fall = 0.045, rng.uniform(0.05, 0.08), rng.uniform(0.28, 0.36)
    ready, gap = rng.uniform(0.3, 0.5), fall + rng.uniform(0.2, 0.4)
    goes = np.cumsum([rng.uniform(0.2, 0.4), 0.35 * pace, 0.12, 0.22 * pace, 0.32 * pace])
    times = [float(goes[-1]) + ready + k * gap for k in range(shots)]
    lowers = (times[-1] + fall if times else float(goes[-1]) + ready) + rng.uniform(0.5, 0.8)
    grip = np.array([rng.uniform(0.0, 0.05), rng.uniform(-0.02, 0.06), 0.46])
    lean, twist = rng.uniform(3, 7), rng.uniform(8, 16)
    way_of_hand = [_HOLSTER, _HOLSTER, _OUT, tuple(grip), tuple(grip)]

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        way = envelope(frames, float(goes[0]), float(goes[1] - goes[0]), lowers - float(goes[1]), 0.7)
        aimed = envelope(frames, float(goes[3]), float(goes[4] - goes[3]), lowers - float(goes[4]), 0.7)
        kick = _recoil(frames, times, fall)
        body.shift(-0.02 * aimed)
        body.lean(lean * way - 3.0 * kick, "left")
        respond(body, aimed, side, twist, 0.0)
        settle(body)
        hand = stations(frames, (float(goes[0]), *map(float, goes[1:])), way_of_hand)
        body.hold(side, way, hand + kick[:, None] * np.array([0.0, up, -back]), lag=0.0, pole=(0.8, -0.6, -0.6))

    told = ("shoot", "shoot-one", "shoot-drawn") if shots else ("aim", "aim-one", "aim-drawn")
    return Gesture(lowers + 0.7 + rng.uniform(0.25, 0.5), told, change, side, max(shots, 1))


_HOLSTER, _OUT = (0.1, -0.5, -0.02), (0.1, -0.36, 0.08)
"""Metres from the shoulder of the hand at the grip of a pistol at the hip, and as it comes out; see
`StandingBody.hold`."""


class _Firing:
    """When a gun is lifted, fired and lowered.

    Attributes:
        aimed: the gun is up from the first frame to the last.
        times: seconds at which shots go off.
        pace: of the arms.
        seconds: of the gesture.
    """

    def __init__(self, rng: random.Random, fall: float, *, burst: bool, pumps: bool) -> None:
        """Draw the times of a gun whose recoil goes in `fall` seconds."""
        shots = rng.choices((1, 2, 3, 4, 6), (3, 3, 3, 2, 2))[0]
        gap = (rng.uniform(1.1, 1.6) if pumps else rng.uniform(fall + 0.15, fall + 0.7)) if not burst else 0.15
        start, rise, ready = rng.uniform(0.1, 0.7), rng.uniform(0.3, 0.7), rng.uniform(0.2, 0.8)
        self.aimed = rng.random() < 0.4
        if self.aimed:
            start, rise = -1.0, 0.5
            ready += 0.5
        self.times = _times(rng, start + rise + ready, shots, gap, burst)
        if not burst:
            while len(self.times) > 1 and self.times[-1] > 6.2:
                self.times.pop()
        hold = self.times[-1] + fall + (0.9 if pumps else 0.2) + rng.uniform(0.3, 0.9) - start - rise
        if self.aimed:
            hold = max(hold, _SHORTEST - start - rise)
        lower = rise * rng.uniform(0.9, 1.4)
        self.pace = GesturePace(start, rise, hold, 99.0 if self.aimed else lower)
        self.seconds = start + rise + hold + (0.0 if self.aimed else lower + rng.uniform(0.2, 0.8))


def _times(rng: random.Random, first: float, shots: int, gap: float, burst: bool) -> list[float]:
    """Seconds at which shots go off; bursts have several shots each."""
    if not burst:
        return [first + k * gap * (1 + 0.1 * (k % 2)) for k in range(shots)]
    times, at = [], first
    for _ in range(min(shots, 3)):
        count = rng.randint(3, 9)
        times += [at + k * gap for k in range(count)]
        at = times[-1] + rng.uniform(0.5, 0.9)
    return times


def _recoil(frames: int, times: list[float], fall: float) -> Array:
    """Share (frames,) of the recoil: it comes in `_KICK` seconds and goes in `fall`."""
    t = np.arange(frames) / FPS
    kick = np.zeros(frames)
    for at in times:
        x = t - round(at * FPS) / FPS
        kick = np.maximum(kick, np.where(x > 0, np.clip(1 - (x - _KICK) / fall, 0, 1) ** 1.5, 0.0))
    return kick


def _pumps(frames: int, times: list[float], fall: float) -> Array:
    """Share (frames, 1) of the way by which the hand at the barrel is drawn back after each shot."""
    drawn = np.zeros((frames, 1))
    for at in times:
        keys = (0.0, at + 0.5 * fall, at + 0.5 * fall + 0.25, at + 0.5 * fall + 0.5)
        drawn = np.maximum(drawn, stations(frames, keys, ((0.0,), (0.0,), (1.0,), (0.0,))))
    return drawn


_PRONE_KICK, _PRONE_RISE = 0.06, 0.03
"""Metres by which a shot drives the hands of a body on its elbows back and up."""
_AIMS_S, _FALLS_S = 0.6, 0.35
"""Seconds before the first of its shots and after the last, and in which the hands come back."""


def prone_shots(done: Sequel, seconds: float, rng: random.Random) -> Sequel:
    """Return the postures of a body that aims on its front, with the recoil of shots while the longest of them is held.

    Args:
        done: with the posture that is held.
        seconds: that it is held.
        rng: decides when the shots go off.
    """
    held = next(k for k, pair in enumerate(pairwise(done.postures)) if pair[0] is pair[1])
    posture, end = done.postures[held], done.times[held] + seconds
    shots = Sequel(done.times[: held + 1], done.postures[: held + 1])
    shots.then(_AIMS_S, posture)
    while shots.times[-1] + _FALLS_S + 0.1 < end - _AIMS_S or len(shots.times) == held + 2:
        shots.then(_KICK, _kicked(posture))
        shots.then(_FALLS_S, posture, rng.uniform(0.1, 0.3))
    late = shots.times[-1] - end if shots.times[-1] > end else 0.0
    times = [*shots.times, *(time + late for time in done.times[held + 1 :])]
    return Sequel(times, [*shots.postures, *done.postures[held + 1 :]])


def _kicked(posture: Posture) -> Posture:
    """Return a posture with the hands driven back."""
    hands = {
        side: replace(hand, at=(hand.at[0], hand.at[1] + _PRONE_RISE, hand.at[2] - _PRONE_KICK))
        for side, hand in posture.hands.items()
    }
    pitch, roll, yaw = posture.spine
    return replace(posture, hands=hands, spine=(pitch - 2.0, roll, yaw))
