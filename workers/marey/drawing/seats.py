"""Bodies that sit down on a seat, sit and stand up again."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, Step, both, near
from marey.posing.standing import OTHER_SIDE

_PACES = {"quick": (0.6, 0.85), "": (0.9, 1.4), "slow": (1.6, 2.4)}
"""Seconds from standing to sitting or back."""
_HANDS = {
    "sit-thighs": HandPlace((-0.01, 0.08, -0.13), "knee", (0.7, -0.2, -0.7)),
    "sit-knees": HandPlace((0.0, 0.07, 0.0), "knee", (0.7, -0.3, -0.6)),
    "sit-lap": HandPlace((-0.13, 0.1, -0.2), "knee", (0.8, -0.2, -0.6)),
    "sit-seat": HandPlace((0.08, -0.46, -0.02), "shoulder", (0.3, 0.0, -1.0)),
    "sit-crossed": HandPlace((-0.08, -0.22, 0.19), "trunk", (0.9, -0.9, 0.1)),
}


def _seated(rng: random.Random) -> tuple[str, Posture]:
    """Draw a seated posture and the key of its hands."""
    form = rng.choices(list(_HANDS), (5, 3, 3, 2, 2))[0]
    apart = rng.uniform(0.05, 0.45)
    hand = _HANDS[form]
    posture = Posture(
        (0.0, rng.triangular(0.45, 0.65, 0.54), -rng.uniform(0.32, 0.38)),
        (rng.uniform(-8, 6), 0, 0),
        (rng.uniform(0, 14), rng.uniform(-2, 2), rng.uniform(-3, 3)),
        (rng.uniform(-6, 6), 0, 0),
        hands=both(replace(hand, at=near(rng, hand.at, 0.015))),
        knees=dict.fromkeys(SIDES, (apart, 0.3, 1.0)),
    )
    return form, posture


def _leaning(rng: random.Random, seated: Posture, share: float) -> Posture:
    """The posture on the way between sitting and standing, the trunk over the feet; share 0: sitting, 1: standing."""
    _, up, forward = seated.pelvis or (0.0, 0.54, -0.35)
    pelvis = (0.0, up + share * (0.92 - up), forward * (1 - 0.85 * share))
    return Posture(
        pelvis, (rng.uniform(20, 34), 0, 0), (rng.uniform(12, 24), 0, 0), (-14, 0, 0), 0.5, knees=seated.knees
    )


def _moved(rng: random.Random, seated: Posture) -> Posture:
    """A seated posture that differs a little: another lean, look or place of the hands."""
    pitch, roll, yaw = seated.spine
    spine = (pitch + rng.uniform(-5, 10), roll + rng.uniform(-4, 4), yaw + rng.uniform(-10, 10))
    hands = dict(seated.hands)
    if rng.random() < 0.4:
        side = rng.choice(SIDES)
        form = rng.choice(("sit-thighs", "sit-knees", "sit-lap"))
        hands[side] = HandPlace(near(rng, _HANDS[form].at), "knee", _HANDS[form].elbow)
    neck = (rng.uniform(-8, 12), rng.uniform(-4, 4), rng.choice((0.0, rng.uniform(-35, 35))))
    return replace(seated, spine=spine, neck=neck, hands=hands)


def seated_on_seat(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a seated posture, and the steps to it from standing and back."""
    _, seated = _seated(rng)
    fall, rise = (rng.uniform(*_PACES[""]) for _ in range(2))
    down = ((0.55 * fall, _leaning(rng, seated, rng.uniform(0.35, 0.5))), (0.55 * fall, seated))
    over, mid = (_leaning(rng, seated, rng.uniform(*share)) for share in ((0.0, 0.12), (0.5, 0.65)))
    return seated, down, ((0.45 * rise, over), (0.35 * rise, mid), (0.55 * rise, STAND))


def _legs_crossed(rng: random.Random, seated: Posture) -> Posture:
    """A seated posture with one leg over the other, the hands on the upper one."""
    over = rng.choice(SIDES)
    left, up, forward = seated.pelvis or (0.0, 0.54, -0.35)
    hangs = FootPlace(near(rng, (-0.2, 0.27, 0.16), 0.015), (-0.1, -0.45, 0.9))
    stands = FootPlace((0.06, 0.07, 0.0))
    upper = HandPlace((0.04, 0.07, -0.1), "knee", (0.8, -0.2, -0.6))
    lower = HandPlace((-0.19, 0.16, -0.08), "knee", (0.8, -0.2, -0.6))
    return replace(
        seated,
        pelvis=(left, max(0.5, min(up, 0.56)), forward),
        feet={over: hangs, OTHER_SIDE[over]: stands},
        knees={over: (-0.3, 0.9, 0.7), OTHER_SIDE[over]: (0.0, 0.3, 1.0)},
        hands={over: upper, OTHER_SIDE[over]: lower},
    )


