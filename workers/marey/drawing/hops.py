"""Hops on one foot, jumps on the spot and ahead."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.flights import StandingFeet, StandingFoot, fly, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, both, near
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import LEVEL
from marey.posing.standing import LEFT, RIGHT, SIGN, StandingBody, eased

Array = NDArray[np.floating]

_LONGEST = 7.6
"""Seconds of all hops or jumps."""
_LEAVES = 45.0
"""Degrees by which a foot points down when it leaves the floor; the ankle moves by less than a step does."""
_FAR = 0.95
"""Metres of a jump that is called long."""
_QUICK_DIP, _QUICK_CROUCH_S, _QUICK_RISE_S = 0.08, 0.2, 0.12
"""Metres by which the hips go down before a quick jump, and seconds of that and of leaving the floor."""
_CROUCHED_M = 0.5
"""Metres of the hips in a crouch."""
_FEET, _OFF = [7, 8, 10, 11], 0.02
"""Joints of the feet, and metres by which all are higher than at first in a flight."""
_FREE = {
    "hop-behind": (FootPlace((0.09, 0.36, -0.32), (0, -0.75, -0.6)), (0.1, -0.3, 1.0)),
    "hop-bent": (FootPlace((0.1, 0.26, -0.12), (0, -0.9, 0.25)), (0.1, 0.1, 1.0)),
    "hop-knee": (FootPlace((0.08, 0.44, 0.16), (0, -0.6, 0.8)), (0.1, 0.5, 1.0)),
}
"""Where the lifted foot is, and where its knee points."""
_ARMS = {
    "out": HandPlace((0.44, -0.12, 0.06), "shoulder", (0.1, -0.9, -0.4)),
    "low": HandPlace((0.3, -0.38, 0.04), "shoulder", (0.4, -0.2, -0.9)),
    "bent": HandPlace((0.12, -0.26, 0.22), "shoulder", (0.5, -0.5, -0.8)),
}


def hop(rng: random.Random, *, times: int | None = None) -> Gesture:
    """Drawn for the right foot and mirrored for the left one; the left foot is lifted."""
    return _hops(_Hops(rng, times))


def hop_away(rng: random.Random, times: int, left: float, ahead: float, side: str = "") -> Gesture:
    """Hops on one foot, that of `side` unless it is empty, in a direction: metres of each."""
    drawn = _Hops(rng, times)
    drawn.side = side or drawn.side
    drawn.aside, drawn.stride = -SIGN[drawn.side] * left, ahead
    return _hops(drawn)


def _hops(drawn: _Hops) -> Gesture:
    times, form, stride = drawn.times, drawn.form, drawn.stride
    kinds = ["hop", "hop-ahead" if stride else "hop-place", "hop-once" if times == 1 else "hop-many", form]
    if form == "hop-bent":
        kinds.pop()
    untrue = "bunny|place" if stride else "bunny|around|along"
    side = drawn.side
    gesture = on_feet(drawn.sequel, kinds, drawn.after, side=side, mirror=side == LEFT, times=times)
    return replace(gesture, untrue=untrue)


class _Hops:
    """Hops on the right foot.

    Attributes:
        side: of the foot that is hopped on once the gesture is mirrored.
        form: key of `_FREE`, for the lifted foot, which is at `free`, its knee toward `knee`.
        times: number of hops.
        stride, aside: metres ahead and to the left of each, before it is mirrored.
        flight, more, ground: seconds of a flight, a factor of it for each hop, and seconds on the floor between.
        arms, swing: key of `_ARMS`, and metres by which the hands go up and down.
        dip, deep, lean: metres by which the hips go down at a hop and at a landing more, and degrees of the trunk.
        starts, lift, after: seconds of standing before, of lifting the foot, and of standing after it.
    """

    def __init__(self, rng: random.Random, times: int | None) -> None:
        self.side = rng.choice(SIDES)
        self.flight, self.ground = rng.uniform(0.22, 0.36), rng.uniform(0.24, 0.4)
        self.times = times or rng.randint(1, min(9, int(_LONGEST / (self.flight + self.ground)) - 2))
        self.stride, self.aside = rng.choice((0.0, rng.uniform(0.2, 0.55))), 0.0
        self.form = rng.choices(list(_FREE), (4, 3, 2))[0]
        free, self.knee = _FREE[self.form]
        self.free = replace(free, at=near(rng, free.at, 0.03))
        self.arms, self.swing = rng.choice(list(_ARMS)), rng.uniform(0.02, 0.1)
        self.dip, self.deep = rng.uniform(0.05, 0.09), rng.uniform(0.0, 0.03)
        self.lean = rng.uniform(2, 9)
        self.starts, self.lift = rng.uniform(0.15, 0.7), rng.uniform(0.3, 0.5)
        self.more = [rng.uniform(0.93, 1.07) for _ in range(self.times)]
        self.after = rng.uniform(0.3, 0.7)

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        on, done = feet[RIGHT], Sequel([self.starts])
        low = 0.92 - self.dip
        done.then(self.lift, Posture((-on.out + 0.02, 0.92, on.forward - 0.02), (2, 0, 0), (3, 0, 0)))
        done.then(self.lift, self._at(on, 0.92, 0.0, on.flat(), 0.0), 0.1)
        done.then(0.6 * self.ground, self._at(on, low, 0.0, on.flat(), -1.0))
        for k in range(self.times):
            flat, last = on.flat(*self._moved(k + 1)), k == self.times - 1
            self._hop(done, on, k)
            done.then(0.08, self._at(on, 0.91, k + 0.92, flat, 0.0))
            landed = self._at(on, low - self.deep, k + 1, flat, -1.0)
            done.then(0.47 * self.ground, landed, 0.15 if last else 0.0)
        forward, _, left = self._moved(self.times)
        done.then(0.35, self._at(on, 0.92, self.times, on.flat(forward, left=left), 0.0), 0.1)
        down = {one: foot.flat(forward, left=left) for one, foot in feet.items()}
        done.then(0.45, Posture((left, 0.93, forward), feet=down) if forward or left else STAND)
        return done

    def _hop(self, done: Sequel, on: StandingFoot, k: int) -> None:
        """Add the way up to the toes and the flight of hop `k`."""
        leaving = self._at(on, 0.955, k + 0.22, on.tiptoe(_LEAVES, *self._moved(k)), 1.0)
        landing = self._at(on, 0.94, k + 0.8, on.tiptoe(38, *self._moved(k + 1)), 0.4)

        def shaped(share: float, rise: float) -> Posture:
            """The foot hangs with its toes down and goes where the hop does."""
            up = rise + 0.03 * (1 - abs(2 * share - 1))
            foot = on.tiptoe(58 - 18 * share, *self._moved(k + share, up))
            return self._at(on, 0.95 + rise, k + share, foot, 1.0)

        done.then(0.45 * self.ground, leaving)
        fly(done, self.flight * self.more[k], leaving, landing, shaped)

    def _moved(self, hops: float, up: float = 0.0) -> tuple[float, float, float]:
        """Metres ahead, up and to the left of a foot after so many hops."""
        return hops * self.stride, up, hops * self.aside

    def _at(self, on: StandingFoot, up: float, hops: float, foot: FootPlace, high: float) -> Posture:
        """The posture with the hips `up` over the floor, after so many hops; `high`: share of the hands' swing."""
        hand, free, lean = _ARMS[self.arms], self.free, self.lean + 8 * self.stride
        ahead, _, left = self._moved(hops)
        lifted = replace(hand, at=(hand.at[0], hand.at[1] + self.swing * high, hand.at[2]))
        raised = replace(free, at=(free.at[0] + left, free.at[1] + up - 0.9, free.at[2] + ahead))
        return Posture(
            (left - on.out + 0.02, up, on.forward + ahead - 0.02),
            (lean, 2, 0),
            (lean, 0, 0),
            hands=both(lifted),
            feet={LEFT: raised, RIGHT: foot},
            knees={LEFT: self.knee},
        )


