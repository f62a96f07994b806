"""Balls that are dribbled on the spot or at a walk; see `marey.data.gestures`."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.data.part import FPS, Part
from marey.data.retime import LIMIT
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.stances import settle, step
from marey.posing.standing import OTHER_SIDE, StandingBody, eased, envelope

Array = NDArray[np.floating]

_NECK = (12,)
_LEAST_STROKES = 5


def dribble(rng: random.Random) -> Gesture:
    drawn = _Dribble(rng)
    kinds = ["dribble", "dribble-low" if drawn.low else "dribble-high"]
    kinds += ["dribble-walk" if drawn.walks else "dribble-stand", "dribble-cross" if drawn.crosses else "dribble-hand"]
    seconds = min(drawn.end + (drawn.fall + 0.5 if drawn.ends else 0.0), 9.6)
    content, base = ("walk", drawn.base) if drawn.walks else ("idle", None)
    return Gesture(seconds, tuple(kinds), drawn.change, drawn.side, base=base, content=content)


class _Dribble:
    """A ball that is dribbled.

    Attributes:
        walks, low, crosses: at a walk, with the ball low, and from hand to hand, `every` so many seconds.
        side: of the hand that has the ball first.
        rate, strong, phase: strokes a second, metres of each to either side of its middle, and their phase.
        bent, sink, gaze: degrees of the trunk, metres by which the hips go down, and how far the head stays up.
        start, rise, end, fall: seconds of the way into the stance and out of it, if it `ends`.
        place, guard: where the hand with the ball is, from its shoulder at the height of the hips, and the other one.
        guards: the hand without the ball is held before the body.
        apart: metres of the feet outward and back.
    """

    def __init__(self, rng: random.Random) -> None:
        self.walks = walks = rng.random() < 0.35
        self.low, self.crosses = not walks and rng.random() < 0.35, not walks and rng.random() < 0.3
        self.side = rng.choice(SIDES)
        self.rate = rng.uniform(1.9, 2.7) if self.low else rng.uniform(1.25, 2.1)
        self.strong = rng.uniform(0.07, 0.1) if self.low else rng.uniform(0.09, 0.15)
        bent = rng.uniform(26, 42) if self.low else rng.uniform(10, 26)
        self.bent = 0.6 * bent if walks else bent
        sink = rng.uniform(0.08, 0.16) if self.low else rng.uniform(0.02, 0.09)
        self.sink = 0.3 * sink if walks else sink
        begins = walks or rng.random() < 0.4
        self.start, self.rise, self.fall = -2.0 if begins else rng.uniform(0.1, 0.5), 0.5, rng.uniform(0.5, 0.8)
        strokes = rng.randint(_LEAST_STROKES, 10) if not self.crosses else rng.choice((8, 9, 10, 12))
        self.end = max(self.start, -self.rise) + self.rise + strokes / self.rate
        self.ends = not walks and rng.random() < 0.6
        up = rng.uniform(0.02, 0.08) if self.low else rng.uniform(0.08, 0.16)
        self.place = np.array([rng.uniform(0.18, 0.26), up, rng.uniform(0.26, 0.36)])
        self.guard = np.array([rng.uniform(0.12, 0.26), rng.uniform(-0.36, -0.2), rng.uniform(0.14, 0.3)])
        self.guards = self.crosses or rng.random() < 0.6
        self.apart = rng.uniform(0.02, 0.08), rng.uniform(0.0, 0.2)
        self.gaze, self.phase = rng.uniform(-0.4, 0.2), rng.uniform(0, 6.28)
        self.every = rng.choice((4, 5)) / self.rate

    def base(self, part: Part) -> Array | None:
        """The captured walk, if it lasts long enough."""
        joints = part.joints[:LIMIT].astype(np.float64)
        return joints if len(joints) * self.rate >= (_LEAST_STROKES + 1) * FPS else None

    def change(self, body: StandingBody) -> None:
        """See `Gesture`."""
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        hold = self.end - self.start - self.rise if self.ends else 60.0
        way = envelope(frames, self.start, self.rise, hold, self.fall)
        beat = 2 * np.pi * self.rate * t + self.phase
        stroke = self.strong * (np.cos(beat) + 0.16 * np.cos(2 * beat))
        if not self.walks:
            _stand_apart(body, self.side, self.apart, self.start - 0.1, self.end if self.ends else None)
            body.shift(np.zeros(frames), -0.35 * self.apart[1] * way)
        body.shift(-self.sink * way - 0.06 * self.strong * way * (1 - np.cos(beat + 0.6)))
        body.bow((self.bent - 12 * stroke) * way, arms_hang=0.8, head=self.gaze)
        if not self.walks:
            settle(body)
        self._move_hands(body, way, stroke, _turns(t, self.every, crosses=self.crosses))

    def _move_hands(self, body: StandingBody, way: Array, stroke: Array, turn: Array) -> None:
        """Move each hand with the ball while it has it, and before the body else.

        Args:
            stroke: (T,) metres of the ball over the middle of its strokes.
            turn: see `_turns`.
        """
        hips = body.joints[:, 0]
        for one, active in ((self.side, 1 - turn), (OTHER_SIDE[self.side], turn)):
            if one != self.side and not self.guards:
                body.lift_arm(one, 8 * way)
                continue
            ball = body.from_shoulder(one, hips) + self.place + stroke[:, None] * np.array([0.0, 1.0, -0.12])
            inward = 4 * turn * (1 - turn)
            ball[:, 0] -= 0.16 * inward
            waits = body.from_shoulder(one, body.joints[:, [16, 17]].mean(1)) + self.guard
            w = active[:, None]
            body.move_arm(one, way, *body.reach(one, w * ball + (1 - w) * waits, (0.6, -0.6, -0.8)), 0.02)


def _stand_apart(body: StandingBody, side: str, apart: tuple[float, float], start: float, end: float | None) -> None:
    """Step apart at `start`, the foot of the ball back, and together again at `end` seconds.

    Args:
        side: of the hand that has the ball first.
        apart: metres of each foot outward, and of that foot back.
    """
    wide, back = apart
    for one, ahead, waits in ((side, -back, 0.1), (OTHER_SIDE[side], 0.3 * back, 0.4)):
        step(body, one, (wide, ahead), start, 0.4)
        if end is not None:
            step(body, one, (-wide, -ahead), end + waits, 0.4)


def _turns(t: Array, every: float, *, crosses: bool) -> Array:
    """0 while the first hand has the ball, 1 while the other has it, (T,)."""
    if not crosses:
        return np.zeros_like(t)
    within = np.mod(t, 2 * every)
    return eased((within - every + 0.1) / 0.2) * (1 - eased((within - 2 * every + 0.1) / 0.2))
