"""Bows that are drawn."""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.parts import respond
from marey.drawing.stances import glide, settle, step, turn_hips
from marey.posing.standing import ARMS, LEFT, OTHER_SIDE, StandingBody, direction, envelope

Array = NDArray[np.floating]

_ARM = 0.52
"""Metres from shoulder to wrist."""
_HEAD, _NECK = 15, (12,)
_LONGEST = 9.6


def draw_bow(rng: random.Random) -> Gesture:
    side = rng.choices(SIDES, (3, 2))[0]
    aside, up = rng.uniform(20, 74), rng.uniform(-7, 12)
    looses, nocks = rng.random() < 0.75, rng.random() < 0.5
    shots = 2 if looses and rng.random() < 0.25 else 1
    start, lift = rng.uniform(0.05, 0.8), rng.uniform(0.45, 0.9)
    wait = rng.uniform(0.4, 1.1) if nocks else 0.0
    draw, hold = rng.uniform(0.5, 1.3), rng.uniform(0.4, 2.6) / shots
    again, rest, fall = rng.uniform(0.9, 1.4), rng.uniform(0.3, 1.0), rng.uniform(0.5, 1.0)
    rise = start + lift + wait  # the bow arm is up and the draw begins
    at, drawn = _pulls(rng, rise, shots, (draw, hold, again), looses=looses)
    end = at[-1] + rest
    low = (rng.uniform(-0.02, 0.06), rng.uniform(-0.32, -0.2), rng.uniform(0.28, 0.36))
    cheek = (
        rng.uniform(0.1, 0.13),
        rng.uniform(-0.13, -0.06),
        rng.uniform(-0.11, -0.02),
    )  # aside, up, toward the target
    bow_hand = _BowHand(side, low)
    string_hand = _StringHand(OTHER_SIDE[side], cheek, rng.uniform(0.08, 0.4))
    twist, hips = rng.uniform(0.4, 0.6) * (90 - aside), rng.uniform(6, 22)
    stride, turn, steps = rng.uniform(0.08, 0.22), rng.uniform(0, 25), rng.random() < 0.6
    sink, stands = rng.uniform(0.0, 0.03), -1.0 if rng.random() < 0.5 else max(start - 0.2, 0.0)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        way = envelope(frames, start, lift, end - start - lift, fall)
        raised = envelope(frames, start + (lift + 0.3 * wait if nocks else 0.0), max(lift, 0.6), 60.0, 1.0)
        pulled = glide(frames, at, [[one] for one in drawn])[:, 0]
        if steps:  # a foot stands or steps toward the target
            step(body, side, (stride, 0.1), stands, 0.5, turn=turn)
            body.shift(-sink * way, 0.05 * way)
        turn_hips(body, (-1.0 if side == LEFT else 1.0) * hips * way)
        respond(body, way, side, twist, 0.0)
        body.lean((1.0 if side == LEFT else -1.0) * 0.7 * aside * way, "up", _NECK)
        settle(body)
        bow = direction(aside, up)
        bow_hand.move(body, way, raised if nocks else np.ones(frames), np.clip(pulled, 0.0, 1.0), bow)
        string_hand.move(body, way, pulled[:, None], bow)

    kinds = ["draw-bow", "draw-bow-loose" if looses else "draw-bow-hold", "draw-bow-hand"]
    if shots > 1:
        kinds.append("draw-bow-twice")
    elif hold > 1.4:
        kinds.append("draw-bow-aim")
    seconds = end + fall + rng.uniform(0.2, 0.8)
    return Gesture(min(seconds, _LONGEST), tuple(kinds), change, side, shots)


def _pulls(
    rng: random.Random, first: float, shots: int, seconds: tuple[float, float, float], *, looses: bool
) -> tuple[list[float], list[float]]:
    """Times and how far the string is drawn at each: 0 at the bow, 1 at the cheek, more behind it after a release.

    Args:
        rng: draws how far the hand goes after each release.
        first: seconds at which the first shot is begun.
        shots: their number.
        seconds: of a draw, of its hold, and from one release to the next draw.
        looses: the string is released at last.
    """
    draw, hold, again = seconds
    at, drawn, goes = [0.0, first], [0.0, 0.0], first
    for shot in range(shots):
        at += [goes + draw, goes + draw + hold]
        drawn += [1.0, 1.0]
        if looses:
            at.append(at[-1] + 0.12)
            drawn.append(1.0 + rng.uniform(0.25, 0.45))
        if shot < shots - 1:
            goes = at[-1] + again
            at += [at[-1] + 0.2, goes]
            drawn += [drawn[-1], 0.0]
    return at, drawn


@dataclass(frozen=True)
class _BowHand:
    """The hand that holds the bow.

    Attributes:
        side: of the hand.
        low: metres from the middle of the shoulders to where the bow is carried, outward, up and forward.
    """

    side: str
    low: tuple[float, float, float]

    def move(self, body: StandingBody, way: Array, raised: Array, pull: Array, bow: Array) -> None:
        """Lift the bow; the arm straightens as the string is drawn.

        Args:
            body: turned to the target.
            way: (T,) share of the gesture.
            raised: (T,) share to which the bow is up.
            pull: (T,) share to which the string is drawn.
            bow: direction to the target.
        """
        middle = body.from_shoulder(self.side, body.joints[:, [16, 17]].mean(1))
        carried = np.tile(self.low, (len(way), 1)) + middle
        pull, w = pull[:, None], raised[:, None]
        bent = (1 - w) * carried + w * (0.8 + 0.17 * pull) * _ARM * bow
        upper, fore = (
            (1 - 0.8 * w * pull) * bone + 0.8 * w * pull * bow
            for bone in body.reach(self.side, bent, (0.3, -1.0, -0.4))
        )
        body.move_arm(self.side, way, upper, fore, 0.04)


@dataclass(frozen=True)
class _StringHand:
    """The hand that draws the string.

    Attributes:
        side: of the hand.
        cheek: metres from the head to where it is at full draw, aside, up and toward the target.
        high: height of the elbow's direction at full draw.
    """

    side: str
    cheek: tuple[float, float, float]
    high: float

    def move(self, body: StandingBody, way: Array, u: Array, bow: Array) -> None:
        """Move the hand from the string (`u` 0) to the cheek (1) and beyond.

        Args:
            body: whose other arm holds the bow already.
            way: (T,) share of the gesture.
            u: (T, 1) how far the string is drawn.
            bow: direction of the arm that holds the bow.
        """
        aim = np.array([-bow[0], bow[1], bow[2]])  # outward is the other way for this hand
        aside, up, ahead = self.cheek
        string = body.from_shoulder(self.side, body.joints[:, ARMS[OTHER_SIDE[self.side]][3]]) - 0.1 * aim
        beside = np.array([aim[2], 0.0, -aim[0]])
        string += 0.08 * beside
        face = body.from_shoulder(self.side, body.joints[:, _HEAD]) + aside * beside + [0.0, up, 0.0]
        pole = (1 - u) * (0.8 * beside - [0.0, 0.7, 0.0]) + u * [-0.9 * aim[0], self.high, -0.9 * aim[2]]
        bones = body.reach(self.side, (1 - u) * string + u * (face + ahead * aim), pole)
        body.move_arm(self.side, way, *bones, 0.04)