_REACH = HandPlace((0.16, 0.42, 0.14), "shoulder", (0.8, 0.2, 0.2))
_SWUNG = {
    "back": HandPlace((0.2, -0.36, -0.26), "shoulder", (0.4, -0.2, -0.9)),
    "low": HandPlace((0.18, -0.42, 0.18), "shoulder", (0.6, -0.2, -0.8)),
    "bent": HandPlace((0.12, -0.24, 0.26), "shoulder", (0.6, -0.6, -0.6)),
    "ahead": HandPlace((0.1, 0.04, 0.46), "shoulder", (0.6, -0.7, 0.0)),
    "up": _REACH,
    "side": HandPlace((0.44, -0.04, 0.12), "shoulder", (0.1, -0.9, -0.4)),
}


_SWING_S = 0.14
"""Seconds in which hands that were swung back come past the hips; straight up from there they would pass the shoulder,
about which the elbow would whip."""


def jump(rng: random.Random, *, times: int | None = None) -> Gesture:
    return _jump(rng, 0.0, times)


def jump_forward(rng: random.Random, *, times: int | None = None) -> Gesture:
    return _jump(rng, rng.choice((rng.uniform(0.68, _FAR), rng.uniform(_FAR, 1.5))), times)


def _jump(rng: random.Random, ahead: float, times: int | None) -> Gesture:
    form = rng.choices(["jump-small", "jump-mid", "jump-high"], (3, 4, 3) if not ahead else (0, 3, 2))[0]
    flight = rng.uniform(*{"jump-small": (0.32, 0.37), "jump-mid": (0.38, 0.47), "jump-high": (0.48, 0.56)}[form])
    usual = 2 if form != "jump-high" and not ahead else 0
    times = times or rng.choices((1, 2, 3, 5), (5, 2, 2, usual))[0]
    flight = min(max(flight, ahead / 2.9), 0.58)
    tuck = rng.uniform(0.12, 0.24) if flight > 0.44 and rng.random() < 0.35 else rng.uniform(0.0, 0.04)
    name = "ahead" if ahead else "jump"
    size = "ahead-far" if ahead > _FAR else ("" if ahead else form)
    kinds = [name, size, f"{name}-many" if times > 1 else f"{name}-once", f"{name}-tuck" if tuck > 0.1 else ""]
    untrue = "onto|lunge|possible" if ahead else "joy"
    untrue += "|down|bounce|hop" if times == 1 and not ahead else ""
    untrue += "|high" if form != "jump-high" else ""
    untrue += "|long|broad|far" if 0 < ahead < _FAR else ""
    return replace(jumps(rng, kinds, rng.uniform(0.15, 0.8), flight, times, ahead=ahead, tuck=tuck), untrue=untrue)


