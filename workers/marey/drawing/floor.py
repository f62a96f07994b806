"""Bodies that sit and lie on the floor, and go there and back."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.crawls import on_fours
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture, mirrored
from marey.drawing.sequels import FLOOR_PACES, Sequel, Step, both
from marey.posing.standing import LEFT, RIGHT

SUPINE = -85.0
"""Degrees by which the hips of a body on its back are tilted."""
_PRONE = 87.0
_LIES, _SITS = 0.125, 0.17
"""Metres of the pelvis over the floor."""
_APART: dict[str, Point] = dict.fromkeys(SIDES, (0.35, 0.2, 1.0))
"""Where the knees of a crouching body point."""
_HALF_KNEEL = Posture(
    (0.0, 0.53, -0.25),
    spine=(14.0, 0.0, 0.0),
    hang=0.7,
    hands={RIGHT: HandPlace((-0.02, 0.07, -0.03), "knee", (0.7, -0.3, -0.6))},
    feet={LEFT: FootPlace((0.1, 0.15, -0.66), (0.0, -0.93, 0.35))},
    knees={LEFT: (0.05, -0.3, 1.0)},
)
"""On the left knee, a hand on the other."""
_BACK = -0.42
"""Metres forward of the feet of a standing body at which its pelvis lies on the floor."""
_UP: Point = (0.15, 1.0, 0.3)
_DOWN: Point = (0.1, -1.0, 0.1)


def on_back(at: float, *, feet: dict[str, FootPlace], knees: float = 0.1) -> Posture:
    """A body on its back, the pelvis `at` metres forward of its place, knees pointing up and outward by `knees`."""
    poles: dict[str, Point] = dict.fromkeys(SIDES, (knees, 1.0, 0.3))
    return Posture((0.0, _LIES, at), (SUPINE, 0, 0), feet=feet, knees=poles)


# -- sitting -------------------------------------------------------------------------------------------------------


def _floor_seats(rng: random.Random, form: str, back: float | None = None) -> Posture:
    """A posture of sitting on the floor, the feet about where they stood, the pelvis `back` metres forward of there."""
    if back is None:
        back = {"floor-crossed": -0.32, "floor-bent": -0.4, "floor-stretched": -0.5}[form] - rng.uniform(0, 0.04)
    lean = {"floor-crossed": (-4, 6), "floor-bent": (-16, -4), "floor-stretched": (-12, -2)}[form]
    behind = HandPlace((rng.uniform(0.2, 0.32), 0.05, back - rng.uniform(0.22, 0.3)), "floor", (0.3, 0.0, -1.0))
    knee = HandPlace((-0.02, 0.06, 0.02), "knee", (0.7, -0.3, -0.6))
    lap = HandPlace((-0.1, -0.42, 0.2), "trunk", (0.8, -0.3, -0.6))
    hands = {"floor-crossed": (knee, knee, lap), "floor-bent": (knee, behind), "floor-stretched": (behind, lap)}[form]
    poles: dict[str, Point] = dict.fromkeys(SIDES, _UP)
    feet = {side: FootPlace((rng.uniform(0.08, 0.14), 0.07, 0.02)) for side in SIDES}
    if form == "floor-crossed":
        feet = {
            LEFT: FootPlace((-0.1, 0.08, back + 0.36), (-0.75, -0.25, 0.5)),
            RIGHT: FootPlace((-0.07, 0.08, back + 0.26), (-0.75, -0.25, 0.5)),
        }
        poles = dict.fromkeys(SIDES, (1.0, 0.3, 0.25))
    elif form == "floor-stretched":
        feet = {side: FootPlace((rng.uniform(0.07, 0.14), 0.045, back + 0.76), (0.25, 0.75, 0.5)) for side in SIDES}
    tilt, spine = (rng.uniform(*lean), 0, 0), (rng.uniform(2, 16), 0, 0)
    return Posture(
        (0.0, _SITS, back), tilt, spine, (rng.uniform(-4, 8), 0, 0), 0.0, both(rng.choice(hands)), feet, poles
    )


def _fidget(rng: random.Random, done: Sequel, posture: Posture, seconds: float) -> None:
    """Look around and lean a little for some seconds."""
    end = done.times[-1] + seconds
    while done.times[-1] < end:
        pitch, roll, yaw = posture.spine
        spine = (pitch + rng.uniform(-4, 5), roll + rng.uniform(-3, 3), yaw + rng.uniform(-6, 6))
        neck = (posture.neck[0] + rng.uniform(-5, 8), 0, rng.choice((0.0, rng.uniform(-30, 30))))
        done.then(rng.uniform(0.7, 1.3), replace(posture, spine=spine, neck=neck), rng.uniform(0.2, 1.2))


def _down_to_seat(rng: random.Random, done: Sequel, seat: Posture, pace: float) -> None:
    """From standing through a crouch, a hand behind, to sitting on the floor."""
    _, _, back = seat.pelvis or (0.0, 0.0, -0.4)
    hand = HandPlace((0.24, 0.05, back - 0.2), "floor", (0.4, 0.1, -1.0))
    crouch = Posture((0.0, 0.42, 0.55 * back), (26, 0, 0), (30, 0, 0), (-10, 0, 0), 0.8, {LEFT: hand}, knees=_APART)
    crouch = replace(crouch, hands={LEFT: hand} if rng.random() < 0.6 else both(hand))
    sat = Posture((0.0, _SITS, back), (-8, 0, 0), (24, 0, 0), hands=both(hand), knees=dict.fromkeys(SIDES, _UP))
    done.then(0.9 * pace, crouch)
    done.then(0.45 * pace, sat)
    done.then(0.7 * pace, seat)


def sit_floor(rng: random.Random, form: str = "", *, down: bool | None = None) -> Gesture:
    """A body that sits on the floor.

    Args:
        rng: decides everything that is not given.
        form: floor-crossed, floor-bent or floor-stretched, by the legs.
        down: it stands at first, and sits down.
    """
    form = form or rng.choices(["floor-crossed", "floor-bent", "floor-stretched"], (5, 3, 2))[0]
    seat = _floor_seats(rng, form)
    down = rng.random() < 0.35 if down is None else down
    done = Sequel([rng.uniform(0.15, 0.6)], [STAND if down else seat])
    if down:
        _down_to_seat(rng, done, seat, rng.uniform(0.9, 1.3))
    _fidget(rng, done, seat, rng.uniform(2.0, 5.0))
    return done.either(rng).gesture(rng, ["sit-floor", form, "floor-down" if down else "floor-stay"])


def seated_on_floor(rng: random.Random, form: str) -> tuple[Posture, tuple[Step, ...]]:
    """Return a posture of sitting on the floor, and the steps to it from standing; one with stretched legs has the hips
    where those of a body on its back are."""
    seat, done = _floor_seats(rng, form, _BACK if form == "floor-stretched" else None), Sequel([0.0])
    if form == "floor-stretched":
        seat = replace(seat, hands=both(HandPlace((0.0, 0.1, -0.16), "knee", (0.7, -0.2, -0.6))))
    _down_to_seat(rng, done, seat, rng.uniform(0.85, 1.1))
    return seat, _steps(done)


def rising_from_seat(rng: random.Random) -> tuple[Step, ...]:
    """Return the steps of a body that sits on the floor and stands up."""
    pace = rng.uniform(0.85, 1.1)
    seat = replace(_floor_seats(rng, "floor-bent"), pelvis=(0.0, _SITS, _BACK), tilt=(-6, 0, 0), spine=(26, 0, 0))
    behind = _behind(_BACK)
    return ((0.6 * pace, replace(seat, hands=both(behind), feet={})), *_off_the_seat(behind, _BACK, pace))


def slid(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the seat behind a leg that is stretched ahead, the other one bent under it, the steps to it
    from a run, and those to standing."""
    back, hand = -0.5, _behind(-0.6)
    feet = {LEFT: FootPlace((0.1, 0.06, back + 0.8), (0.1, 0.8, 0.5)), RIGHT: FootPlace((0.0, 0.07, back + 0.42))}
    poles: dict[str, Point] = {LEFT: (0.1, 1.0, 0.2), RIGHT: (0.9, 0.7, 0.3)}
    hands = {LEFT: HandPlace((0.35, 0.1, 0.25)), RIGHT: hand}
    low = Posture((0.0, _SITS, back), (-34, 0, 0), (10, 0, 0), (16, 0, 0), 0.0, hands, feet, poles)
    way = replace(low, pelvis=(0.0, 0.5, 0.6 * back), tilt=(-18, 0, 0), hands={})
    pace = rng.uniform(0.9, 1.1)
    return low, ((0.35 * pace, way), (0.3 * pace, low)), rising_from_seat(rng)


