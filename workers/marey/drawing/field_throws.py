"""Throws of field sports: javelin, discus, shot and frisbee.

They are drawn for the right hand, and mirrored for the left one.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import replace

from marey.drawing.flights import StandingFeet, come_together, on_feet, stride_ahead
from marey.drawing.gesture import Gesture
from marey.drawing.postures import ELBOW_BACK, ELBOW_DOWN, ELBOW_OUT, LOWERED, TUCKED, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_POINTING = HandPlace((0.04, 0.06, 0.47), "shoulder", ELBOW_DOWN)


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


def _javelin(rng: random.Random) -> Callable[[StandingFeet], Sequel]:
    pace, step, starts = rng.uniform(0.95, 1.1), rng.uniform(0.5, 0.58), rng.uniform(0.2, 0.4)
    drawn = HandPlace((0.2, 0.12, -0.44), "shoulder", ELBOW_OUT)
    carried = HandPlace((0.12, 0.2, -0.06), "shoulder", (1.0, -0.2, -0.3))

    def way(
        feet: StandingFeet, left: float, right: float, hands: dict[str, HandPlace], turn: float, heel: str
    ) -> Posture:
        at = {LEFT: left, RIGHT: right}
        put = {one: feet[one].tiptoe(28, at[one]) if one == heel else feet[one].flat(at[one]) for one in at}
        pelvis = (0.0, 0.9, 0.5 * (left + right))
        return Posture(pelvis, (-3, 0, -0.5 * turn), (-4, 0, -0.5 * turn), (0, 0, 0.8 * turn), hands=hands, feet=put)

    def sequel(feet: StandingFeet) -> Sequel:
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
                LEFT: HandPlace((0.14, -0.14, 0.3), "shoulder", ELBOW_BACK),
                RIGHT: HandPlace((0.24, 0.2, -0.22), "shoulder", (1.0, 0.4, 0.2)),
            },
            feet=planted,
        )
        let_go = replace(
            bow,
            pelvis=(0.0, 0.92, ends - 0.1),
            tilt=(10, 0, 12),
            spine=(12, -8, 12),
            hands={LEFT: TUCKED, RIGHT: HandPlace((0.0, 0.36, 0.34), "shoulder", ELBOW_OUT)},
        )
        stopped = Posture(
            (0.0, 0.84, ends + 0.24),
            (20, 0, 20),
            (22, 0, 18),
            (-26, 0, -14),
            hands={LEFT: TUCKED, RIGHT: HandPlace((-0.26, -0.4, 0.24), "shoulder", ELBOW_OUT)},
            feet={LEFT: feet[LEFT].tiptoe(40, ends), RIGHT: feet[RIGHT].flat(ends + 0.5)},
        )
        done.then(0.2, bow)
        done.then(0.16, let_go)
        done.then(0.36, stopped, 0.2)
        return come_together(done, feet, ends + 0.5)

    return sequel


def _discus(rng: random.Random) -> Callable[[StandingFeet], Sequel]:
    pace, starts, wide = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.17, 0.22)
    swings = rng.choice((1, 2))

    def sequel(feet: StandingFeet) -> Sequel:
        stance = {one: replace(feet[one], out=feet[one].out + wide).flat(0.06 if one == LEFT else -0.1) for one in feet}
        turned = {LEFT: stance[LEFT], RIGHT: replace(feet[RIGHT], out=feet[RIGHT].out + wide).tiptoe(40, -0.1)}

        def wound(share: float) -> Posture:
            hands = {
                LEFT: HandPlace((-0.12, -0.06, 0.36), "trunk", ELBOW_OUT),
                RIGHT: HandPlace((0.46, -0.2, -0.3 * share), "trunk", ELBOW_DOWN),
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
                LEFT: HandPlace((0.34, -0.16, 0.2), "trunk", ELBOW_DOWN),
                RIGHT: HandPlace((-0.14, -0.16, 0.36), "trunk", ELBOW_OUT),
            },
            feet=stance,
        )
        let_go = Posture(
            (0.12, 0.95, 0.02),
            (-6, 0, 34),
            (-10, 0, 10),
            (-6, 0, -30),
            hands={
                LEFT: HandPlace((0.3, -0.3, -0.1), "trunk", ELBOW_BACK),
                RIGHT: HandPlace((0.36, 0.1, 0.34), "trunk", ELBOW_DOWN),
            },
            feet=turned,
        )
        stopped = replace(
            let_go,
            tilt=(2, 0, 48),
            spine=(4, 0, 34),
            neck=(0, 0, -44),
            hands={
                LEFT: HandPlace((0.32, -0.3, -0.1), "trunk", ELBOW_BACK),
                RIGHT: HandPlace((-0.16, 0.14, 0.4), "trunk", ELBOW_OUT),
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
        return come_together(done, feet)

    return sequel


def _shot(rng: random.Random) -> Callable[[StandingFeet], Sequel]:
    pace, starts, stride = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.4, 0.48)
    neck = HandPlace((-0.06, 0.05, 0.13), "shoulder", (1.0, -0.3, -0.2))

    def sequel(feet: StandingFeet) -> Sequel:
        held = Posture((0.0, 0.93, 0.0), (4, 0, -10), (0, 0, -10), hands={RIGHT: neck, LEFT: LOWERED})
        stance = {LEFT: feet[LEFT].flat(stride), RIGHT: feet[RIGHT].flat(-0.08)}
        crouched = Posture(
            (-0.06, 0.78, 0.02),
            (16, 0, -46),
            (16, 0, -36),
            (-10, 0, 20),
            hands={RIGHT: neck, LEFT: HandPlace((-0.1, -0.06, 0.38), "trunk", ELBOW_OUT)},
            feet=stance,
        )
        drives = Posture(
            (0.0, 0.88, 0.62 * stride),
            (-8, 0, -10),
            (-8, 0, -6),
            (-14, 0, 10),
            hands={RIGHT: neck, LEFT: HandPlace((0.3, 0.0, 0.24), "trunk", ELBOW_DOWN)},
            feet=stride_ahead(feet, stride, heel=30, rear=-0.08),
        )
        let_go = Posture(
            (0.03, 0.95, 0.88 * stride),
            (0, 0, 26),
            (-2, -8, 22),
            (-16, 0, -30),
            hands={RIGHT: HandPlace((-0.02, 0.3, 0.4), "shoulder", ELBOW_OUT), LEFT: TUCKED},
            feet=stride_ahead(feet, stride, heel=52, rear=0.0),
        )
        stopped = Posture(
            (0.0, 0.86, stride + 0.1),
            (18, 0, 24),
            (14, 0, 16),
            (-20, 0, -24),
            hands={RIGHT: HandPlace((-0.1, -0.08, 0.42), "shoulder", ELBOW_OUT), LEFT: TUCKED},
            feet={LEFT: feet[LEFT].tiptoe(40, stride), RIGHT: feet[RIGHT].flat(stride + 0.34)},
        )
        done = Sequel([starts])
        done.then(0.7 * pace, held, 0.3)
        done.then(0.8 * pace, crouched, 0.2)
        done.then(0.3, drives)
        done.then(0.2, let_go, 0.06)
        done.then(0.45, stopped, 0.2)
        return come_together(done, feet, stride + 0.34)

    return sequel


def _frisbee(rng: random.Random) -> Callable[[StandingFeet], Sequel]:
    pace, starts, stride = rng.uniform(0.95, 1.12), rng.uniform(0.2, 0.4), rng.uniform(0.26, 0.36)

    def sequel(feet: StandingFeet) -> Sequel:
        stance = {RIGHT: feet[RIGHT].flat(stride), LEFT: feet[LEFT].flat(0.0)}
        held = Posture(
            (0.0, 0.93, 0.0),
            (4, 0, 12),
            (2, 0, 10),
            hands={
                RIGHT: HandPlace((-0.12, -0.28, 0.3), "shoulder", ELBOW_OUT),
                LEFT: HandPlace((-0.04, -0.3, 0.3), "shoulder", ELBOW_DOWN),
            },
        )
        wound = Posture(
            (0.04, 0.87, 0.3 * stride),
            (8, 0, 38),
            (8, 0, 38),
            (-6, 0, -54),
            hands={RIGHT: HandPlace((-0.34, -0.26, 0.16), "trunk", ELBOW_OUT), LEFT: LOWERED},
            feet=stance,
        )
        let_go = Posture(
            (0.0, 0.9, 0.85 * stride),
            (4, 0, 4),
            (4, 0, -8),
            (-4, 0, 4),
            hands={
                RIGHT: HandPlace((0.1, -0.14, 0.46), "shoulder", ELBOW_OUT),
                LEFT: HandPlace((0.24, -0.36, -0.08), "shoulder", ELBOW_BACK),
            },
            feet={RIGHT: stance[RIGHT], LEFT: feet[LEFT].tiptoe(30)},
        )
        stopped = replace(
            let_go,
            tilt=(2, 0, -8),
            spine=(2, 0, -20),
            neck=(-4, 0, 22),
            hands={RIGHT: HandPlace((0.36, 0.02, 0.3), "shoulder", ELBOW_DOWN), LEFT: let_go.hands[LEFT]},
        )
        done = Sequel([starts])
        done.then(0.6 * pace, held, 0.25)
        done.then(0.65 * pace, wound, 0.12)
        done.then(0.24, let_go)
        done.then(0.24, stopped, 0.3)
        return come_together(done, feet)

    return sequel


_FIELD: Mapping[str, Callable[[random.Random], Callable[[StandingFeet], Sequel]]] = {
    "javelin": _javelin,
    "discus": _discus,
    "shot": _shot,
    "frisbee": _frisbee,
}