def jump_aside(rng: random.Random, flight: float, times: int, metres: float, *, low: bool = False) -> Gesture:
    """Quick jumps of both feet to the left, by so many metres each; less than 0 = to the right. `low`: as in
    `jumps`."""
    starts = rng.uniform(0.55, 0.8)
    gesture = jumps(rng, ["jump-aside"], starts, flight, times, aside=metres, quick=True, low=low)
    return replace(gesture, side=LEFT if metres > 0 else RIGHT)


def jump_turned(rng: random.Random, degrees: float) -> Gesture:
    """A jump of both feet on the spot, in which the body turns by `degrees`, positive to the left."""
    flight = rng.uniform(0.46, 0.52) + 0.06 * min(abs(degrees) / 360, 1.0)
    gesture = jumps(rng, ["jump-turn"], rng.uniform(0.25, 0.6), flight, 1, tuck=rng.uniform(0.02, 0.1))

    def change(body: StandingBody) -> None:
        gesture.change(body)
        _turn_in_flight(body.joints, degrees)

    return replace(gesture, change=change, side=LEFT if degrees > 0 else RIGHT)


def _turn_in_flight(joints: Array, degrees: float) -> None:
    """Turn a body (T, 22, 3) about itself while both feet are off the floor, and everything after it as far."""
    feet = joints[:, _FEET, 1]
    flies = np.flatnonzero((feet - feet[0]).min(axis=1) > _OFF)
    first, last = (int(flies[0]) - 1, int(flies[-1]) + 1) if len(flies) else (0, len(joints) - 1)
    share = eased((np.arange(len(joints)) - first) / max(last - first, 1))
    pivots = joints[np.minimum(np.arange(len(joints)), last), 0] * LEVEL
    turned = from_rotvec(np.array([0.0, 1.0, 0.0]) * np.radians(degrees * share)[:, None])
    joints[:] = rotate(turned[:, None], joints - pivots[:, None]) + pivots[:, None]