def _behind(back: float) -> HandPlace:
    """Where a hand supports a body that sits on the floor, the pelvis `back` metres forward of its place."""
    return HandPlace((0.24, 0.05, back - 0.24), "floor", (0.4, 0.1, -1.0))


def _off_the_seat(behind: HandPlace, back: float, pace: float) -> tuple[Step, ...]:
    """Return the steps from sitting on the floor, a hand on it behind the body, to standing."""
    hands = {LEFT: behind, RIGHT: HandPlace((-0.02, 0.07, -0.02), "knee", (0.7, -0.3, -0.6))}
    lifted = Posture((0.0, 0.36, 0.5 * back), (32, 0, 0), (34, 0, 0), (-16, 0, 0), 0.6, hands, knees=_APART)
    high = Posture((0.0, 0.56, -0.12), (34, 0, 0), (26, 0, 0), (-12, 0, 0), 0.7, knees=_APART)
    return (0.55 * pace, lifted), (0.45 * pace, high), (0.7 * pace, STAND)


def _steps(done: Sequel) -> tuple[Step, ...]:
    """Return the steps of a sequel behind its first posture."""
    return tuple(
        (after - before, posture)
        for before, after, posture in zip(done.times[:-1], done.times[1:], done.postures[1:], strict=True)
    )


