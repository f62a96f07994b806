"""Movements of sports: a serve, throws of javelin, discus, shot, frisbee and bowling ball, a jump shot, a lunge.

They are drawn for the right hand, and mirrored for the left one.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace

from marey.drawing.flights import StandingFoot, fly, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT

_Feet = dict[str, StandingFoot]
_OUT: Point = (1.0, -0.4, -0.2)
_DOWN: Point = (0.5, -1.0, -0.2)
_BACK: Point = (0.6, -0.3, -0.9)
_UP: Point = (0.7, 0.8, 0.3)
_LOWERED = HandPlace((0.1, -0.44, 0.12), "shoulder", _BACK)
_POINTING = HandPlace((0.04, 0.06, 0.47), "shoulder", _DOWN)
_TUCKED = HandPlace((0.02, -0.3, 0.2), "shoulder", _BACK)


def tennis_serve(rng: random.Random, side: str = "") -> Gesture:
    """A ball that is tossed up with one hand and struck overhead with the other.

    Args:
        rng: decides sizes and times.
        side: of the hand that strikes; empty = right.
    """
    pace, stride, turn = rng.uniform(0.95, 1.12), rng.uniform(0.26, 0.34), rng.uniform(34, 44)
    starts = rng.uniform(0.25, 0.5)

    def sequel(feet: _Feet) -> Sequel:
        stance = _stride(feet, stride)
        ready = Posture(
            (0.0, 0.93, 0.4 * stride),
            (4, 0, -0.6 * turn),
            (6, 0, -0.4 * turn),
            (0, 0, 0.7 * turn),
            hands={
                LEFT: HandPlace((-0.1, -0.22, 0.36), "shoulder", _DOWN),
                RIGHT: HandPlace((-0.12, -0.24, 0.32), "shoulder", _DOWN),
            },
            feet=stance,
        )
        parted = replace(
            ready,
            pelvis=(0.0, 0.92, 0.35 * stride),
            hands={
                LEFT: HandPlace((0.02, -0.44, 0.18), "shoulder", _DOWN),
                RIGHT: HandPlace((0.2, -0.42, -0.08), "shoulder", _BACK),
            },
        )
        trophy = Posture(
            (0.0, 0.86, 0.55 * stride),
            (-8, 0, -0.7 * turn),
            (-10, 6, -0.6 * turn),
            (-22, 0, 0.7 * turn),
            hands={
                LEFT: HandPlace((-0.02, 0.48, 0.12), "shoulder", _DOWN),
                RIGHT: HandPlace((0.24, 0.1, -0.16), "shoulder", (1.0, -0.1, -0.6)),
            },
            feet=stance,
        )
        dropped = replace(
            trophy,
            pelvis=(0.0, 0.91, 0.7 * stride),
            spine=(-12, 6, -0.4 * turn),
            hands={
                LEFT: HandPlace((0.0, 0.3, 0.34), "shoulder", _DOWN),
                RIGHT: HandPlace((0.04, 0.1, -0.2), "shoulder", (1.0, 0.7, 0.1)),
            },
        )
        raised = _stride(feet, stride, heel=30)
        struck = Posture(
            (0.0, 0.95, 0.95 * stride),
            (4, 0, 4),
            (6, -10, 12),
            (-16, 0, -8),
            hands={LEFT: _TUCKED, RIGHT: HandPlace((-0.02, 0.5, 0.1), "shoulder", _OUT)},
            feet=raised,
        )
        through = replace(
            struck,
            tilt=(14, 0, 14),
            spine=(16, 0, 18),
            neck=(-10, 0, -10),
            hands={LEFT: _TUCKED, RIGHT: HandPlace((-0.02, 0.08, 0.46), "shoulder", _OUT)},
        )
        stopped = Posture(
            (0.0, 0.89, 1.0 * stride),
            (14, 0, 22),
            (18, 0, 24),
            (-18, 0, -18),
            hands={LEFT: _TUCKED, RIGHT: HandPlace((-0.32, -0.36, 0.24), "shoulder", _OUT)},
            feet=_stride(feet, stride, heel=45),
        )
        done = Sequel([starts])
        done.then(0.6 * pace, ready, 0.25)
        done.then(0.45 * pace, parted)
        done.then(0.6 * pace, trophy, 0.2 * pace)
        done.then(0.2 * pace, dropped)
        done.then(0.17, struck)
        done.then(0.14, through)
        done.then(0.22, stopped, 0.2)
        return _ends(done, feet)

    return on_feet(sequel, ["tennis-serve"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)


def field_throw(rng: random.Random, form: str, side: str = "") -> Gesture:
    """A throw of a javelin or discus, a put of a shot, or a backhand throw of a frisbee.

    Args:
        rng: decides sizes and times.
        form: `javelin`, `discus`, `shot` or `frisbee`.
        side: of the hand that throws; empty = right.

    Raises:
        KeyError: no such form.
    """
    draw = _FIELD[form](rng)
    after = rng.uniform(0.3, 0.6)
    return on_feet(draw, ["throw", form], after, side=side or RIGHT, mirror=side == LEFT)


def _javelin(rng: random.Random) -> Callable[[_Feet], Sequel]:
    pace, step, starts = rng.uniform(0.95, 1.1), rng.uniform(0.5, 0.58), rng.uniform(0.2, 0.4)
    drawn = HandPlace((0.2, 0.12, -0.44), "shoulder", _OUT)
    carried = HandPlace((0.12, 0.2, -0.06), "shoulder", (1.0, -0.2, -0.3))

    def way(feet: _Feet, left: float, right: float, hands: dict[str, HandPlace], turn: float, heel: str) -> Posture:
        at = {LEFT: left, RIGHT: right}
        put = {one: feet[one].tiptoe(28, at[one]) if one == heel else feet[one].flat(at[one]) for one in at}
        pelvis = (0.0, 0.9, 0.5 * (left + right))
        return Posture(pelvis, (-3, 0, -0.5 * turn), (-4, 0, -0.5 * turn), (0, 0, 0.8 * turn), hands=hands, feet=put)

    def sequel(feet: _Feet) -> Sequel:
        first, hands = {RIGHT: carried}, {LEFT: _POINTING, RIGHT: drawn}
        done = Sequel([starts])
        done.then(0.5 * pace, way(feet, 0.0, 0.0, first, 0, ""), 0.1)
        done.then(0.42 * pace, way(feet, 0.8 * step, 0.0, first, 20, RIGHT))
        done.then(0.4 * pace, way(feet, 0.8 * step, 1.6 * step, hands, 40, LEFT))
        done.then(0.38 * pace, way(feet, 2.7 * step, 1.6 * step, hands, 50, RIGHT))
        ends, planted = 2.7 * step, {LEFT: feet[LEFT].flat(2.7 * step), RIGHT: feet[RIGHT].tiptoe(48, 1.75 * step)}
        bow = Posture(
            (0.0, 0.9, ends - 0.26),
            (-10, 0, 4),
            (-16, -6, 0),
            (-4, 0, 0),
            hands={
                LEFT: HandPlace((0.14, -0.14, 0.3), "shoulder", _BACK),
                RIGHT: HandPlace((0.24, 0.2, -0.22), "shoulder", (1.0, 0.4, 0.2)),
            },
            feet=planted,
        )
        let_go = replace(
            bow,
            pelvis=(0.0, 0.92, ends - 0.1),
            tilt=(10, 0, 12),
            spine=(12, -8, 12),
            hands={LEFT: _TUCKED, RIGHT: HandPlace((0.0, 0.36, 0.34), "shoulder", _OUT)},
        )
        stopped = Posture(
            (0.0, 0.84, ends + 0.24),
            (20, 0, 20),
            (22, 0, 18),
            (-26, 0, -14),
            hands={LEFT: _TUCKED, RIGHT: HandPlace((-0.26, -0.4, 0.24), "shoulder", _OUT)},
            feet={LEFT: feet[LEFT].tiptoe(40, ends), RIGHT: feet[RIGHT].flat(ends + 0.5)},
        )
        done.then(0.2, bow)
        done.then(0.16, let_go)
        done.then(0.36, stopped, 0.2)
        return _ends(done, feet, ends + 0.5)

    return sequel


def _discus(rng: random.Random) -> Callable[[_Feet], Sequel]:
    pace, starts, wide = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.17, 0.22)
    swings = rng.choice((1, 2))

    def sequel(feet: _Feet) -> Sequel:
        stance = {one: replace(feet[one], out=feet[one].out + wide).flat(0.06 if one == LEFT else -0.1) for one in feet}
        turned = {LEFT: stance[LEFT], RIGHT: replace(feet[RIGHT], out=feet[RIGHT].out + wide).tiptoe(40, -0.1)}

        def wound(share: float) -> Posture:
            hands = {
                LEFT: HandPlace((-0.12, -0.06, 0.36), "trunk", _OUT),
                RIGHT: HandPlace((0.46, -0.2, -0.3 * share), "trunk", _DOWN),
            }
            return Posture(
                (-0.1 * share, 0.93 - 0.13 * share, 0.0),
                (10 * share, 0, -34 * share),
                (10 * share, 0, -50 * share),
                (-8, 0, 24 * share),
                hands=hands,
                feet=stance,
            )

        left = Posture(
            (0.06, 0.9, 0.0),
            (8, 0, 22),
            (6, 0, 26),
            (-6, 0, 0),
            hands={
                LEFT: HandPlace((0.34, -0.16, 0.2), "trunk", _DOWN),
                RIGHT: HandPlace((-0.14, -0.16, 0.36), "trunk", _OUT),
            },
            feet=stance,
        )
        let_go = Posture(
            (0.12, 0.95, 0.02),
            (-6, 0, 34),
            (-10, 0, 10),
            (-6, 0, -30),
            hands={
                LEFT: HandPlace((0.3, -0.3, -0.1), "trunk", _BACK),
                RIGHT: HandPlace((0.36, 0.1, 0.34), "trunk", _DOWN),
            },
            feet=turned,
        )
        stopped = replace(
            let_go,
            tilt=(2, 0, 48),
            spine=(4, 0, 34),
            neck=(0, 0, -44),
            hands={
                LEFT: HandPlace((0.32, -0.3, -0.1), "trunk", _BACK),
                RIGHT: HandPlace((-0.16, 0.14, 0.4), "trunk", _OUT),
            },
        )
        done = Sequel([starts])
        done.then(0.7 * pace, left)
        for _ in range(swings):
            done.then(0.75 * pace, wound(0.8))
            done.then(0.75 * pace, left)
        done.then(0.85 * pace, wound(1.0), 0.08)
        done.then(0.4, let_go)
        done.then(0.3, stopped, 0.25)
        done.then(0.55 * pace, Posture((0.0, 0.93, 0.0), feet=stance))
        return _ends(done, feet)

    return sequel


def _shot(rng: random.Random) -> Callable[[_Feet], Sequel]:
    pace, starts, stride = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.4, 0.48)
    neck = HandPlace((-0.06, 0.05, 0.13), "shoulder", (1.0, -0.3, -0.2))

    def sequel(feet: _Feet) -> Sequel:
        held = Posture((0.0, 0.93, 0.0), (4, 0, -10), (0, 0, -10), hands={RIGHT: neck, LEFT: _LOWERED})
        stance = {LEFT: feet[LEFT].flat(stride), RIGHT: feet[RIGHT].flat(-0.08)}
        crouched = Posture(
            (-0.06, 0.78, 0.02),
            (16, 0, -46),
            (16, 0, -36),
            (-10, 0, 20),
            hands={RIGHT: neck, LEFT: HandPlace((-0.1, -0.06, 0.38), "trunk", _OUT)},
            feet=stance,
        )
        drives = Posture(
            (0.0, 0.88, 0.62 * stride),
            (-8, 0, -10),
            (-8, 0, -6),
            (-14, 0, 10),
            hands={RIGHT: neck, LEFT: HandPlace((0.3, 0.0, 0.24), "trunk", _DOWN)},
            feet=_stride(feet, stride, heel=30, rear=-0.08),
        )
        let_go = Posture(
            (0.03, 0.95, 0.88 * stride),
            (0, 0, 26),
            (-2, -8, 22),
            (-16, 0, -30),
            hands={RIGHT: HandPlace((-0.02, 0.3, 0.4), "shoulder", _OUT), LEFT: _TUCKED},
            feet=_stride(feet, stride, heel=52, rear=0.0),
        )
        stopped = Posture(
            (0.0, 0.86, stride + 0.1),
            (18, 0, 24),
            (14, 0, 16),
            (-20, 0, -24),
            hands={RIGHT: HandPlace((-0.1, -0.08, 0.42), "shoulder", _OUT), LEFT: _TUCKED},
            feet={LEFT: feet[LEFT].tiptoe(40, stride), RIGHT: feet[RIGHT].flat(stride + 0.34)},
        )
        done = Sequel([starts])
        done.then(0.7 * pace, held, 0.3)
        done.then(0.8 * pace, crouched, 0.2)
        done.then(0.3, drives)
        done.then(0.2, let_go, 0.06)
        done.then(0.45, stopped, 0.2)
        return _ends(done, feet, stride + 0.34)

    return sequel


def _frisbee(rng: random.Random) -> Callable[[_Feet], Sequel]:
    pace, starts, stride = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.26, 0.36)

    def sequel(feet: _Feet) -> Sequel:
        stance = {RIGHT: feet[RIGHT].flat(stride), LEFT: feet[LEFT].flat(0.0)}
        held = Posture(
            (0.0, 0.93, 0.0),
            (4, 0, 12),
            (2, 0, 10),
            hands={
                RIGHT: HandPlace((-0.12, -0.28, 0.3), "shoulder", _OUT),
                LEFT: HandPlace((-0.04, -0.3, 0.3), "shoulder", _DOWN),
            },
        )
        wound = Posture(
            (0.04, 0.87, 0.3 * stride),
            (8, 0, 38),
            (8, 0, 38),
            (-6, 0, -54),
            hands={RIGHT: HandPlace((-0.34, -0.26, 0.16), "trunk", _OUT), LEFT: _LOWERED},
            feet=stance,
        )
        let_go = Posture(
            (0.0, 0.9, 0.85 * stride),
            (4, 0, 4),
            (4, 0, -8),
            (-4, 0, 4),
            hands={
                RIGHT: HandPlace((0.1, -0.14, 0.46), "shoulder", _OUT),
                LEFT: HandPlace((0.24, -0.36, -0.08), "shoulder", _BACK),
            },
            feet={RIGHT: stance[RIGHT], LEFT: feet[LEFT].tiptoe(30)},
        )
        stopped = replace(
            let_go,
            tilt=(2, 0, -8),
            spine=(2, 0, -20),
            neck=(-4, 0, 22),
            hands={RIGHT: HandPlace((0.36, 0.02, 0.3), "shoulder", _DOWN), LEFT: let_go.hands[LEFT]},
        )
        done = Sequel([starts])
        done.then(0.6 * pace, held, 0.25)
        done.then(0.65 * pace, wound, 0.12)
        done.then(0.24, let_go)
        done.then(0.24, stopped, 0.3)
        return _ends(done, feet)

    return sequel


_FIELD: Mapping[str, Callable[[random.Random], Callable[[_Feet], Sequel]]] = {
    "javelin": _javelin,
    "discus": _discus,
    "shot": _shot,
    "frisbee": _frisbee,
}


def bowling(rng: random.Random, side: str = "") -> Gesture:
    """A ball that is bowled: three steps while the arm swings back, a low slide, and a swing through to the front.

    Args:
        rng: decides sizes and times.
        side: of the hand; empty = right.
    """
    pace, step, starts = rng.uniform(0.95, 1.1), rng.uniform(0.4, 0.46), rng.uniform(0.2, 0.4)
    aside = HandPlace((0.3, -0.34, 0.1), "shoulder", _DOWN)
    held = HandPlace((-0.1, -0.3, 0.26), "shoulder", _BACK)
    ahead = HandPlace((0.0, -0.34, 0.36), "shoulder", _DOWN)
    below = HandPlace((0.04, -0.5, 0.02), "shoulder", _BACK)
    behind = HandPlace((0.08, -0.26, -0.42), "shoulder", _BACK)

    def sequel(feet: _Feet) -> Sequel:
        def way(left: float, right: float, hand: HandPlace, low: float, lean: float, heel: str) -> Posture:
            at = {LEFT: left, RIGHT: right}
            put = {one: feet[one].tiptoe(30, at[one]) if one == heel else feet[one].flat(at[one]) for one in at}
            other = aside if hand is not held else held
            hands = {RIGHT: hand, LEFT: other}
            pelvis = (0.0, low, 0.5 * (left + right))
            return Posture(pelvis, (0.5 * lean, 0, 0), (0.5 * lean, 0, 0), (-0.7 * lean, 0, 0), hands=hands, feet=put)

        ends = 2.6 * step
        slid = {LEFT: feet[LEFT].flat(ends), RIGHT: replace(feet[RIGHT], out=-0.1).tiptoe(62, 0.9 * step)}
        low = Posture(
            (0.02, 0.66, ends - 0.3),
            (22, 0, 0),
            (20, -4, 0),
            (-30, 0, 0),
            hands={RIGHT: HandPlace((0.04, -0.5, 0.06), "shoulder", _BACK), LEFT: aside},
            feet=slid,
        )
        rolled = replace(low, hands={RIGHT: HandPlace((0.0, -0.24, 0.43), "shoulder", _DOWN), LEFT: aside})
        through = replace(
            low,
            pelvis=(0.02, 0.7, ends - 0.24),
            tilt=(14, 0, 4),
            spine=(12, 0, 4),
            neck=(-18, 0, 0),
            hands={RIGHT: HandPlace((-0.04, 0.2, 0.42), "shoulder", _DOWN), LEFT: aside},
        )
        done = Sequel([starts])
        done.then(0.6 * pace, way(0.0, 0.0, held, 0.92, 6, ""), 0.3)
        done.then(0.45 * pace, way(0.0, 0.7 * step, ahead, 0.9, 10, LEFT))
        done.then(0.4 * pace, way(1.4 * step, 0.7 * step, below, 0.87, 18, RIGHT))
        done.then(0.4 * pace, way(1.4 * step, 1.9 * step, behind, 0.83, 30, LEFT))
        done.then(0.34 * pace, replace(low, pelvis=(0.02, 0.74, ends - 0.34), hands={RIGHT: behind, LEFT: aside}))
        done.then(0.2 * pace, low)
        done.then(0.16 * pace, rolled)
        done.then(0.26 * pace, through, 0.35)
        return _ends(done, feet, ends)

    return on_feet(sequel, ["throw", "bowling"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)


def jump_shot(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """A jump straight up, at whose top a ball is shot from above the forehead.

    Args:
        rng: decides sizes and times.
        side: of the hand that shoots; empty = right.
        times: how many; None = one.
    """
    pace, flight, starts, times = rng.uniform(0.95, 1.1), rng.uniform(0.46, 0.54), rng.uniform(0.2, 0.4), times or 1
    low = both(HandPlace((-0.04, -0.26, 0.26), "shoulder", _DOWN))
    over = {
        RIGHT: HandPlace((-0.04, 0.3, 0.14), "shoulder", (0.6, 0.1, 1.0)),
        LEFT: HandPlace((-0.06, 0.28, 0.16), "shoulder", (1.0, 0.1, 0.5)),
    }
    shot = {
        RIGHT: HandPlace((-0.04, 0.4, 0.28), "shoulder", _OUT),
        LEFT: HandPlace((-0.02, 0.28, 0.22), "shoulder", _OUT),
    }

    def sequel(feet: _Feet) -> Sequel:
        toes = {one: foot.tiptoe(46) for one, foot in feet.items()}
        bent = Posture((0.0, 0.8, -0.03), (14, 0, 0), (10, 0, 0), (-26, 0, 0), hands=low)
        leaves = Posture((0.0, 0.98, 0.02), (0, 0, 0), (0, 0, 0), (-12, 0, 0), hands=over, feet=toes)
        lands = Posture((0.0, 0.95, 0.03), (2, 0, 0), (2, 0, 0), (-10, 0, 0), hands=shot, feet=toes)

        def shaped(share: float, rise: float) -> Posture:
            up = {one: foot.tiptoe(58, -0.02, rise) for one, foot in feet.items()}
            return replace(leaves, hands=over if share < 0.45 else shot, feet=up)

        done = Sequel([starts])
        for _ in range(times):
            done.then(0.6 * pace, replace(bent, pelvis=(0.0, 0.9, 0.0)), 0.15)
            done.then(0.32 * pace, bent)
            done.then(0.26, leaves)
            fly(done, flight, leaves, lands, shaped)
            flat = {one: foot.flat() for one, foot in feet.items()}
            done.then(0.18, Posture((0.0, 0.84, 0.0), (8, 0, 0), (6, 0, 0), (-14, 0, 0), hands=shot, feet=flat))
            done.then(0.34, Posture((0.0, 0.92, 0.0), hands=both(_LOWERED), feet=flat))
        return _ends(done, feet)

    told = ["jump-shot"]
    return on_feet(sequel, told, rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT, times=times)


def fencing_lunge(
    rng: random.Random, side: str = "", times: int | None = None, *, advances: bool | None = None
) -> Gesture:
    """A fencer on guard, who advances, lunges with the sword arm stretched, and recovers.

    Args:
        rng: decides sizes and times.
        side: of the sword arm and the front foot; empty = right.
        times: how many lunges; None = one.
        advances: with small steps before the first lunge; None = by chance.
    """
    times, pace, starts = times or 1, rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4)
    steps = 2 if advances or (advances is None and rng.random() < 0.6) else 0
    far = rng.uniform(0.44, 0.5)
    guard = {
        RIGHT: HandPlace((0.02, -0.12, 0.36), "shoulder", _DOWN),
        LEFT: HandPlace((0.1, 0.22, -0.22), "shoulder", (0.5, -0.1, -1.0)),
    }
    thrust = {
        RIGHT: HandPlace((-0.02, 0.03, 0.49), "shoulder", _DOWN),
        LEFT: HandPlace((0.12, -0.18, -0.42), "shoulder", _DOWN),
    }
    rear: Point = (0.98, -0.05, 0.15)

    def sequel(feet: _Feet) -> Sequel:
        def feet_at(front: float, back: float, roll: float = 0.0) -> dict[str, FootPlace]:
            return {
                RIGHT: FootPlace((0.05, 0.07, front), (0.05, -0.45, 0.9)),
                LEFT: FootPlace((0.06, 0.07, back), (rear[0], -0.45 - roll, rear[2])),
            }

        def on_guard(at: float, hands: dict[str, HandPlace] = guard, apart: float = 0.48) -> Posture:
            put = feet_at(at + apart, at)
            knees: dict[str, Point] = {RIGHT: (0.05, 0.0, 1.0), LEFT: (1.0, 0.0, 0.3)}
            turn = 46
            pelvis = (0.0, 0.83, at + 0.5 * apart)
            return Posture(pelvis, (2, 0, turn), (2, 0, 18), (0, 0, -52), hands=hands, feet=put, knees=knees)

        def lunged(at: float) -> Posture:
            put = feet_at(at + 0.48 + far, at)
            knees: dict[str, Point] = {RIGHT: (0.05, 0.2, 1.0), LEFT: (0.7, 0.1, 0.7)}
            pelvis = (0.0, 0.63, at + 0.48 + far - 0.38)
            return Posture(pelvis, (6, 0, 52), (8, 0, 22), (-8, 0, -60), hands=thrust, feet=put, knees=knees)

        done, at = Sequel([starts]), -0.16
        done.then(0.7 * pace, on_guard(at), 0.3)
        for _ in range(steps):
            done.then(0.2 * pace, on_guard(at, apart=0.66))
            at += 0.18
            done.then(0.2 * pace, on_guard(at), 0.08)
        for _ in range(times):
            reached = on_guard(at, {RIGHT: thrust[RIGHT], LEFT: guard[LEFT]})
            done.then(0.2 * pace, reached)
            done.then(0.3 * pace, lunged(at), 0.3)
            done.then(0.5 * pace, on_guard(at), 0.25)
        middle = at + 0.2
        upright = {one: foot.flat(middle) for one, foot in feet.items()}
        done.then(0.7 * pace, Posture((0.0, 0.94, middle), feet=upright))
        return done

    told = ["fencing-lunge"]
    return on_feet(sequel, told, rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT, times=times)


def _stride(feet: _Feet, far: float, heel: float = 0.0, rear: float = 0.0) -> dict[str, FootPlace]:
    """Both feet, the left one `far` metres ahead, the heel of the right one lifted until the foot points down by
    `heel` degrees."""
    back = feet[RIGHT].tiptoe(heel, rear) if heel else feet[RIGHT].flat(rear)
    return {LEFT: feet[LEFT].flat(far), RIGHT: back}


def _ends(done: Sequel, feet: _Feet, at: float = 0.0) -> Sequel:
    """Add the end of a movement: the feet come together, metres forward of where they stood, and the body stands."""
    done.then(0.6, Posture((0.0, 0.94, at), feet={side: foot.flat(at) for side, foot in feet.items()}))
    return done