def jumps(
    rng: random.Random,
    kinds: Sequence[str],
    starts: float,
    flight: float,
    times: int,
    *,
    ahead: float = 0.0,
    aside: float = 0.0,
    tuck: float = 0.0,
    quick: bool = False,
    low: bool = False,
) -> Gesture:
    """Jumps of both feet.

    Args:
        rng: draws the rest.
        kinds: see `Gesture`.
        starts: seconds of standing before.
        flight: seconds of each flight.
        times: number of jumps.
        ahead: metres of each; less than 0 = back.
        aside: metres of each to the left; less than 0 = to the right.
        tuck: metres by which the feet are drawn up.
        quick: at once, without a swing of the arms.
        low: the last one ends in a crouch.
    """
    drawn = _Jumps(rng, starts, flight, times, ahead=ahead, tuck=tuck, low=low)
    drawn.aside = aside
    if quick:
        drawn.hurry()
    return on_feet(drawn.sequel, kinds, drawn.after, times=times)


class _Jumps:
    """Jumps of both feet; see `jumps`.

    Attributes:
        dip, land: metres by which the hips go down before a jump, and when they land.
        back, arms: where the hands are before a flight, and in it; keys of `_SWUNG`.
        crouch, rise, absorb, straighten, after: seconds of going down, of leaving the floor, of landing, of standing
            up, and of standing after it.
        gaze: degrees of the neck.
        low: they end in a crouch.
    """

    def __init__(
        self, rng: random.Random, starts: float, flight: float, times: int, *, ahead: float, tuck: float, low: bool
    ) -> None:
        self.low = low
        self.starts, self.flight, self.times, self.ahead, self.tuck = starts, flight, times, ahead, tuck
        self.aside = 0.0
        self.dip = 0.1 + 0.75 * (flight - 0.3) + rng.uniform(0.0, 0.06)
        self.land = 0.12 + 0.5 * (flight - 0.3) + rng.uniform(0.0, 0.05)
        self.arms = rng.choice(["up", "ahead", "bent", "side"] if flight < 0.45 else ["up", "up", "ahead"])
        self.crouch, self.rise = rng.uniform(0.32, 0.6), rng.uniform(0.17, 0.22)
        self.absorb, self.after = rng.uniform(0.16, 0.24), rng.uniform(0.3, 0.9)
        self.back = rng.choice(("back", "bent")) if times == 1 or self.arms != "bent" else "bent"
        self.gaze, self.straighten = rng.uniform(-6, 4), rng.uniform(0.4, 0.7)

    def hurry(self) -> None:
        """Leave the floor at once, the hands before the body."""
        self.dip, self.crouch, self.rise = _QUICK_DIP, _QUICK_CROUCH_S, _QUICK_RISE_S
        self.back = self.arms = "bent"

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        done.then(self.crouch, self._crouched(feet, 0, 0.8), 0.04)
        for k in range(self.times):
            self._jump(done, feet, k)
            flat, land = self._flat(feet, k + 1), self.land
            done.then(0.07, self._at(0.915 - 0.35 * land, k + 0.9, flat, _SWUNG["bent"], 40 * land, 20 * land))
            if k == self.times - 1 and self.low:
                crouch = self._at(_CROUCHED_M, k + 1, flat, _SWUNG["bent"], 34, 22, back=0.06)
                done.then(1.4 * self.absorb, crouch, 0.7)
                return done
            if k < self.times - 1:
                done.then(self.absorb, self._crouched(feet, k + 1, 0.6))
            else:
                soft = self._at(0.92 - land, k + 1, flat, _SWUNG["bent"], 70 * land, 50 * land, back=0.3 * land)
                done.then(self.absorb, soft, 0.05)
        ahead, _, left = self._moved(self.times)
        end = Posture((left, 0.935, ahead), feet=self._flat(feet, self.times)) if ahead or left else STAND
        done.then(self.straighten, end)
        return done

    def _jump(self, done: Sequel, feet: StandingFeet, k: int) -> None:
        """Add the way up to the toes and the flight of jump `k`."""
        ahead, arms = self.ahead, _SWUNG[self.arms]
        lean = 4 + 16 * ahead
        leaving = self._at(0.975 - 0.05 * ahead, k + 0.26, self._tiptoe(feet, _LEAVES, k), arms, lean)
        landing = self._at(0.93 - 0.05 * ahead, k + 0.84, self._tiptoe(feet, 36, k + 1), _SWUNG["bent"], 0.6 * lean)

        def shaped(share: float, up: float) -> Posture:
            drawn = self.tuck * (1 - (2 * share - 1) ** 2)
            there = k + share + 0.25 * share * (1 - share)
            pointed = 66 - 26 * share - 20 * min(ahead, 1.0) * share
            hands = arms if share < 0.6 else _SWUNG["side" if self.arms != "bent" else "bent"]
            toes = self._tiptoe(feet, pointed, there, up + drawn)
            return self._at(0.95 + up, there, toes, hands, lean * (1 - share), 4 + 40 * drawn)

        if self.back == "back":
            done.then(_SWING_S, replace(self._crouched(feet, k, 0.6), hands=both(_SWUNG["low"])))
        done.then(self.rise, leaving)
        fly(done, self.flight, leaving, landing, shaped)

    def _crouched(self, feet: StandingFeet, jumps: int, bent: float) -> Posture:
        """The posture before a jump; `bent`: share of the hips' lean that the spine leans too."""
        lean = 60 * self.dip
        hand, back = _SWUNG[self.back], 0.3 * self.dip
        return self._at(0.92 - self.dip, jumps, self._flat(feet, jumps), hand, lean, bent * lean, back=back)

    def _at(
        self,
        up: float,
        jumps: float,
        feet: dict[str, FootPlace],
        hands: HandPlace,
        lean: float,
        spine: float = 0.0,
        *,
        back: float = 0.0,
    ) -> Posture:
        """The posture with the hips `up` over the floor, after so many jumps and metres `back`."""
        ahead, _, left = self._moved(jumps)
        neck = (self.gaze - 0.5 * lean, 0, 0)
        return Posture((left, up, ahead - back), (lean, 0, 0), (spine, 0, 0), neck, hands=both(hands), feet=feet)

    def _moved(self, jumps: float, up: float = 0.0) -> tuple[float, float, float]:
        """Metres ahead, up and to the left of a foot after so many jumps."""
        return jumps * self.ahead, up, jumps * self.aside

    def _flat(self, feet: StandingFeet, jumps: float) -> dict[str, FootPlace]:
        return {side: foot.flat(*self._moved(jumps)) for side, foot in feet.items()}

    def _tiptoe(self, feet: StandingFeet, degrees: float, jumps: float, up: float = 0.0) -> dict[str, FootPlace]:
        return {side: foot.tiptoe(degrees, *self._moved(jumps, up)) for side, foot in feet.items()}