# -- lying ---------------------------------------------------------------------------------------------------------

_BESIDE = HandPlace((0.32, -0.46, -0.05), "trunk", (0.8, 0.0, -0.5))
_RESTS = {
    "beside": _BESIDE,
    "belly": HandPlace((-0.02, -0.33, 0.13), "trunk", (1.0, -0.2, 0.1)),
    "spread": HandPlace((0.62, -0.14, -0.06), "trunk", (0.2, -0.8, -0.4)),
    "head": HandPlace((0.08, 0.16, -0.04), "trunk", (1.0, 0.3, 0.0)),
}
_ASIDE = HandPlace((0.4, 0.16, 0.03), "trunk", (0.8, -0.2, -0.4))
"""Hands of a body on its front go past here on their way between the floor beside the chest and their rest."""
_LEFT_HANDED = 0.15
"""Probability of a gun at the left shoulder."""
_PILLOW = HandPlace((0.05, 0.2, 0.03), "trunk", (1.0, 0.3, 0.1))


def _lying(rng: random.Random, at: float, form: str, *, moves: bool = True) -> Posture:
    """A body on its back or its front, the pelvis `at` metres forward of its place; one that moves has no hands behind
    the head."""
    if form == "lie-front":
        feet = {side: FootPlace((rng.uniform(0.08, 0.16), 0.1, at - 0.868), (0.15, -0.45, -0.88)) for side in SIDES}
        hand = rng.choice((_PILLOW, HandPlace((0.32, -0.45, 0.03), "trunk", (0.8, 0.0, -0.5))))
        neck = (-14.0, 0.0, rng.uniform(35, 60) * rng.choice((1, -1)))
        poles: dict[str, Point] = dict.fromkeys(SIDES, _DOWN)
        return Posture((0.0, _LIES, at), (_PRONE, 0, 0), (0, 0, 0), neck, 0.0, both(hand), feet, poles)
    feet = {side: FootPlace((rng.uniform(0.08, 0.2), 0.035, at + 0.845), (0.35, 0.85, 0.4)) for side in SIDES}
    bent = FootPlace((0.12, 0.07, at + rng.uniform(0.42, 0.5)))
    legs = rng.choices((0, 1, 2), (4, 2, 2))[0]
    for side in SIDES[:legs]:
        feet[side] = bent
    hands = both(_RESTS[rng.choices(list(_RESTS), (4, 3, 2, 0 if moves else 2))[0]])
    return replace(on_back(at, feet=feet), hands=hands, neck=(rng.uniform(2, 10), 0, 0))


def _moved_lying(rng: random.Random, lying: Posture, form: str) -> Posture:
    neck = lying.neck if form == "lie-front" else (lying.neck[0] + rng.uniform(-2, 3), 0, rng.uniform(-30, 30))
    hands = dict(lying.hands)
    if form == "lie-back" and rng.random() < 0.35:
        hands[rng.choice(SIDES)] = _RESTS[rng.choice(("beside", "belly"))]
    return replace(lying, neck=neck, hands=hands, spine=(rng.uniform(0, 2), 0, 0))


def lie(rng: random.Random, form: str = "", *, seconds: float | None = None) -> Gesture:
    """A body that lies: `form` is lie-back or lie-front, any if empty, for `seconds` or as comes."""
    form = form or rng.choices(["lie-back", "lie-front"], (3, 1))[0]
    still = rng.random() < 0.45
    lying = _lying(rng, 0.0, form, moves=not still)
    done = Sequel([rng.uniform(0.2, 0.8)], [lying])
    end = seconds or rng.uniform(1.8, 6.5)
    while done.times[-1] < end:
        done.then(rng.uniform(0.8, 1.5), lying if still else _moved_lying(rng, lying, form), rng.uniform(0.3, 1.5))
    return done.either(rng).gesture(rng, ["lie", form, "lie-still" if still else ""])