def crossed_on_seat(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the seat of `seated_on_seat` with one leg over the other, and the steps to it from standing
    and back; the last two and the first two are those from the seat and to it."""
    seated, down, up = seated_on_seat(rng)
    crossed = replace(_legs_crossed(rng, seated), pelvis=seated.pelvis)
    lifted = _leg_lifted(crossed, seated)
    return crossed, (*down, (0.4, lifted), (0.45, crossed)), ((0.4, lifted), (0.45, seated), *up)


def _leg_lifted(crossed: Posture, seated: Posture) -> Posture:
    """The posture on the way to legs that are crossed."""
    return replace(
        crossed,
        feet={side: replace(foot, at=(0.06, 0.34, 0.1)) if foot.toes else foot for side, foot in crossed.feet.items()},
        knees=dict.fromkeys(SIDES, (0.2, 0.9, 1.0)),
        hands=seated.hands,
    )


def sit_legs_crossed(rng: random.Random, *, down: bool = False, seconds: float | None = None) -> Gesture:
    """A body that sits on a seat and lays one leg over the other, where it stays.

    Args:
        rng: decides everything that is not given.
        down: it stands at first, and sits down.
        seconds: to be filled; None = for about four seconds on the seat.
    """
    _, seated = _seated(rng)
    seated = replace(seated, spine=(rng.uniform(0, 8), 0, rng.uniform(-3, 3)), hands=both(_HANDS["sit-thighs"]))
    crossed = _legs_crossed(rng, seated)
    lifted = _leg_lifted(crossed, seated)
    done = Sequel([rng.uniform(0.3, 0.6)], [STAND if down else seated])
    if down:
        fall = rng.uniform(*_PACES[""])
        done.then(0.55 * fall, _leaning(rng, seated, rng.uniform(0.35, 0.5)))
        done.then(0.55 * fall, seated, 0.3)
    done.then(0.4, lifted)
    done.then(0.45, crossed, 0.6)
    until = max(seconds or 0.0, done.times[-1] + rng.uniform(1.8, 2.6)) - 1.0
    while done.times[-1] < until:
        neck = (rng.uniform(-6, 8), rng.uniform(-4, 4), rng.choice((0.0, rng.uniform(-30, 30))))
        done.then(rng.uniform(0.7, 1.1), replace(crossed, neck=neck), rng.uniform(0.3, 0.9))
    return done.gesture(rng, ["sit", "sit-legs-crossed"])


def sit_down(rng: random.Random) -> Gesture:
    tempo = rng.choice(["quick", "", "", "slow"])
    fall = rng.uniform(*_PACES[tempo])
    form, seated = _seated(rng)
    hips = replace(_leaning(rng, seated, rng.uniform(0.35, 0.5)), hands=seated.hands if rng.random() < 0.4 else {})
    done = Sequel([rng.uniform(0.1, 0.9)])
    done.then(0.55 * fall, hips)
    done.then(0.55 * fall, replace(seated, hands=hips.hands or seated.hands), rng.uniform(0.5, 1.6))
    for _ in range(rng.choice((0, 0, 1, 2))):
        done.then(rng.uniform(0.6, 1.1), _moved(rng, seated), rng.uniform(0.2, 1.2))
    return done.gesture(
        rng, ["sit-down", f"sit-down-{tempo}" if tempo else "", "sit-down-thighs" if form == "sit-thighs" else ""]
    )


def stand_up(rng: random.Random) -> Gesture:
    tempo = rng.choice(["quick", "", "", "slow"])
    rise = rng.uniform(*_PACES[tempo])
    form, seated = _seated(rng)
    push = form in ("sit-thighs", "sit-knees") and rng.random() < 0.6
    over = replace(_leaning(rng, seated, rng.uniform(0.0, 0.12)), hands=seated.hands if push else {})
    mid = replace(_leaning(rng, seated, rng.uniform(0.5, 0.65)), hands=seated.hands if push else {})
    done = Sequel([rng.uniform(0.2, 0.6)], [seated])
    for _ in range(rng.choice((0, 0, 1))):
        done.then(rng.uniform(0.6, 1.0), _moved(rng, seated), 0.2)
    done.then(0.45 * rise, over)
    done.then(0.35 * rise, mid)
    done.then(0.55 * rise, STAND, rng.uniform(0.3, 1.5))
    return done.gesture(rng, ["stand-up", f"stand-up-{tempo}" if tempo else "", "stand-up-push" if push else ""])


_LEVEL = 0.53
"""Largest height of the hips over stretched legs, metres."""
_LEGS = {
    "": None,
    "stretched": FootPlace((0.1, 0.03, 0.28), (0.15, 0.35, 0.9)),
    "tucked": FootPlace((0.1, 0.115, -0.2), (0.1, -0.75, 0.65)),
    "wide": FootPlace((0.24, 0.07, 0.0)),
}


def sit(rng: random.Random) -> Gesture:
    form, seated = _seated(rng)
    legs = rng.choices(list(_LEGS), (5, 1, 2, 2))[0]
    foot = _LEGS[legs]
    if foot:
        seated = replace(
            seated,
            feet={side: replace(foot, at=(near(rng, foot.at)[0], foot.at[1], near(rng, foot.at)[2])) for side in SIDES},
        )
    if legs == "stretched" and seated.pelvis:  # from a high seat the thighs would not be level
        left, up, forward = seated.pelvis
        seated = replace(seated, pelvis=(left, min(up, _LEVEL), forward))
    if rng.random() < 0.25:  # the trunk leans over the knees
        hand = HandPlace((-0.06, 0.12, -0.02), "knee", (0.8, -0.4, -0.5))
        seated = replace(seated, spine=(rng.uniform(16, 26), 0, 0), hands=both(hand))
        form = "sit-lean"
    if rng.random() < 0.15:
        chin = HandPlace((0.03, 0.08, 0.15), "trunk", (0.5, -1.0, 0.3))
        seated = replace(seated, hands={**seated.hands, rng.choice(SIDES): chin})
        form = "sit-chin"
    seconds = rng.uniform(2.2, 6.6)
    done = Sequel([rng.uniform(0.2, 0.8)], [seated])
    still = rng.random() < 0.3
    while done.times[-1] < seconds:
        change = seated if still else _moved(rng, seated)
        if form == "sit-chin" or form == "sit-crossed":
            change = replace(change, hands=seated.hands)
        done.then(rng.uniform(0.7, 1.3), change, rng.uniform(0.3, 1.6))
    told = form if form not in ("sit-knees", "sit-lap", "sit-seat") else ""
    return done.gesture(rng, ["sit-still" if still else "sit", told])
