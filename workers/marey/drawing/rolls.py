"""Bodies that roll over the floor and that flip in the air."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.tumbling import FLOOR, OWN, Limb, Tumble, Whole, pair, stood
from marey.posing.standing import LEFT, RIGHT

_TUCKED = pair(Limb((0.1, -0.36, 0.4), towards=(0.1, -0.6, 0.8)))
_SHINS = pair(Limb((0.2, -0.3, 0.3), towards=(0.9, -0.3, 0.1)))
"""Hands before the shins of a tucked body."""
_EARS = pair(Limb((0.24, 0.14, 0.06), towards=(0.4, 0.5, 0.8)))
_PACES = {"quick": (0.75, 0.9), "": (0.95, 1.2), "slow": (1.3, 1.6)}

# -- rolls ---------------------------------------------------------------------------------------------------------


def _hands_down(ahead: float, wide: float = 0.24) -> dict[str, Limb]:
    return pair(Limb((wide, 0.04, ahead), FLOOR, (0.8, 0.3, -0.5)))


def roll(
    rng: random.Random, form: str = "", *, side: str = "", stands: bool = False, crouches: bool | None = None
) -> Gesture:
    """A roll over the floor.

    Args:
        rng: decides everything that is not given.
        form: forward, shoulder, backward or sideways.
        side: left or right, to which it goes sideways.
        stands: without steps before it.
        crouches: the body stays low behind it.
    """
    form = form or rng.choices(["forward", "shoulder", "backward", "sideways"], (4, 4, 2, 3))[0]
    tempo = rng.choice(["quick", "quick", "", "", "slow"])
    pace = rng.uniform(*_PACES[tempo])
    done = Tumble(times=[rng.uniform(0.1, 0.6)])
    steps = not stands and form in ("forward", "shoulder") and tempo != "slow" and rng.random() < 0.45
    start = steps_in(rng, done, pace) if steps else 0.0
    if form == "sideways":
        end = _roll_aside(rng, done, pace)
    elif form == "backward":
        end = _roll_back(rng, done, pace)
    else:
        end = _roll_ahead(rng, done, pace, start, form == "shoulder")
    crouches = rng.random() < 0.3 if crouches is None else crouches
    feet = done.poses[-1].feet
    if crouches:
        low = Whole(end, rng.uniform(0.55, 0.66), (18, 0, 0), (14, 0, 0), (-14, 0, 0), {}, feet, splay=0.35)
        done.then(0.35 * pace, _turned_on(low, done.poses[-1]), rng.uniform(0.4, 1.4))
    else:
        done.then(0.55 * pace, _turned_on(Whole(end, 1.0, feet=feet), done.poses[-1]), rng.uniform(0.2, 0.9))
    right = side == RIGHT if side else rng.random() < 0.5
    told = done if right else done.mirrored()
    side = ("right" if right else "left") if form == "sideways" else ""
    kinds = [
        "roll",
        f"roll-{form}",
        "roll-steps" if steps else "",
        "roll-crouch" if crouches else "roll-stand",
        f"roll-{tempo}" if tempo else "",
    ]
    untrue = {
        "forward": "backward|shoulder|barrel",
        "shoulder": "backward|barrel",
        "backward": "forward|shoulder|barrel",
    }
    return told.gesture(
        rng, kinds, side, untrue=rf"({untrue.get(form, 'forward|backward|shoulder')}|dive|dodge|combat)"
    )


def _turned_on(whole: Whole, before: Whole) -> Whole:
    """A pose with as many whole turns as the one before it."""
    turns = [360.0 * round((b - a) / 360.0) for a, b in zip(whole.tilt, before.tilt, strict=True)]
    return replace(whole, tilt=(whole.tilt[0] + turns[0], whole.tilt[1] + turns[1], whole.tilt[2] + turns[2]))


def steps_in(rng: random.Random, done: Tumble, pace: float) -> float:
    """Steps forward, two or four; returns how far, metres."""
    far, at = rng.uniform(0.42, 0.6), 0.0
    feet = {LEFT: 0.0, RIGHT: 0.0}
    for side in SIDES * rng.choice((1, 2)):
        other = RIGHT if side == LEFT else LEFT
        standing = Limb((0, 0, feet[other]), OWN)
        target = feet[other] + far
        for share, up, move in ((0.5, 0.14, 0.55), (1.0, 0.0, 1.0)):
            swung = Limb((0.0, up, feet[side] + move * (target - feet[side])), OWN)
            ahead = at + share * (target - 0.3 * far - at)
            arms = {side: Limb((0.24, -0.42, -0.12)), other: Limb((0.2, -0.32, 0.22))}
            whole = Whole((0.0, ahead), 0.95, (10, 0, 0), (4, 0, 0), (0, 0, 0), arms, {side: swung, other: standing})
            done.then(rng.uniform(0.14, 0.17) * max(pace, 0.9), whole)
        feet[side], at = target, target - 0.3 * far
    lifted = {LEFT: Limb((0, 0.1, feet[RIGHT] - 0.3 * far), OWN), RIGHT: Limb((0, 0, feet[RIGHT]), OWN)}
    done.then(0.16, Whole((0.0, feet[RIGHT] - 0.1), 0.84, (20, 0, 0), (14, 0, 0), (0, 0, 0), {}, lifted))
    return feet[RIGHT]


def _roll_ahead(rng: random.Random, done: Tumble, pace: float, z: float, shoulder: bool) -> tuple[float, float]:
    """Over the head or the right shoulder."""
    far = rng.uniform(1.6, 1.9)
    aside, twist = (rng.uniform(14, 26), rng.uniform(18, 30)) if shoulder else (0.0, 0.0)
    hands = _hands_down(z + 0.66)
    low = Whole((0.0, z + 0.14), 0.52, (44, 0, 0), (34, 0, 0), (0, 0, 0), hands, stood(0, z), splay=0.35)
    if shoulder:
        low = replace(low, hands={**hands, RIGHT: Limb((-0.04, 0.05, z + 0.6), FLOOR, (0.6, 0.3, 0.6))})
    tips = replace(
        low, at=(0.0, z + 0.46), height=0.66, tilt=(92, 0.4 * aside, 0.0), spine=(46, 0, -twist), neck=(44, -aside, 0)
    )
    tips = replace(tips, feet={side: Limb((0.0, 0.03, z + 0.02), OWN) for side in SIDES})
    over = Whole(
        (0.0, z + 0.85), 0.6, (165, aside, 0), (56, 0, -twist), (46, -aside, 0), _SHINS, _TUCKED, rest=1.0, splay=0.2
    )
    over = replace(over, feet=pair(Limb((0.1, -0.46, 0.42), towards=(0.1, -0.7, 0.7))))
    back = Whole(
        (0.0, z + 0.68 * far), 0.2, (258, 0.6 * aside, 0), (46, 0, 0), (40, 0, 0), _SHINS, _TUCKED, rest=1.0, splay=0.2
    )
    end = z + far
    seat = Whole(
        (0.0, end - 0.3), 0.2, (328, 0, 0), (38, 0, 0), (14, 0, 0), _SHINS, stood(0, end), rest=0.8, splay=0.35
    )
    ahead = pair(Limb((0.2, -0.26, 0.34), towards=(0.8, -0.6, 0)))
    crouch = Whole(
        (0.0, end - 0.06), 0.42, (388, 0, 0), (24, 0, 0), (-8, 0, 0), ahead, stood(0, end), rest=0.0, splay=0.35
    )
    done.then((0.32 if z else 0.5) * pace, low)
    done.then(0.26 * pace, tips)
    done.then(0.24 * pace, over)
    done.then(0.24 * pace, back)
    done.then(0.22 * pace, seat)
    done.then(0.26 * pace, crouch)
    return (0.0, end)


def _roll_back(rng: random.Random, done: Tumble, pace: float) -> tuple[float, float]:
    """Down onto the seat, over the back, and onto the hands and feet."""
    far = rng.uniform(1.5, 1.75)
    crouch = Whole((0.0, -0.12), 0.5, (24, 0, 0), (28, 0, 0), (8, 0, 0), _SHINS, splay=0.35)
    seat = Whole((0.0, -0.36), 0.2, (-14, 0, 0), (40, 0, 0), (24, 0, 0), _SHINS, rest=1.0, splay=0.3)
    back = Whole((0.0, -0.72), 0.2, (-96, 0, 0), (50, 0, 0), (42, 0, 0), _EARS, _TUCKED, rest=1.0, splay=0.2)
    over = Whole((0.0, -0.62 * far), 0.5, (-185, 0, 0), (56, 0, 0), (46, 0, 0), _EARS, _TUCKED, rest=1.0, splay=0.2)
    hands = _hands_down(0.45 - far)
    down = Whole((0.0, -far - 0.02), 0.5, (-280, 0, 0), (40, 0, 0), (10, 0, 0), hands, stood(0, -far), splay=0.35)
    low = Whole((0.0, -far), 0.46, (-325, 0, 0), (36, 0, 0), (-6, 0, 0), hands, stood(0, -far), splay=0.35)
    for seconds, whole in ((0.5, crouch), (0.3, seat), (0.26, back), (0.28, over), (0.3, down), (0.24, low)):
        done.then(seconds * pace, whole)
    return (0.0, -far)


def _roll_aside(rng: random.Random, done: Tumble, pace: float) -> tuple[float, float]:
    """From a crouch to the right over the side and the back, tucked."""
    far = rng.uniform(1.3, 1.6)
    ahead = _hands_down(0.42, 0.2)
    low = Whole((0.0, -0.1), 0.5, (52, 0, 0), (28, 0, 0), (-8, 0, 0), ahead, splay=0.3)
    arms = pair(Limb((-0.02, -0.12, 0.26), towards=(0.7, -0.7, 0.2)))
    feet = pair(Limb((0.1, -0.44, 0.34), towards=(0.1, -0.7, 0.7)))
    side = Whole((-0.25 * far, 0.06), 0.2, (76, 75, 0), (24, 0, 0), (24, 0, 0), arms, feet, rest=1.0)
    back = replace(side, at=(-0.52 * far, 0.06), tilt=(97, 180, 0), neck=(34, 0, 0))
    last = replace(side, at=(-0.8 * far, 0.06), tilt=(80, 285, 0))
    over = {one: Limb((0.2 - far if one == LEFT else 0.2 + far, 0.04, 0.42), FLOOR, (0.8, 0.3, -0.5)) for one in SIDES}
    up = replace(low, at=(-far, -0.1), tilt=(52, 360, 0), hands=over, feet=stood(-far, 0))
    for seconds, whole in ((0.5, low), (0.28, side), (0.28, back), (0.28, last), (0.3, up)):
        done.then(seconds * pace, whole)
    return (-far, 0.0)


# -- flips ---------------------------------------------------------------------------------------------------------


def flip(rng: random.Random, form: str = "", *, stands: bool = False) -> Gesture:
    """A somersault in the air, from standing or out of steps, tucked or half open.

    Args:
        rng: decides everything that is not given.
        form: back or front.
        stands: without steps before it.
    """
    form = form or rng.choices(["back", "front"], (3, 2))[0]
    turn = 1.0 if form == "front" else -1.0
    done = Tumble(times=[rng.uniform(0.15, 0.8)])
    steps = not stands and form == "front" and rng.random() < 0.6
    start = steps_in(rng, done, 0.9) if steps else 0.0
    far = rng.uniform(0.9, 1.3) if steps else rng.uniform(0.35, 0.8)
    end, lasts = start + turn * far, rng.uniform(0.62, 0.72)
    swung = pair(Limb((0.22, -0.38, -0.14), towards=(0.7, 0.1, -0.7)))
    passing = pair(Limb((0.24, -0.16, 0.38), towards=(0.8, -0.5, -0.3)))
    raised = pair(Limb((0.2, 0.46, 0.12), towards=(0.8, 0.2, 0.4)))
    low = Whole((0.0, start - 0.06), 0.72, (26, 0, 0), (16, 0, 0), (-10, 0, 0), swung, stood(0, start), splay=0.2)
    toes = {side: Limb((0.0, 0.06, start), OWN) for side in SIDES}
    off = Whole(
        (0.0, start + 0.1 * turn), 1.07, (16 * turn, 0, 0), (-6, 0, 0), (-6 * turn, 0, 0), raised, toes, splay=0.1
    )
    tight = rng.uniform(0.0, 1.0)
    arms = pair(Limb((0.34, -0.24, 0.3), towards=(0.8, -0.6, -0.2)))
    landed = Whole(
        (0.0, end - 0.04 * turn),
        0.84,
        (turn * 360 + 14, 0, 0),
        (14, 0, 0),
        (-12, 0, 0),
        arms,
        stood(0, end),
        splay=0.25,
    )
    sunk = replace(landed, height=rng.uniform(0.6, 0.74), tilt=(turn * 360 + 26, 0, 0), spine=(20, 0, 0))
    done.then(0.22 if steps else rng.uniform(0.4, 0.6), low)
    springs = rng.uniform(0.26, 0.32)
    rising = Whole(
        (0.0, start + 0.02 * turn), 0.9, (20, 0, 0), (6, 0, 0), (-8, 0, 0), passing, stood(0, start), splay=0.15
    )
    done.then(0.5 * springs, rising)
    done.then(0.5 * springs, off)
    _turn_over(done, (start, end), lasts, landed, tight)
    done.then(rng.uniform(0.16, 0.24), sunk)
    done.then(
        rng.uniform(0.5, 0.8), Whole((0.0, end), tilt=(turn * 360, 0, 0), feet=stood(0, end)), rng.uniform(0.2, 0.9)
    )
    kinds = ["flip", f"flip-{form}", "flip-steps" if steps else "flip-standing"]
    other = "back" if form == "front" else "front|forward"
    return done.gesture(rng, kinds, untrue=rf"({other}|handspring)")


def _turn_over(done: Tumble, way: tuple[float, float], lasts: float, landed: Whole, tight: float) -> None:
    """Add the flight of a somersault, tucked at first and opened before it lands.

    Args:
        done: ends where the feet leave the floor.
        way: metres ahead of the idle's place at both ends; the body turns in this direction.
        lasts: seconds.
        landed: the posture at the end.
        tight: share to which the body is tucked.
    """
    start, end = way
    forward = end > start
    feet = pair(Limb((0.1, -0.4 - 0.2 * tight, 0.36 - 0.1 * tight), towards=(0.1, -0.8, 0.5)))
    opened = pair(Limb((0.1, -0.72, 0.1 if forward else 0.16), towards=(0.1, -0.5, 0.8)))
    middle = Whole((0.0, start), 1.45, (0, 0, 0), (34 - 14 * tight, 0, 0), (16, 0, 0), _SHINS, feet, splay=0.2)
    begins = done.times[-1]
    for share, angle in ((0.3, 108), (0.5, 200), (0.72, 296)):
        whole = replace(middle, at=(0.0, start + share * (end - start)), tilt=(angle if forward else -angle, 0, 0))
        done.then(begins + share * lasts - done.times[-1], replace(whole, feet=opened) if share > 0.7 else whole)
    done.then(begins + lasts - done.times[-1], landed)
    done.flights.append((begins, begins + lasts))