def _prone_way(rng: random.Random, pace: float) -> list[tuple[float, Posture]]:
    """From a crouch with both hands on the floor to a push-up position: seconds of each part, and its posture."""
    hand = both(HandPlace((rng.uniform(0.34, 0.38), 0.05, rng.uniform(0.34, 0.38)), "floor", (0.5, 0.6, -0.7)))
    crouch = Posture((0.0, 0.5, 0.02), (48, 0, 0), (46, 0, 0), (-20, 0, 0), 0.8, hand, knees=_APART)
    back = FootPlace((0.1, 0.15, -0.78), (0.0, -0.95, 0.3))
    low: dict[str, Point] = dict.fromkeys(SIDES, _DOWN)
    half = Posture(
        (0.0, 0.52, -0.02), (62, 0, 0), (22, 0, 0), (-20, 0, 0), 0.0, hand, {LEFT: back}, {LEFT: (0, -0.5, 0.8)}
    )
    plank = Posture((0.0, 0.4, 0.02), (73, 0, 0), (2, 0, 0), (-16, 0, 0), 0.0, hand, dict.fromkeys(SIDES, back), low)
    return [(0.9 * pace, crouch), (0.5 * pace, half), (0.5 * pace, plank)]


def lie_down(rng: random.Random, form: str = "") -> Gesture:
    """A body that stands and lies down: `form` is lie-back or lie-front, any if empty."""
    form = form or rng.choices(["lie-back", "lie-front"], (3, 2))[0]
    tempo = rng.choice(["quick", "", "", "slow"])
    pace = rng.uniform(*FLOOR_PACES[tempo])
    done = Sequel([rng.uniform(0.15, 0.7)])
    if form == "lie-front":
        for seconds, posture in _prone_way(rng, pace):
            done.then(seconds, posture)
        lying = _lying(rng, 0.06, form)
        done.then(0.8 * pace, replace(lying, hands=done.postures[-1].hands, neck=(-12, 0, 0)))
        done.then(0.5, replace(lying, hands=both(_ASIDE)))
        done.then(0.5, lying, rng.uniform(0.3, 1.0))
    else:
        back = -0.4
        seat = _floor_seats(rng, "floor-bent")
        lying = _lying(rng, back, form)
        seat = replace(seat, pelvis=(0.0, _SITS, back), feet=seat.feet)
        _down_to_seat(rng, done, seat, pace)
        elbows = both(HandPlace((0.3, 0.05, back - 0.14), "floor", (0.4, 0.0, -1.0)))
        half = Posture((0.0, 0.14, back), (-48, 0, 0), (14, 0, 0), (10, 0, 0), 0.0, elbows, lying.feet, lying.knees)
        done.then(0.8 * pace, half)
        done.then(0.7 * pace, lying, rng.uniform(0.4, 1.4))
    return done.either(rng).gesture(rng, ["lie-down", f"{form}-down", f"lie-down-{tempo}" if tempo else ""])


