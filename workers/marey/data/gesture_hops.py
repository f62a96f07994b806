"""Hops on one foot, jumps on the spot and ahead; see `marey.data.gestures`."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace

from marey.data.gesture_drawing import SIDES, Gesture
from marey.data.gesture_flights import StandingFoot, fly, on_feet
from marey.data.gesture_poses import LEFT, RIGHT
from marey.data.gesture_postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.data.gesture_sequels import Sequel, both, near

_LONGEST = 7.6
"""Seconds of all hops or jumps."""
_LEAVES = 45.0
"""Degrees by which a foot points down when it leaves the floor; the ankle moves by less than a step does."""
_FAR = 0.95
"""Metres of a jump that is called long."""
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


def hop(rng: random.Random) -> Gesture:
    """Drawn for the right foot and mirrored for the left one; the left foot is lifted."""
    side = rng.choice(SIDES)
    flight, ground = rng.uniform(0.22, 0.36), rng.uniform(0.24, 0.4)
    times = rng.randint(1, min(9, int(_LONGEST / (flight + ground)) - 2))
    stride = rng.choice((0.0, rng.uniform(0.2, 0.55)))
    form = rng.choices(list(_FREE), (4, 3, 2))[0]
    free, knee = _FREE[form]
    free = replace(free, at=near(rng, free.at, 0.03))
    arms, swing = rng.choice(list(_ARMS)), rng.uniform(0.02, 0.1)
    dip, deep, lean = rng.uniform(0.05, 0.09), rng.uniform(0.0, 0.03), rng.uniform(2, 9) + 8 * stride
    starts, lift = rng.uniform(0.15, 0.7), rng.uniform(0.3, 0.5)
    more = [rng.uniform(0.93, 1.07) for _ in range(times)]
    after = rng.uniform(0.3, 0.7)

    def sequel(feet: dict[str, StandingFoot]) -> Sequel:
        on = feet[RIGHT]

        def at(up: float, where: float, foot: FootPlace | None, high: float) -> Posture:
            hand = _ARMS[arms]
            lifted = replace(hand, at=(hand.at[0], hand.at[1] + swing * high, hand.at[2]))
            raised = replace(free, at=(free.at[0], free.at[1] + up - 0.9, free.at[2] + where))
            places = {LEFT: raised, RIGHT: foot} if foot else {LEFT: raised}
            pelvis: Point = (-on.out + 0.02, up, on.forward + where - 0.02)
            return Posture(pelvis, (lean, 2, 0), (lean, 0, 0), hands=both(lifted), feet=places, knees={LEFT: knee})

        done = Sequel([starts])
        done.then(lift, Posture((-on.out + 0.02, 0.92, on.forward - 0.02), (2, 0, 0), (3, 0, 0)))
        done.then(lift, at(0.92, 0.0, on.flat(), 0.0), 0.1)
        done.then(0.6 * ground, at(0.92 - dip, 0.0, on.flat(), -1.0))
        for k in range(times):
            here, there, seconds = k * stride, (k + 1) * stride, flight * more[k]
            leaving = at(0.955, here + 0.22 * stride, on.tiptoe(_LEAVES, here), 1.0)
            landing = at(0.94, there - 0.2 * stride, on.tiptoe(38, there), 0.4)
            done.then(0.45 * ground, leaving)

            def shaped(share: float, rise: float, here: float = here) -> Posture:
                """The foot hangs with its toes down and goes ahead."""
                moved = here + share * stride
                foot = on.tiptoe(58 - 18 * share, moved, rise + 0.03 * (1 - abs(2 * share - 1)))
                return at(0.95 + rise, moved, foot, 1.0)

            fly(done, seconds, leaving, landing, shaped)
            last = k == times - 1
            done.then(0.08, at(0.91, there - 0.08 * stride, on.flat(there), 0.0))
            done.then(0.47 * ground, at(0.92 - dip - deep, there, on.flat(there), -1.0), 0.15 if last else 0.0)
        end = times * stride
        done.then(0.35, at(0.92, end, on.flat(end), 0.0), 0.1)
        down = {one: foot.flat(end) for one, foot in feet.items()}
        done.then(0.45, Posture((0.0, 0.93, end), feet=down) if stride else STAND)
        return done

    kinds = ["hop", "hop-ahead" if stride else "hop-place", "hop-once" if times == 1 else "hop-many", form]
    if form == "hop-bent":
        kinds.pop()
    untrue = "bunny|place" if stride else "bunny|around|along"
    return replace(on_feet(sequel, kinds, after, side=side, mirror=side == LEFT, times=times), untrue=untrue)


_REACH = HandPlace((0.16, 0.42, 0.14), "shoulder", (0.8, 0.2, 0.2))
_SWUNG = {
    "back": HandPlace((0.2, -0.36, -0.26), "shoulder", (0.4, -0.2, -0.9)),
    "bent": HandPlace((0.12, -0.24, 0.26), "shoulder", (0.6, -0.6, -0.6)),
    "ahead": HandPlace((0.1, 0.04, 0.46), "shoulder", (0.6, -0.7, 0.0)),
    "up": _REACH,
    "side": HandPlace((0.44, -0.04, 0.12), "shoulder", (0.1, -0.9, -0.4)),
}


def jump(rng: random.Random) -> Gesture:
    return _jump(rng, ahead=0.0)


def jump_forward(rng: random.Random) -> Gesture:
    return _jump(rng, ahead=rng.choice((rng.uniform(0.68, _FAR), rng.uniform(_FAR, 1.5))))


def _jump(rng: random.Random, ahead: float) -> Gesture:
    form = rng.choices(["jump-small", "jump-mid", "jump-high"], (3, 4, 3) if not ahead else (0, 3, 2))[0]
    flight = rng.uniform(*{"jump-small": (0.32, 0.37), "jump-mid": (0.38, 0.47), "jump-high": (0.48, 0.56)}[form])
    times = rng.choices((1, 2, 3, 5), (5, 2, 2, 2 if form != "jump-high" and not ahead else 0))[0]
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


def jumps(
    rng: random.Random,
    kinds: Sequence[str],
    starts: float,
    flight: float,
    times: int,
    *,
    ahead: float = 0.0,
    tuck: float = 0.0,
) -> Gesture:
    """Jumps of both feet.

    Args:
        rng: draws the rest.
        kinds: see `Gesture`.
        starts: seconds of standing before.
        flight: seconds of each flight.
        times: number of jumps.
        ahead: metres of each.
        tuck: metres by which the feet are drawn up.
    """
    dip = 0.1 + 0.75 * (flight - 0.3) + rng.uniform(0.0, 0.06)
    land = 0.12 + 0.5 * (flight - 0.3) + rng.uniform(0.0, 0.05)
    arms = rng.choice(["up", "ahead", "bent", "side"] if flight < 0.45 else ["up", "up", "ahead"])
    crouch, rise = rng.uniform(0.32, 0.6), rng.uniform(0.17, 0.22)
    absorb, after = rng.uniform(0.16, 0.24), rng.uniform(0.3, 0.9)
    back = rng.choice(("back", "bent")) if times == 1 or arms != "bent" else "bent"
    gaze, straighten = rng.uniform(-6, 4), rng.uniform(0.4, 0.7)

    def sequel(feet: dict[str, StandingFoot]) -> Sequel:
        def at(
            up: float, where: float, feet_at: dict[str, FootPlace], hands: HandPlace, lean: float, spine: float = 0.0
        ) -> Posture:
            return Posture(
                (0.0, up, where),
                (lean, 0, 0),
                (spine, 0, 0),
                (gaze - 0.5 * lean, 0, 0),
                hands=both(hands),
                feet=feet_at,
            )

        def flat(where: float) -> dict[str, FootPlace]:
            return {side: foot.flat(where) for side, foot in feet.items()}

        def tiptoe(degrees: float, where: float, up: float = 0.0) -> dict[str, FootPlace]:
            return {side: foot.tiptoe(degrees, where, up) for side, foot in feet.items()}

        hip_lean = 60 * dip
        done = Sequel([starts])
        done.then(crouch, at(0.92 - dip, -0.3 * dip, flat(0.0), _SWUNG[back], hip_lean, 0.8 * hip_lean), 0.04)
        for k in range(times):
            here, there = k * ahead, (k + 1) * ahead
            lean = 4 + 16 * ahead
            leaving = at(0.975 - 0.05 * ahead, here + 0.26 * ahead, tiptoe(_LEAVES, here), _SWUNG[arms], lean)
            landing = at(0.93 - 0.05 * ahead, there - 0.16 * ahead, tiptoe(36, there), _SWUNG["bent"], 0.6 * lean)
            done.then(rise, leaving)

            def shaped(share: float, up: float, here: float = here, lean: float = lean) -> Posture:
                drawn = tuck * (1 - (2 * share - 1) ** 2)
                where = here + ahead * (share + 0.25 * share * (1 - share))
                pointed = 66 - 26 * share - 20 * min(ahead, 1.0) * share
                hands = _SWUNG[arms] if share < 0.6 else _SWUNG["side" if arms != "bent" else "bent"]
                return at(
                    0.95 + up, where, tiptoe(pointed, where, up + drawn), hands, lean * (1 - share), 4 + 40 * drawn
                )

            fly(done, flight, leaving, landing, shaped)
            soft = at(0.92 - land, there - 0.3 * land, flat(there), _SWUNG["bent"], 70 * land, 50 * land)
            done.then(
                0.07, at(0.915 - 0.35 * land, there - 0.1 * ahead, flat(there), _SWUNG["bent"], 40 * land, 20 * land)
            )
            if k < times - 1:
                done.then(
                    absorb, at(0.92 - dip, there - 0.3 * dip, flat(there), _SWUNG[back], hip_lean, 0.6 * hip_lean)
                )
            else:
                done.then(absorb, soft, 0.05)
        end = times * ahead
        done.then(straighten, Posture((0.0, 0.935, end), feet=flat(end)) if ahead else STAND)
        return done

    return on_feet(sequel, kinds, after, times=times)
