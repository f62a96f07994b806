"""Bodies that dodge a blow, and bodies that a blow hits."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT

_GUARD = {
    LEFT: HandPlace((-0.06, 0.02, 0.32), "trunk", (0.5, -1.0, -0.1)),
    RIGHT: HandPlace((-0.1, -0.02, 0.24), "trunk", (0.6, -1.0, -0.1)),
}
_STANDS = 0.94  # metres of the hips of a standing body

_DODGES = {"slip": 3, "duck": 3, "lean-back": 3, "step": 3, "hop-back": 3, "hop-side": 3, "hop-ahead": 1}

# -- dodges --------------------------------------------------------------------------------------------------------


def _stance(rng: random.Random, guard: bool) -> Posture:
    """A stance with bent knees, the left foot a little ahead."""
    feet = {LEFT: FootPlace((0.13, 0.07, 0.12)), RIGHT: FootPlace((0.15, 0.07, -0.14), (0.5, -0.3, 0.9))}
    hands = _GUARD if guard else {}
    pelvis = (0.0, rng.uniform(0.84, 0.88), 0.0)
    return Posture(pelvis, (4, 0, 0), (rng.uniform(4, 10), 0, 0), (-4, 0, 0), 0.0, hands, feet)


def _moved(posture: Posture, left: float, ahead: float, up: float = 0.0, **changes: object) -> Posture:
    """A posture with its pelvis and feet moved, up too."""
    x, y, z = posture.pelvis or (0.0, _STANDS, 0.0)
    feet = {}
    for side in SIDES:
        sign = 1.0 if side == LEFT else -1.0
        foot = posture.feet.get(side, FootPlace((0.1, 0.07, 0.0)))
        feet[side] = replace(foot, at=(foot.at[0] + sign * left, foot.at[1] + up, foot.at[2] + ahead))
    return replace(posture, pelvis=(x + left, y + up, z + ahead), feet=feet, **changes)


def dodge(rng: random.Random) -> Gesture:
    """One to three dodges, each from the stance and back, of a hop without a way back."""
    form = rng.choices(list(_DODGES), list(_DODGES.values()))[0]
    to_left = rng.random() < 0.5
    guard = rng.random() < 0.65
    stance = _stance(rng, guard)
    done = Sequel([rng.uniform(0.15, 0.5)], [stance if rng.random() < 0.4 else STAND])
    if done.postures[0] is STAND:
        done.then(rng.uniform(0.4, 0.6), stance, rng.choice((0.0, rng.uniform(0.1, 0.5))))
    times = rng.choice((1, 1, 2, 3)) if form in ("slip", "duck", "lean-back") else 1
    for _ in range(times):
        if form.startswith("hop"):
            _hop(rng, done, stance, form)
        else:
            _lean(rng, done, stance, form)
    if rng.random() < 0.6:
        _stand_there(rng, done, guard)
    side = "left" if to_left else "right"
    told = (done if to_left else done.mirrored()).gesture(
        rng,
        ["dodge", f"dodge-{form}", "dodge-guard" if guard else "", "dodge-twice" if times > 1 else ""],
        side if form in ("slip", "step", "hop-side") else "",
        times,
    )
    jumps, aside = form.startswith("hop"), form in ("slip", "step", "hop-side")
    untrue = [] if jumps else ["jump", "leap", "hop", "spring", "dash"]
    untrue += [] if aside else ["aside", "side", "slip", "weave", "out of"]
    untrue += [] if form in ("hop-back", "lean-back") else ["back"]
    untrue += [] if form == "duck" else ["duck", "bob", "weave"]
    untrue += [] if form == "hop-ahead" else ["forward"]
    return replace(told, untrue=rf"({'|'.join(untrue)})")


def _lean(rng: random.Random, done: Sequel, stance: Posture, form: str) -> None:
    """To the left, down or back, by the trunk and the knees or by a quick step of the left foot."""
    away, hold, back = rng.uniform(0.22, 0.32), rng.uniform(0.05, 0.3), rng.uniform(0.35, 0.55)
    x, y, z = stance.pelvis or (0.0, _STANDS, 0.0)
    far = rng.uniform(0.9, 1.2)
    low = {
        "slip": replace(
            stance,
            pelvis=(x + 0.13, y - 0.08 * far, z),
            tilt=(6, -8, 0),
            spine=(14, -26 * far, rng.uniform(-18, 6)),
            neck=(-6, 12, 0),
        ),
        "duck": replace(
            stance,
            pelvis=(x, y - 0.26 * far, z - 0.1),
            tilt=(22, 0, 0),
            spine=(26 * far, 0, 0),
            neck=(-10, 0, 0),
            hands=stance.hands or both(HandPlace((0.02, 0.12, 0.2), "trunk", (1.0, -0.6, 0.2))),
        ),
        "lean-back": replace(
            stance, pelvis=(x, y - 0.05, z - 0.04), tilt=(-14, 0, 0), spine=(-24 * far, 0, 0), neck=(10, 0, 0)
        ),
        "step": replace(
            stance,
            pelvis=(x + 0.36 * far, y - 0.1, z),
            tilt=(6, -6, 0),
            spine=(12, -12, 0),
            feet={**stance.feet, LEFT: FootPlace((0.13 + 0.5 * far, 0.07, 0.1), (0.3, -0.3, 0.9))},
        ),
    }[form]
    done.then(away if form != "step" else rng.uniform(0.3, 0.4), low, hold)
    done.then(back, stance, rng.choice((0.0, rng.uniform(0.1, 0.4))))


def _hop(rng: random.Random, done: Sequel, stance: Posture, form: str) -> None:
    """Bend the knees, push off, land on both feet 0.4 to 0.7 m away."""
    far = rng.uniform(0.42, 0.7)
    left, ahead = {"hop-back": (0.0, -far), "hop-side": (far, 0.0), "hop-ahead": (0.0, far)}[form]
    x, y, z = stance.pelvis or (0.0, _STANDS, 0.0)
    lean = {"hop-back": 12.0, "hop-side": 8.0, "hop-ahead": 4.0}[form]
    loaded = replace(stance, pelvis=(x + 0.1 * left, y - 0.1, z + 0.1 * ahead), spine=(16, 0, 0))
    air = _moved(stance, 0.55 * left, 0.55 * ahead, rng.uniform(0.1, 0.16), spine=(lean, 0, 0))
    land = _moved(stance, left, ahead)
    lx, ly, lz = land.pelvis or (0.0, _STANDS, 0.0)
    sunk = replace(land, pelvis=(lx, ly - 0.1, lz), tilt=(8, 0, 0), spine=(18, 0, 0), neck=(-12, 0, 0))
    done.then(rng.uniform(0.16, 0.24), loaded)
    done.then(0.2, air)
    done.then(0.2, sunk)
    done.then(rng.uniform(0.3, 0.5), land, rng.uniform(0.2, 0.8))


def _stand_there(rng: random.Random, done: Sequel, guard: bool) -> None:
    """Straighten up where the feet are."""
    last = done.postures[-1]
    x, _, z = last.pelvis or (0.0, _STANDS, 0.0)
    if abs(x) + abs(z) < 0.1:
        done.then(rng.uniform(0.5, 0.7), STAND)
    else:
        done.then(rng.uniform(0.5, 0.7), Posture((x, 0.91, z), hands=last.hands if guard else {}, feet=last.feet))


# -- hits ----------------------------------------------------------------------------------------------------------

_WOUND = {
    "head": HandPlace((-0.06, 0.14, 0.1), "trunk", (1.0, -0.4, 0.3)),
    "chest": HandPlace((-0.1, -0.16, 0.18), "trunk", (0.9, -0.6, 0.1)),
    "stomach": HandPlace((-0.14, -0.36, 0.2), "trunk", (0.9, -0.3, 0.1)),
    "shoulder": HandPlace((-0.26, -0.06, 0.16), "trunk", (0.8, -0.7, 0.3)),
    "back": HandPlace((0.14, -0.3, -0.16), "trunk", (0.9, 0.0, -0.6)),
}
_FLUNG = HandPlace((0.34, -0.28, 0.28), "trunk", (0.6, -0.7, -0.5))


def flinch(
    rng: random.Random, form: str = "", *, side: str = "", heavy: bool | None = None, times: int | None = None
) -> Gesture:
    """One hit, or two: a jerk away from it, then back to standing, after a step where it is heavy.

    Args:
        rng: decides everything that is not given.
        form: part that is hit: head, chest, stomach, shoulder, leg, back or side; a given one is hit standing.
        side: left or right, on which it is.
        heavy: a step catches the body.
        times: how often.
    """
    stands = bool(form)
    form = form or rng.choices(["head", "stomach", "shoulder", "leg", "back", "side"], (4, 4, 3, 2, 3, 3))[0]
    heavy = rng.random() < 0.4 if heavy is None else heavy
    begin = STAND if stands or rng.random() < 0.7 else _stance(rng, True)
    on_left = side == LEFT if side else rng.random() < 0.5
    done = Sequel([rng.uniform(0.2, 0.9)], [begin])
    times = times or rng.choice((1, 1, 1, 2))
    for _ in range(times):
        _hit(rng, done, begin, form, heavy, rng.uniform(*((1.15, 1.45) if heavy or stands else (0.8, 1.05))))
    told = done if on_left else done.mirrored()
    side = ("left" if on_left else "right") if form in ("shoulder", "leg", "side") else ""
    told = told.gesture(
        rng,
        ["flinch", f"flinch-{form}", "flinch-heavy" if heavy else "flinch-light", "flinch-twice" if times > 1 else ""],
        side,
        times,
    )
    untrue = [] if heavy and form in ("head", "stomach") else ["stagger", "reel", "back"]
    untrue += [] if form == "head" else ["slap"]
    return replace(told, untrue=rf"({'|'.join([*untrue, 'wince'] if heavy else untrue) or 'wince'})")


def _hit(rng: random.Random, done: Sequel, begin: Posture, form: str, heavy: bool, hard: float) -> None:
    """Hit on the left side, or from in front or behind; `hard`: factor of how far the body goes."""
    turn = rng.uniform(-12, 12)
    pelvis, tilt, spine, neck = {
        "head": ((0.0, -0.03, -0.05), (-6, 0, 0), (-15, 0, turn), (-26, rng.uniform(-10, 10), 2 * turn)),
        "chest": ((0.0, -0.04, -0.11), (-5, 0, 0), (-20, 0, turn), (20, 0, 0)),
        "stomach": ((0.0, -0.07, -0.12), (16, 0, 0), (30, 0, turn), (6, 0, 0)),
        "shoulder": ((-0.03, -0.03, -0.05), (-3, 4, 12), (-6, 8, 30), (-4, 6, -14)),
        "leg": ((0.02, -0.16, -0.04), (10, -6, 0), (18, -10, 8), (10, 0, 0)),
        "back": ((0.0, -0.03, 0.2), (15, 0, 0), (-13, 0, turn), (-8, 0, 0)),
        "side": ((-0.08, -0.04, 0.0), (0, 8, 0), (6, 22, -8), (0, 18, 0)),
    }[form]
    x, y, z = begin.pelvis or (0.0, _STANDS, 0.0)
    scaled = (x + hard * pelvis[0], y + hard * pelvis[1], z + hard * pelvis[2])
    flung = both(_FLUNG) if form in ("head", "chest", "back", "shoulder", "side") else {}
    jerk = replace(
        begin,
        pelvis=scaled,
        tilt=_times(tilt, hard),
        spine=_times(spine, hard),
        neck=_times(neck, hard),
        hands=flung or begin.hands,
    )
    hands = _hands(rng, form, begin)
    done.then(rng.uniform(0.15, 0.22), jerk)
    ease = rng.uniform(0.3, 0.45)
    if heavy:
        jerk = _stagger(rng, done, begin, jerk, form)
    soft = replace(
        jerk, tilt=_times(jerk.tilt, 0.5), spine=_times(jerk.spine, 0.45), neck=_times(jerk.neck, 0.3), hands=hands
    )
    if form == "stomach":
        soft = replace(soft, spine=_times(jerk.spine, 0.85), tilt=_times(jerk.tilt, 0.8))
    done.then(ease, soft)
    done.then(rng.uniform(0.4, 0.65) + (0.2 if heavy else 0.0), begin, rng.uniform(0.1, 0.3))


def _hands(rng: random.Random, form: str, begin: Posture) -> dict[str, HandPlace]:
    """Hands that go to where the body was hit."""
    wound = _WOUND.get(form)
    if wound is None or begin.hands or rng.random() < 0.35:
        return begin.hands
    if form == "stomach":
        return both(wound)
    return {RIGHT if form == "shoulder" else rng.choice(SIDES): wound}


def _times(angles: tuple[float, float, float], factor: float) -> tuple[float, float, float]:
    return (factor * angles[0], factor * angles[1], factor * angles[2])


def _stagger(rng: random.Random, done: Sequel, begin: Posture, jerk: Posture, form: str) -> Posture:
    """A step that catches the body: back, forward or to the right, away from the hit."""
    far = rng.uniform(0.24, 0.38)
    left, ahead = {"back": (0.0, far), "side": (-far, 0.0), "leg": (-0.4 * far, -0.5 * far)}.get(form, (0.0, -far))
    x, y, z = jerk.pelvis or (0.0, _STANDS, 0.0)
    foot = begin.feet.get(RIGHT, FootPlace((0.1, 0.07, 0.0)))
    stepped = replace(foot, at=(foot.at[0] - left, foot.at[1], foot.at[2] + ahead))
    caught = replace(
        jerk,
        pelvis=(x + 0.55 * left, y - 0.04, z + 0.55 * ahead),
        spine=_times(jerk.spine, 0.8),
        feet={**begin.feet, RIGHT: stepped},
    )
    done.then(rng.uniform(0.25, 0.35), caught)
    return caught