def lying_back(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the back, the steps to it from standing, and those back; the first of these sits up."""
    pace, done = rng.uniform(0.85, 1.1), Sequel([0.0])
    lying = _lying(rng, _BACK, "lie-back")
    seat = replace(_floor_seats(rng, "floor-bent"), pelvis=(0.0, _SITS, _BACK))
    _down_to_seat(rng, done, seat, pace)
    elbows = both(HandPlace((0.3, 0.05, _BACK - 0.14), "floor", (0.4, 0.0, -1.0)))
    done.then(0.8 * pace, replace(_half_up(lying, elbows), pelvis=(0.0, 0.14, _BACK), tilt=(-48, 0, 0)))
    done.then(0.7 * pace, lying)
    rising = rising_from_seat(rng)
    return lying, _steps(done), ((0.9 * pace, _half_up(lying, both(_behind(_BACK)))), *rising)


def _half_up(lying: Posture, hands: dict[str, HandPlace]) -> Posture:
    """Return the posture between lying on the back and sitting."""
    return Posture((0.0, 0.15, _BACK + 0.06), (-28, 0, 0), (14, 0, 0), (10, 0, 0), 0.0, hands, lying.feet, lying.knees)


def lying_front(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the front, the steps to it from standing, and those back."""
    pace = rng.uniform(0.85, 1.1)
    lying, way = _lying(rng, 0.06, "lie-front"), _prone_way(rng, pace)
    aside = replace(lying, hands=both(_ASIDE))
    down = (
        *way,
        (0.8 * pace, replace(lying, hands=way[-1][1].hands, neck=(-12, 0, 0))),
        (0.5, aside),
        (0.5, lying),
    )
    pressed = replace(lying, hands=way[0][1].hands, neck=(-14, 0, 0))
    up = (0.45 * pace, aside), (0.4 * pace, pressed), (0.8 * pace, way[2][1]), way[1], (0.7 * pace, _HALF_KNEEL)
    return lying, down, (*up, (0.7 * pace, STAND))


def planking(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the hands and toes, the steps to it from standing, and those back."""
    pace = rng.uniform(0.85, 1.1)
    way = _prone_way(rng, pace)
    up = (way[1], (0.7 * pace, _HALF_KNEEL), (0.7 * pace, STAND))
    return way[-1][1], tuple(way), up


def aiming_prone(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    """Return a posture on the front with the chest raised on the elbows and both hands at a gun ahead, the steps to it
    from one flat on the front whose hands are beside the chest, and those back; these go over that one."""
    pace, look = rng.uniform(0.9, 1.1), rng.uniform(-36, -30)
    trigger = HandPlace((-0.06, -0.03, 0.22), "shoulder", (0.7, -1.0, 0.1))
    barrel = HandPlace((-0.2, -0.05, 0.42), "shoulder", (0.2, -1.0, 0.1))
    lying = _lying(rng, 0.06, "lie-front")
    feet = {side: FootPlace((rng.uniform(0.2, 0.26), 0.1, -0.78), (0.4, -0.45, -0.8)) for side in SIDES}
    low = replace(
        lying,
        tilt=(_PRONE - 2.0, 0, 0),
        spine=(-rng.uniform(26, 30), 0, 0),
        neck=(look, 0, 0),
        hands={RIGHT: trigger, LEFT: barrel},
        feet=feet,
    )
    if rng.random() < _LEFT_HANDED:
        low = mirrored(low)
    return low, ((0.7 * pace, low),), ()


def half_kneeling() -> Posture:
    """Return the posture between standing and being on all fours: on one knee, a hand on the other."""
    return _HALF_KNEEL


def get_up(rng: random.Random, form: str = "") -> Gesture:
    """A body that lies and gets up to stand: `form` is lie-back, lie-front, or fours (from hands and knees); one of the
    first two if empty."""
    form = form or rng.choices(["lie-back", "lie-front"], (3, 2))[0]
    tempo = rng.choice(["quick", "", "", "slow"])
    pace = rng.uniform(*FLOOR_PACES[tempo])
    if form == "fours":
        done = Sequel([rng.uniform(0.2, 0.5)], [on_fours(rng)])
        done.then(0.9 * pace, _HALF_KNEEL)
    elif form == "lie-front":
        way = _prone_way(rng, pace)
        lying = _lying(rng, 0.06, form)
        done = Sequel([rng.uniform(0.2, 0.8)], [lying])
        done.then(0.45 * pace, replace(lying, hands=both(_ASIDE)))
        done.then(0.4 * pace, replace(lying, hands=way[0][1].hands, neck=(-14, 0, 0)))
        done.then(0.8 * pace, way[2][1])
        done.then(*way[1])
        if rng.random() < 0.5:
            done.then(0.7 * pace, _HALF_KNEEL)
        else:
            done.then(*way[0])
    else:
        back = _BACK
        lying = _lying(rng, back, form)
        seat = replace(_floor_seats(rng, "floor-bent"), pelvis=(0.0, _SITS, back), tilt=(-6, 0, 0), spine=(26, 0, 0))
        behind = _behind(back)
        done = Sequel([rng.uniform(0.2, 0.8)], [lying])
        done.then(
            0.9 * pace,
            replace(seat, pelvis=(0.0, 0.15, back + 0.06), tilt=(-28, 0, 0), hands=both(behind), feet=lying.feet),
        )
        done.then(0.6 * pace, replace(seat, hands=both(behind), feet={}))
        for step in _off_the_seat(behind, back, pace)[:-1]:
            done.then(*step)
    done.then(0.7 * pace, STAND, rng.uniform(0.3, 0.9))
    return done.either(rng).gesture(rng, ["get-up", f"{form}-up", f"get-up-{tempo}" if tempo else ""])
