"""Movements of sports: a tennis serve, bowling, a jump shot, a volleyball spike, a lunge of fencing.

They are drawn for the right hand, and mirrored for the left one.
"""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, come_together, fly, on_feet, stride_ahead
from marey.drawing.gesture import Gesture
from marey.drawing.postures import (
    ELBOW_BACK,
    ELBOW_DOWN,
    ELBOW_OUT,
    LOWERED,
    TUCKED,
    FootPlace,
    HandPlace,
    Point,
    Posture,
)
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import LEFT, RIGHT


def tennis_serve(rng: random.Random, side: str = "") -> Gesture:
    """A ball that is tossed up with one hand and struck overhead with the other.

    Args:
        rng: decides sizes and times.
        side: of the hand that strikes; empty = right.
    """
    pace, stride, turn = rng.uniform(0.95, 1.12), rng.uniform(0.26, 0.34), rng.uniform(34, 44)
    starts = rng.uniform(0.25, 0.5)

    def sequel(feet: StandingFeet) -> Sequel:
        stance = stride_ahead(feet, stride)
        ready = Posture(
            (0.0, 0.93, 0.4 * stride),
            (4, 0, -0.6 * turn),
            (6, 0, -0.4 * turn),
            (0, 0, 0.7 * turn),
            hands={
                LEFT: HandPlace((-0.1, -0.22, 0.36), "shoulder", ELBOW_DOWN),
                RIGHT: HandPlace((-0.12, -0.24, 0.32), "shoulder", ELBOW_DOWN),
            },
            feet=stance,
        )
        parted = replace(
            ready,
            pelvis=(0.0, 0.92, 0.35 * stride),
            hands={
                LEFT: HandPlace((0.02, -0.44, 0.18), "shoulder", ELBOW_DOWN),
                RIGHT: HandPlace((0.2, -0.42, -0.08), "shoulder", ELBOW_BACK),
            },
        )
        trophy = Posture(
            (0.0, 0.86, 0.55 * stride),
            (-8, 0, -0.7 * turn),
            (-10, 6, -0.6 * turn),
            (-22, 0, 0.7 * turn),
            hands={
                LEFT: HandPlace((-0.02, 0.48, 0.12), "shoulder", ELBOW_DOWN),
                RIGHT: HandPlace((0.24, 0.1, -0.16), "shoulder", (1.0, -0.1, -0.6)),
            },
            feet=stance,
        )
        dropped = replace(
            trophy,
            pelvis=(0.0, 0.91, 0.7 * stride),
            spine=(-12, 6, -0.4 * turn),
            hands={
                LEFT: HandPlace((0.0, 0.3, 0.34), "shoulder", ELBOW_DOWN),
                RIGHT: HandPlace((0.04, 0.1, -0.2), "shoulder", (1.0, 0.7, 0.1)),
            },
        )
        raised = stride_ahead(feet, stride, heel=30)
        struck = Posture(
            (0.0, 0.95, 0.95 * stride),
            (4, 0, 4),
            (6, -10, 12),
            (-16, 0, -8),
            hands={LEFT: TUCKED, RIGHT: HandPlace((-0.02, 0.5, 0.1), "shoulder", ELBOW_OUT)},
            feet=raised,
        )
        through = replace(
            struck,
            tilt=(14, 0, 14),
            spine=(16, 0, 18),
            neck=(-10, 0, -10),
            hands={LEFT: TUCKED, RIGHT: HandPlace((-0.02, 0.08, 0.46), "shoulder", ELBOW_OUT)},
        )
        stopped = Posture(
            (0.0, 0.89, 1.0 * stride),
            (14, 0, 22),
            (18, 0, 24),
            (-18, 0, -18),
            hands={LEFT: TUCKED, RIGHT: HandPlace((-0.32, -0.36, 0.24), "shoulder", ELBOW_OUT)},
            feet=stride_ahead(feet, stride, heel=45),
        )
        done = Sequel([starts])
        done.then(0.6 * pace, ready, 0.25)
        done.then(0.45 * pace, parted)
        done.then(0.6 * pace, trophy, 0.2 * pace)
        done.then(0.2 * pace, dropped)
        done.then(0.17, struck)
        done.then(0.14, through)
        done.then(0.22, stopped, 0.2)
        return come_together(done, feet)

    return on_feet(sequel, ["tennis-serve"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)


def bowling(rng: random.Random, side: str = "") -> Gesture:
    """A ball that is bowled: three steps while the arm swings back, a low slide, and a swing through to the front.

    Args:
        rng: decides sizes and times.
        side: of the hand; empty = right.
    """
    pace, step, starts = rng.uniform(0.95, 1.1), rng.uniform(0.4, 0.46), rng.uniform(0.2, 0.4)
    aside = HandPlace((0.3, -0.34, 0.1), "shoulder", ELBOW_DOWN)
    held = HandPlace((-0.1, -0.3, 0.26), "shoulder", ELBOW_BACK)
    ahead = HandPlace((0.0, -0.34, 0.36), "shoulder", ELBOW_DOWN)
    below = HandPlace((0.04, -0.5, 0.02), "shoulder", ELBOW_BACK)
    behind = HandPlace((0.08, -0.26, -0.42), "shoulder", ELBOW_BACK)

    def sequel(feet: StandingFeet) -> Sequel:
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
            hands={RIGHT: HandPlace((0.04, -0.5, 0.06), "shoulder", ELBOW_BACK), LEFT: aside},
            feet=slid,
        )
        rolled = replace(low, hands={RIGHT: HandPlace((0.0, -0.24, 0.43), "shoulder", ELBOW_DOWN), LEFT: aside})
        through = replace(
            low,
            pelvis=(0.02, 0.7, ends - 0.24),
            tilt=(14, 0, 4),
            spine=(12, 0, 4),
            neck=(-18, 0, 0),
            hands={RIGHT: HandPlace((-0.04, 0.2, 0.42), "shoulder", ELBOW_DOWN), LEFT: aside},
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
        return come_together(done, feet, ends)

    return on_feet(sequel, ["throw", "bowling"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)


def jump_shot(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """A jump straight up, at whose top a ball is shot from above the forehead.

    Args:
        rng: decides sizes and times.
        side: of the hand that shoots; empty = right.
        times: how many; None = one.
    """
    pace, flight, starts, times = rng.uniform(0.95, 1.1), rng.uniform(0.46, 0.54), rng.uniform(0.2, 0.4), times or 1
    low = both(HandPlace((-0.04, -0.26, 0.26), "shoulder", ELBOW_DOWN))
    over = {
        RIGHT: HandPlace((-0.04, 0.3, 0.14), "shoulder", (0.6, 0.1, 1.0)),
        LEFT: HandPlace((-0.06, 0.28, 0.16), "shoulder", (1.0, 0.1, 0.5)),
    }
    shot = {
        RIGHT: HandPlace((-0.04, 0.4, 0.28), "shoulder", ELBOW_OUT),
        LEFT: HandPlace((-0.02, 0.28, 0.22), "shoulder", ELBOW_OUT),
    }

    def sequel(feet: StandingFeet) -> Sequel:
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
            done.then(0.34, Posture((0.0, 0.92, 0.0), hands=both(LOWERED), feet=flat))
        return come_together(done, feet)

    told = ["jump-shot"]
    return on_feet(sequel, told, rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT, times=times)


def spike(rng: random.Random, side: str = "", times: int | None = None) -> Gesture:
    """A high jump with both arms, at whose top one hand strikes a ball down over the net.

    Args:
        rng: decides sizes and times.
        side: of the hand that strikes; empty = right.
        times: how many; None = one.
    """
    pace, flight, starts, times = rng.uniform(0.95, 1.1), rng.uniform(0.58, 0.66), rng.uniform(0.2, 0.4), times or 1
    behind = both(HandPlace((0.1, -0.34, -0.3), "shoulder", ELBOW_BACK))
    up = both(HandPlace((0.04, 0.34, 0.26), "shoulder", ELBOW_OUT))
    wound = {
        RIGHT: HandPlace((0.16, 0.24, -0.18), "shoulder", (0.9, 0.3, -0.4)),
        LEFT: HandPlace((-0.02, 0.4, 0.24), "shoulder", ELBOW_OUT),
    }
    struck = {
        RIGHT: HandPlace((0.0, 0.48, 0.2), "shoulder", ELBOW_OUT),
        LEFT: HandPlace((0.06, -0.1, 0.26), "shoulder", ELBOW_DOWN),
    }
    through = {
        RIGHT: HandPlace((-0.1, -0.28, 0.38), "shoulder", ELBOW_OUT),
        LEFT: HandPlace((0.1, -0.3, 0.16), "shoulder", ELBOW_DOWN),
    }

    def sequel(feet: StandingFeet) -> Sequel:
        toes = {one: foot.tiptoe(46) for one, foot in feet.items()}
        bent = Posture((0.0, 0.74, -0.05), (26, 0, 0), (16, 0, 0), (-34, 0, 0), hands=behind)
        leaves = Posture((0.0, 0.98, 0.02), (0, 0, 0), (-4, 0, 0), (-14, 0, 0), hands=up, feet=toes)
        lands = Posture((0.0, 0.94, 0.03), (10, 0, 0), (10, 0, 0), (-10, 0, 0), hands=through, feet=toes)

        def shaped(share: float, rise: float) -> Posture:
            off = {one: foot.tiptoe(58, -0.04, rise) for one, foot in feet.items()}
            if share < 0.45:
                return replace(leaves, spine=(-12, 0, 0), hands=wound, feet=off)
            bends, hands = (4.0, struck) if share < 0.65 else (14.0, through)
            return replace(leaves, spine=(bends, 0, 0), hands=hands, feet=off)

        done = Sequel([starts])
        for _ in range(times):
            done.then(0.45 * pace, replace(bent, pelvis=(0.0, 0.88, -0.02)))
            done.then(0.32 * pace, bent)
            done.then(0.24, leaves)
            fly(done, flight, leaves, lands, shaped)
            flat = {one: foot.flat() for one, foot in feet.items()}
            done.then(0.18, Posture((0.0, 0.8, 0.0), (18, 0, 0), (14, 0, 0), (-16, 0, 0), hands=through, feet=flat))
            done.then(0.4, Posture((0.0, 0.92, 0.0), hands=both(LOWERED), feet=flat))
        return come_together(done, feet)

    told = ["volleyball-spike"]
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
        RIGHT: HandPlace((0.02, -0.12, 0.36), "shoulder", ELBOW_DOWN),
        LEFT: HandPlace((0.1, 0.22, -0.22), "shoulder", (0.5, -0.1, -1.0)),
    }
    thrust = {
        RIGHT: HandPlace((-0.02, 0.03, 0.49), "shoulder", ELBOW_DOWN),
        LEFT: HandPlace((0.12, -0.18, -0.42), "shoulder", ELBOW_DOWN),
    }
    rear: Point = (0.98, -0.05, 0.15)

    def sequel(feet: StandingFeet) -> Sequel:
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
