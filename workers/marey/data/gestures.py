"""Synthetic hand gestures, bows and nods on captured idles, for actions that few captures show.

Each gesture modifies a captured idle and keeps its feet, breath and sway; side, height, pace, length and number are
random. These clips are marked as `made`, are used for training only, and are at most half of the draws of an action
(`marey.data.sampling`). `gestures.toml` has captions of each kind in three voices.
"""

from __future__ import annotations

import random
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.data.captions import seeded
from marey.data.compose import TRIES
from marey.data.describe import describe_text
from marey.data.gesture_poses import ARMS, LEFT, RIGHT, StandingBody, direction, envelope, swings, swung
from marey.data.part import FPS, Part
from marey.data.retime import LIMIT
from marey.data.soundness import is_broken
from marey.data.spoken import spoken

Array = NDArray[np.floating]

COUNTS = {"wave": 160, "raise-arm": 160, "bow": 120, "guide": 60, "clap": 60, "nod": 60}
"""Number of clips to make of each action."""
SIDES = (LEFT, RIGHT)
BOTH = "both"
CAPTIONS = 2
"""Number of captions per voice and clip."""
_BASE = "idle"
_LEAST_BASE = 30  # frames of an idle
_STANDS = 0.15  # metres that the hips of an idle may move
_UPRIGHT = 0.88  # metres of the hips over the floor; about 1.0 when upright
_ANKLES = 0.16  # metres over the floor
_HANGS = 0.2  # metres that the wrists are below the shoulders
_ASIDE = 0.42  # metres, horizontal distance of the wrists from the hips
_SLIPS = 0.01  # metres, largest error of a foot after solving the legs
_TIMES = {2: "twice", 3: "three times"}


@dataclass(frozen=True)
class Gesture:
    """A drawn gesture.

    Attributes:
        seconds: its length, including the time standing before and after it.
        kinds: keys of `gestures.toml` that apply to it.
        change: applies it to a body of that length.
        side: left, right, both or empty.
        times: number of bows.
    """

    seconds: float
    kinds: tuple[str, ...]
    change: Callable[[StandingBody], None]
    side: str = ""
    times: int = 1


def made_gestures(parts: Sequence[Part]) -> Iterator[Part]:
    """Make gestures on the idles among the parts of the training split."""
    bases = [part for part in parts if _is_base(part)]
    if not bases:
        return
    for action, wanted in COUNTS.items():
        made = (_made(f"G-{action}-{number:05}", action, bases) for number in range(TRIES * wanted))
        yield from islice((part for part in made if part is not None), wanted)


def _is_base(part: Part) -> bool:
    """Return True for an idle that stands upright on both feet without moving away, with both arms down."""
    joints = part.joints
    if part.content != _BASE or len(joints) < _LEAST_BASE:
        return False
    wrists, shoulders = (joints[:, [ARMS[side][k] for side in SIDES]] for k in (3, 1))
    aside = np.linalg.norm((wrists - joints[:, :1])[..., [0, 2]], axis=-1)
    return bool(
        np.ptp(joints[:, 0], axis=0).max() < _STANDS
        and joints[:, 0, 1].min() > _UPRIGHT
        and joints[:, [7, 8], 1].max() < _ANKLES
        and (shoulders - wrists)[..., 1].min() > _HANGS
        and aside.max() < _ASIDE
    )


def _made(name: str, action: str, bases: Sequence[Part]) -> Part | None:
    rng = seeded("gesture", name)
    gesture = _DRAWS[action](rng)
    frames = round(gesture.seconds * FPS)
    if frames > LIMIT:
        return None
    base = rng.choice(bases)
    standing = _of_length(base.joints.astype(np.float64), frames, rng)
    body = StandingBody(standing)
    gesture.change(body)
    joints = body.solved()
    feet = [7, 8, 10, 11]
    if is_broken(joints, FPS) or np.linalg.norm(joints[:, feet] - standing[:, feet], axis=-1).max() > _SLIPS:
        return None
    told = (*_captions_of(gesture, rng), spoken(action, name))
    source = replace(base.source, content=action, side=gesture.side, captions=told, facts="")
    facts = describe_text(told, joints, FPS)
    return Part(name, source, action, base.mirrored, joints.astype(np.float32), facts, made=True)


