"""Standing on one leg: knees that are brought to the elbows, and arabesques. All are drawn
for the left leg lifted."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from marey.drawing.flights import standing_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture, mirrored
from marey.drawing.sequels import Sequel, both, near
from marey.posing.standing import LEFT, RIGHT, StandingBody

_GUARD = {
    "crunch-head": HandPlace((0.09, 0.14, 0.0), "trunk", (1.0, -0.1, 0.2)),
    "crunch-fists": HandPlace((0.12, 0.02, 0.2), "trunk", (0.7, -0.9, 0.0)),
}
_ELBOW: Point = (0.0, -0.8, 0.7)
"""Where the elbow that comes down points."""
_HALF = {"quick": (0.3, 0.4), "": (0.42, 0.6), "slow": (0.75, 1.1)}
"""Seconds of coming together."""


def knee_to_elbow(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choice(list(_GUARD))
    cross = rng.random() < 0.75
    tempo = rng.choice(["quick", "", "", "slow"])
    half = rng.uniform(*_HALF[tempo])
    times = times or rng.randint(1, min(8, int(6.4 / (2.1 * half))))
    alternate = times > 1 and rng.random() < 0.65
    arms = both(replace(_GUARD[form], at=near(rng, _GUARD[form].at)))
    ready = Posture((0.0, 0.92, -0.01), spine=(2, 0, 0), hands=arms)
    elbow = RIGHT if cross else LEFT
    over: Point = (0.02, rng.uniform(0.9, 0.92), -0.03)
    knee = replace(_KNEE_UP, at=near(rng, (-0.02 if cross else 0.1, 0.62, 0.16), 0.02))
    hand = replace(
        arms[elbow], elbow=_ELBOW, at=(arms[elbow].at[0] - 0.02, arms[elbow].at[1] - 0.05, arms[elbow].at[2] + 0.05)
    )
    crunch = Posture(
        over,
        (rng.uniform(6, 12), 0, 0),
        _BENDS[cross],
        (14, 0, 0),
        0.0,
        {**arms, elbow: hand},
        {LEFT: knee},
        {LEFT: (-0.1 if cross else 0.35, 0.6, 1.0)},
        RIGHT,
    )
    spine = crunch.spine
    crunch = replace(crunch, spine=(spine[0] + rng.uniform(-3, 6), spine[1], spine[2] + rng.uniform(-4, 4)))
    done = Sequel([rng.uniform(0.1, 0.7)])
    done.then(rng.uniform(0.4, 0.6), ready, 0.1)
    for k in range(times):
        flip = alternate and k % 2 == 1
        one = mirrored(crunch) if flip else crunch
        light = Posture((over[0] + 0.02, 0.915, -0.02), (2, 0, 0), (3, 0, 0), hands=arms, over=RIGHT)
        light = mirrored(light) if flip else light
        done.then(0.4 * half, light)
        done.then(half * rng.uniform(0.94, 1.08), one, rng.uniform(0.0, 0.12))
        done.then(half * rng.uniform(0.9, 1.05), light)
        if k == times - 1 or alternate:
            done.then(0.3 * half, ready, rng.uniform(0.0, 0.08))
    done.then(rng.uniform(0.45, 0.7), STAND)
    leg = rng.choice(SIDES)
    kinds = ["crunch", form, "crunch-cross" if cross else "crunch-same", "crunch-turns" if alternate else ""]
    kinds += ["crunch-once" if times == 1 else "", f"crunch-{tempo}" if tempo else ""]
    gesture = (done if leg == LEFT else done.mirrored()).gesture(rng, kinds, "" if alternate else leg, times)
    return replace(gesture, untrue="" if cross else "cross")


_KNEE_UP = FootPlace((0.0, 0.62, 0.16), (0.0, -0.6, 0.8))
_BENDS: dict[bool, Point] = {True: (46, 0, 34), False: (34, -30, 6)}
"""Degrees of the spine if the other elbow comes to the knee, or the one of the same side."""

_LEG = 0.775
"""Metres from hip to ankle of a leg that is almost straight."""
_STANDS = 0.94
"""Metres of the hips over the floor for which the postures are written; see `marey.drawing.postures`."""
_HIP = 0.08
"""Metres of the hip joints below the pelvis."""
_LINES = {
    "arabesque-ahead": (
        HandPlace((0.02, 0.14, 0.52), "trunk", (0.6, -0.8, 0.0)),
        HandPlace((0.52, 0.02, 0.02), "trunk", (0.1, -0.9, -0.4)),
    ),
    "arabesque-out": (HandPlace((0.52, 0.06, 0.1), "trunk", (0.1, -0.9, -0.4)),) * 2,
    "arabesque-up": (
        HandPlace((0.1, 0.44, 0.16), "trunk", (1.0, 0.1, 0.1)),
        HandPlace((0.5, 0.04, 0.06), "trunk", (0.1, -0.9, -0.4)),
    ),
    "arabesque-back": (
        HandPlace((0.16, 0.12, 0.46), "trunk", (0.7, -0.7, 0.0)),
        HandPlace((0.36, -0.24, -0.28), "trunk", (0.4, -0.2, -0.9)),
    ),
}
"""Hands of the standing side and of the lifted one."""


def arabesque(rng: random.Random) -> Gesture:
    form = rng.choice(list(_LINES))
    up = rng.uniform(0.48, 0.95)
    high = (up - 0.45) / 0.5
    tilt, spine = 8 + 38 * high * rng.uniform(0.85, 1.1), rng.uniform(-10, 0) - 6 * high
    ahead, aside = _LINES[form]
    leg = rng.choice(SIDES)
    lifts, holds = rng.uniform(0.6, 1.2), rng.uniform(0.8, 3.0)
    hips: Point = (0.02, 0.93, -0.01 - 0.02 * high)
    below, behind = _HIP * math.cos(math.radians(tilt)), _HIP * math.sin(math.radians(tilt))
    far = math.sqrt(_LEG**2 - (up - hips[1] + below) ** 2) + behind - hips[2]
    hands = {RIGHT: replace(ahead, at=near(rng, ahead.at)), LEFT: replace(aside, at=near(rng, aside.at))}
    foot = FootPlace((0.03, up, -far), (0.05, -0.1 + 0.3 * high, -1.0))
    line = Posture(hips, (tilt, 0, 0), (spine, 0, 0), (-0.5 * tilt - 0.5 * spine, 0, 0), 0.0, hands)
    line = replace(line, feet={LEFT: foot}, knees={LEFT: (0.2, -1.0, 0.2)}, over=RIGHT)
    over = Posture((hips[0], 0.92, 0.0), (2, 0, 0), over=RIGHT, hands=_lowered(hands, 0.2))
    back = FootPlace((0.06, 0.15, -0.26), (0.05, -0.75, -0.65))
    touch = replace(
        line, pelvis=(hips[0], 0.89, 0.02), tilt=(5, 0, 0), spine=(0, 0, 0), neck=(0, 0, 0), feet={LEFT: back}
    )
    starts, shifts, draws, stays = (rng.uniform(*limits) for limits in ((0.1, 0.7), (0.3, 0.5), (0.4, 0.6), (0.0, 0.4)))
    sways = [(rng.uniform(0.4, 0.8), near(rng, (0.0, 0.0, 0.0), 0.008)) for _ in range(max(1, round(holds / 0.6)))]

    def sequel(taller: float, ahead: float) -> Sequel:
        """The postures of a body that stands higher than others, and whose standing foot is ahead, by metres."""
        touching = replace(touch, feet={LEFT: replace(back, at=(back.at[0], back.at[1], back.at[2] + ahead))})
        done = Sequel([starts])
        done.then(shifts, over)
        done.then(draws, touching, stays)
        for seconds, sway in [(lifts, (0.0, 0.0, 0.0)), *sways]:
            at = (foot.at[0] + sway[0], foot.at[1] + sway[1] + taller, foot.at[2] + abs(sway[2]) + ahead)
            done.then(seconds, replace(line, feet={LEFT: replace(foot, at=at)}))
        done.then(0.8 * lifts, touching)
        done.then(draws, replace(over, hands=_lowered(hands, 0.16)))
        done.then(shifts + 0.1, STAND)
        return done if leg == LEFT else done.mirrored()

    def change(body: StandingBody) -> None:
        stands = standing_feet(body)[RIGHT if leg == LEFT else LEFT]
        done = sequel(float(body.joints[:, 0, 1].mean()) - _STANDS, stands.forward)
        pose(body, done.times, done.postures)

    kinds = ["arabesque", form, "arabesque-high" if up > 0.75 else "arabesque-low"]
    return Gesture(sequel(0.0, 0.0).times[-1] + rng.uniform(0.3, 0.9), tuple(kinds), change, leg, untrue="attitude")


def _lowered(hands: dict[str, HandPlace], ahead: float) -> dict[str, HandPlace]:
    """The same hands down before the body."""
    return {side: replace(hand, at=(0.22, -0.3, ahead)) for side, hand in hands.items()}
