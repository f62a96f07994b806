"""A ball that is bowled in cricket: a run, a bound with the side ahead, and a straight arm that comes over the
shoulder. Drawn for the right arm, and mirrored for the left one."""

from __future__ import annotations

import random
from dataclasses import replace

from marey.drawing.flights import StandingFeet, come_together, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import ELBOW_BACK, ELBOW_DOWN, ELBOW_OUT, TUCKED, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT


def cricket_ball(rng: random.Random, side: str = "", *, brief: bool = False) -> Gesture:
    """A ball that is bowled overarm.

    Args:
        rng: decides sizes and times.
        side: of the arm; empty = right.
        brief: the run was before it: two steps lead to the bound.
    """
    pace, step, starts = rng.uniform(0.92, 1.05), rng.uniform(0.6, 0.7), rng.uniform(0.15, 0.35)
    run = 2 if brief else 4
    chin = HandPlace((-0.12, -0.04, 0.16), "shoulder", ELBOW_OUT)
    aloft = HandPlace((-0.02, 0.48, 0.1), "shoulder", ELBOW_DOWN)
    below = HandPlace((0.12, -0.46, -0.16), "shoulder", ELBOW_BACK)
    behind = HandPlace((0.14, -0.06, -0.48), "shoulder", (0.6, 0.2, -1.0))
    rising = HandPlace((0.1, 0.34, -0.38), "shoulder", (0.9, -0.2, -0.4))
    over = HandPlace((0.02, 0.52, 0.04), "shoulder", ELBOW_OUT)
    let_go = HandPlace((-0.02, 0.42, 0.3), "shoulder", ELBOW_OUT)
    ahead = HandPlace((-0.1, 0.06, 0.48), "shoulder", ELBOW_OUT)
    across = HandPlace((-0.34, -0.36, 0.22), "shoulder", ELBOW_OUT)
    pulled = HandPlace((0.06, -0.28, 0.06), "shoulder", ELBOW_BACK)

    def sequel(feet: StandingFeet) -> Sequel:
        def way(left: float, right: float, heel: str, ahead: str) -> Posture:
            """A step of the run; the arm of the other side than the foot ahead is ahead."""
            at = {LEFT: left, RIGHT: right}
            put = {one: feet[one].tiptoe(40, at[one]) if one == heel else feet[one].flat(at[one]) for one in at}
            swung = {
                one: HandPlace((0.04, -0.24, 0.22 if one != ahead else -0.16), "shoulder", ELBOW_BACK) for one in at
            }
            return Posture((0.0, 0.88, 0.5 * (left + right) + 0.06), (6, 0, 0), (4, 0, 0), (-6, 0, 0), 0.0, swung, put)

        done = Sequel([starts])
        at = {LEFT: 0.0, RIGHT: 0.0}
        for number in range(run):
            foot, rear = (LEFT, RIGHT) if number % 2 == 0 else (RIGHT, LEFT)
            at[foot] = at[rear] + (0.5 if number == 0 else 0.86) * step
            done.then((0.36 if number == 0 else 0.3) * pace, way(at[LEFT], at[RIGHT], rear, foot))
        gathers = at[RIGHT]
        bound = {LEFT: feet[LEFT].tiptoe(50, gathers + 0.25 * step), RIGHT: feet[RIGHT].tiptoe(20, gathers, 0.06)}
        rises = Posture((0.0, 0.95, gathers + 0.1), (-4, 0, -24), (-4, 0, -12), (0, 0, 28), 0.0,
                        {LEFT: aloft, RIGHT: chin}, bound)  # fmt: skip
        lands = gathers + 0.7 * step
        back_foot = {LEFT: feet[LEFT].tiptoe(30, lands + 0.1, 0.24), RIGHT: feet[RIGHT].flat(lands)}
        coils = Posture((0.0, 0.86, lands - 0.04), (-10, 0, -34), (-10, -8, -16), (0, 0, 42), 0.0,
                        {LEFT: aloft, RIGHT: below}, back_foot)  # fmt: skip
        plants = lands + 1.15 * step
        front = {LEFT: feet[LEFT].flat(plants), RIGHT: feet[RIGHT].tiptoe(40, lands + 0.04)}
        point = HandPlace((0.0, 0.12, 0.46), "shoulder", ELBOW_DOWN)
        strides = Posture((0.0, 0.86, 0.5 * (lands + plants)), (-6, 0, -22), (-8, -6, -10), (0, 0, 28), 0.0,
                          {LEFT: point, RIGHT: behind}, front)  # fmt: skip
        tall = Posture((0.0, 0.9, plants - 0.2), (6, 0, 8), (2, -10, 6), (-6, 0, -8), 0.0,
                       {LEFT: pulled, RIGHT: over}, front)  # fmt: skip
        comes = replace(tall, tilt=(0, 0, -6), spine=(-4, -10, -2), hands={LEFT: pulled, RIGHT: rising})
        bends = replace(tall, tilt=(14, 0, 14), spine=(12, -8, 12), hands={LEFT: pulled, RIGHT: let_go})
        through = {LEFT: feet[LEFT].tiptoe(36, plants), RIGHT: feet[RIGHT].flat(plants + 0.7 * step)}
        follows = Posture((0.0, 0.84, plants + 0.26), (22, 0, 20), (22, 0, 20), (-28, 0, -16), 0.0,
                          {LEFT: TUCKED, RIGHT: across}, through)  # fmt: skip
        done.then(0.22 * pace, rises)
        done.then(0.24 * pace, coils)
        done.then(0.24 * pace, strides)
        done.then(0.1, comes)
        done.then(0.08, tall)
        done.then(0.08, bends)
        done.then(0.1, replace(bends, tilt=(18, 0, 18), spine=(18, -2, 16), hands={LEFT: pulled, RIGHT: ahead}))
        done.then(0.26, follows, 0.12)
        ends = plants + 0.7 * step
        return come_together(done, feet, ends)

    return on_feet(sequel, ["throw", "cricket"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)