def _of_length(joints: Array, frames: int, rng: random.Random) -> Array:
    """Take `frames` frames of an idle; play a shorter one forward and backward, which suits breath and sway."""
    if len(joints) < frames:
        there_and_back = np.concatenate([joints, joints[-2:0:-1]])
        joints = np.tile(there_and_back, (-(-frames // len(there_and_back)), 1, 1))
    first = rng.randint(0, len(joints) - frames)
    return joints[first : first + frames]


def _captions_of(gesture: Gesture, rng: random.Random) -> tuple[tuple[str, ...], ...]:
    """Draw captions of a gesture in each voice, general ones or ones of its special kind."""
    told = []
    for said in _captions().values():
        chosen = [rng.choice(said[rng.choice(gesture.kinds)]) for _ in range(CAPTIONS)]
        texts = (text.format(side=gesture.side, times=_TIMES.get(gesture.times, "")) for text in chosen)
        told.append(tuple(dict.fromkeys(texts)))
    return tuple(told)


@cache
def _captions() -> Mapping[str, Mapping[str, Sequence[str]]]:
    return tomllib.loads(Path(__file__).with_name("gestures.toml").read_text("utf-8"))


# -- hands -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Pace:
    """Timing of a hand that goes up, stays and comes down, in seconds."""

    start: float
    rise: float
    hold: float
    fall: float

    @classmethod
    def draw(cls, rng: random.Random, rise: tuple[float, float], hold: tuple[float, float]) -> _Pace:
        up = rng.uniform(*rise)
        return cls(rng.uniform(0.1, 1.3), up, rng.uniform(*hold), up * rng.uniform(0.9, 1.4))

    @property
    def seconds(self) -> float:
        return self.start + self.rise + self.hold + self.fall

    def total(self, rng: random.Random) -> float:
        """Duration with a random time of standing after it, seconds."""
        return self.seconds + rng.uniform(0.25, 1.3)

    def way(self, body: StandingBody) -> Array:
        return envelope(len(body.joints), self.start, self.rise, self.hold, self.fall)


_WAVES = {
    "wave-high": {"upper": ((20, 100), (5, 60)), "fore": ((30, 90), (72, 88)), "swing": (14, 34)},
    "wave-low": {"upper": ((5, 60), (-72, -40)), "fore": ((10, 50), (35, 70)), "swing": (17, 34)},
    "wave-whole": {"upper": ((40, 95), (50, 75)), "fore": ((40, 90), (70, 85)), "swing": (10, 18)},
}
"""Azimuths and elevations of upper arm and forearm, and the swing of the forearm to each side, degrees."""


def _wave(rng: random.Random) -> Gesture:
    form = rng.choices(list(_WAVES), (5, 3, 2))[0]
    tempo = rng.choice(["slow", "", "fast"])
    rate = {"slow": rng.uniform(1.2, 1.6), "": rng.uniform(1.6, 2.4), "fast": rng.uniform(2.4, 3.2)}[tempo]
    length = rng.choice(["brief", "", "", "long"])
    hold = {"brief": (1.3 / rate, 1.7 / rate), "": (2.0 / rate, 3.4), "long": (4.2, 6.5)}[length]
    pace = _Pace.draw(rng, (0.35, 0.9), hold)
    side = rng.choices([*SIDES, BOTH], (4, 4, 1))[0]
    arms = {one: _drawn_arm(rng, _WAVES[form]) for one in _arms(side)}
    whole = rng.uniform(0.5, 0.9) if form == "wave-whole" else rng.uniform(0, 0.15)
    twist, sway = rng.uniform(-2, 8), rng.uniform(0, 4)
    inward = rng.choice((-1.0, 1.0))

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        swing = inward * swings(way, rate)
        _respond(body, way, side, twist, sway)
        for one, arm in arms.items():
            upper = swung(arm.upper, whole * arm.swing * swing)
            body.move_arm(one, way, upper, swung(arm.fore, arm.swing * (1 + whole) * swing), arm.lag)

    if side == BOTH:
        return Gesture(pace.total(rng), ("wave-both",), change, side)
    kinds = ["wave", "wave-low" if form == "wave-low" else "wave-high"]
    kinds += [f"wave-{word}" for word in (tempo, length) if word]
    return Gesture(pace.total(rng), tuple(kinds), change, side)


_RAISES = {
    "raise-up": {"upper": ((10, 90), (64, 86)), "fore": ((0, 90), (74, 89))},
    "raise-side": {"upper": ((76, 102), (14, 50)), "fore": ((70, 100), (22, 62))},
    "raise-ahead": {"upper": ((-5, 24), (14, 50)), "fore": ((-8, 22), (20, 60))},
    "raise-bent": {"upper": ((30, 95), (-5, 35)), "fore": ((20, 90), (72, 89))},
}


def _raise_arm(rng: random.Random) -> Gesture:
    side = rng.choices([*SIDES, BOTH], (4, 4, 2))[0]
    form = "raise-up" if side == BOTH else rng.choice(list(_RAISES))
    length = rng.choice(["quick", "", "", "long"])
    rise = {"quick": (0.3, 0.45), "": (0.45, 1.1), "long": (0.5, 1.4)}[length]
    hold = {"quick": (0.3, 0.5), "": (0.5, 2.0), "long": (2.2, 5.5)}[length]
    pace = _Pace.draw(rng, rise, hold)
    arms = {one: _drawn_arm(rng, _RAISES[form]) for one in _arms(side)}
    twist, sway = rng.uniform(-2, 6), rng.uniform(0, 5)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        _respond(body, way, side, twist, sway)
        for one, arm in arms.items():
            body.move_arm(one, way, arm.upper, arm.fore, arm.lag)

    if side == BOTH:
        return Gesture(pace.total(rng), ("raise-both",), change, side)
    kinds = ("raise", form, *([f"raise-{length}"] if length else []))
    return Gesture(pace.total(rng), kinds, change, side)


_GUIDES = {
    "guide-side": {"upper": ((62, 98), (-42, -12)), "fore": ((60, 95), (-14, 18))},
    "guide-ahead": {"upper": ((0, 32), (-42, -12)), "fore": ((0, 32), (-14, 18))},
}


def _guide(rng: random.Random) -> Gesture:
    form, side = rng.choice(list(_GUIDES)), rng.choice(SIDES)
    pace = _Pace.draw(rng, (0.45, 1.1), (0.7, 2.5))
    arm = _drawn_arm(rng, _GUIDES[form])
    twist, stoop = rng.uniform(0, 14), rng.uniform(0, 14)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        body.lean(stoop * way, "left")
        _respond(body, way, side, twist, 0.0)
        body.move_arm(side, way, arm.upper, arm.fore, arm.lag)

    return Gesture(pace.total(rng), (form,), change, side)


def _clap(rng: random.Random) -> Gesture:
    high = rng.random() < 0.3
    tempo = rng.choice(["slow", "", "", "fast"])
    rate = {"slow": rng.uniform(1.1, 1.6), "": rng.uniform(1.7, 2.4), "fast": rng.uniform(2.6, 3.4)}[tempo]
    pace = _Pace.draw(rng, (0.4, 0.9), (3.6 / rate, 5.0))
    above = rng.uniform(0.02, 0.4) if high else rng.uniform(-0.28, -0.06)
    ahead = rng.uniform(0.2, 0.3) if high else rng.uniform(0.27, 0.36)
    apart = rng.uniform(0.1, 0.22)

    def change(body: StandingBody) -> None:
        way = pace.way(body)
        gap = 0.05 + apart * (0.5 - 0.5 * swings(way, rate))
        middle = body.joints[:, [ARMS[side][1] for side in SIDES]].mean(1)
        for side in SIDES:
            seen = body.from_shoulder(side, middle)
            target = np.stack([seen[:, 0] + gap, seen[:, 1] + above, seen[:, 2] + ahead], axis=-1)
            body.move_arm(side, way, *body.reach(side, target), 0.03)

    kinds = ("clap-high" if high else "clap", *([f"clap-{tempo}"] if tempo else []))
    return Gesture(pace.total(rng), kinds, change, BOTH)


@dataclass(frozen=True)
class _Arm:
    """Final directions of an arm, its swing in degrees, and the delay of the forearm in seconds."""

    upper: Array
    fore: Array
    swing: float
    lag: float


def _drawn_arm(rng: random.Random, form: Mapping[str, tuple]) -> _Arm:
    upper, fore = (direction(*(rng.uniform(*limits) for limits in form[bone])) for bone in ("upper", "fore"))
    return _Arm(upper, fore, rng.uniform(*form.get("swing", (0, 0))), rng.uniform(0.0, 0.12))


def _arms(side: str) -> tuple[str, ...]:
    return SIDES if side == BOTH else (side,)


def _respond(body: StandingBody, way: Array, side: str, twist: float, sway: float) -> None:
    """Turn the trunk towards a lifted arm by `twist` and lean it away by `sway`, in degrees."""
    if side != BOTH:
        sign = 1.0 if side == LEFT else -1.0
        body.lean(sign * sway * way, "forward")
        body.lean(-sign * twist * way, "up", (6, 9))


# -- trunk and head --------------------------------------------------------------------------------------------------

_SLIGHT, _DEEP = 36.0, 66.0
"""Degrees of a bow from the hips to the neck; the trunk as a whole tilts by three quarters of this."""


def _bow(rng: random.Random) -> Gesture:
    degrees = rng.choice([rng.uniform(24, _SLIGHT), rng.uniform(_SLIGHT, _DEEP), rng.uniform(_DEEP, 90)])
    times = rng.choices((1, 2, 3), (8, 1, 1))[0]
    tempo = rng.choice(["quick", "", "", "slow"])
    rise = {"quick": (0.35, 0.55), "": (0.6, 1.1), "slow": (1.0, 1.6)}[tempo]
    hold = {"quick": (0.05, 0.2), "": (0.15, 0.9), "slow": (1.0, 2.0)}[tempo]
    paces = [_Pace.draw(rng, rise, hold)]
    for _ in range(times - 1):
        one = replace(paces[0], start=paces[-1].seconds + rng.uniform(0.0, 0.3))
        paces.append(one)
    hand = rng.choice(SIDES) if rng.random() < 0.25 else ""
    arms_hang, head = rng.uniform(0.1, 0.9) if not hand else 0.0, rng.uniform(-0.15, 0.3)
    belly = rng.uniform(0.1, 0.28), rng.uniform(0.17, 0.22)

    def change(body: StandingBody) -> None:
        ways = [pace.way(body) for pace in paces]
        if hand:
            first, last = paces[0].start, paces[-1].seconds
            held = envelope(len(body.joints), max(first - 0.5, 0.0), 0.5, last - first, 0.6)
            pelvis = body.from_shoulder(hand, body.joints[:, 0])
            target = pelvis + np.array([0.02, belly[0], belly[1]])
            body.move_arm(hand, held, *body.reach(hand, target), 0.0)
        body.bow(degrees * np.sum(ways, axis=0), arms_hang=arms_hang, head=head)

    depth = "bow-deep" if degrees > _DEEP else "bow-slight" if degrees < _SLIGHT else ""
    kinds = ["bow", depth, f"bow-{tempo}" if tempo else "", "bow-hand" if hand else ""]
    if times > 1:
        kinds = ["bow-repeated"]
    return Gesture(paces[-1].total(rng), tuple(filter(None, kinds)), change, hand, times)


def _nod(rng: random.Random) -> Gesture:
    tempo = rng.choice(["slow", "", "quick"])
    rate = {"slow": rng.uniform(0.7, 1.0), "": rng.uniform(1.0, 1.7), "quick": rng.uniform(1.9, 2.6)}[tempo]
    degrees = rng.uniform(8, 12) if tempo == "quick" else rng.uniform(9, 18)
    pace = _Pace.draw(rng, (0.2, 0.4), (2.2 / rate, 4.5 / rate))
    neck = rng.uniform(0.1, 0.3)

    def change(body: StandingBody) -> None:
        down = degrees * (0.5 - 0.5 * np.cos(np.pi * pace.way(body))) * (0.6 + swings(pace.way(body), rate))
        body.lean(neck * down, "left", (9,))
        body.lean((1 - neck) * down, "left", (12,))

    return Gesture(pace.total(rng), ("nod", *([f"nod-{tempo}"] if tempo else [])), change)


_DRAWS: Mapping[str, Callable[[random.Random], Gesture]] = {
    "wave": _wave,
    "raise-arm": _raise_arm,
    "bow": _bow,
    "guide": _guide,
    "clap": _clap,
    "nod": _nod,
}
