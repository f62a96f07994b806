"""Bodies that hang by both hands from a bar or a ledge."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, near
from marey.motion.rotations import from_rotvec, rotate
from marey.motion.skeleton import HUMANML3D
from marey.posing.bones import two_bones
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEFT, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased

Array = NDArray[np.floating]

_DRAWN = {"hang-still": 4, "hang-swing": 5, "hang-side": 3, "hang-kick": 3, "hang-pull": 3, "hang-raise": 2}
FORMS_ALONG = frozenset({"hang-shimmy", "hang-ahead"})
"""Kinds of hanging that are drawn at random, with their weights, and those that go along, hand over hand."""
_SWINGS = {"hang-swing": (10.0, 30.0), "hang-side": (5.0, 10.0)}
"""Degrees to each side, where nothing is said of them."""
_COUNTED = frozenset({"hang-pull", "hang-raise"})
_ROOM = {"hang-pull": 1.4, "hang-raise": 1.2}
"""Seconds before the end after which no other movement begins."""
_WRISTS = [20, 21]
_SHOULDERS, _HALF, _ARM = 0.495, 0.168, 0.516
"""Metres from the hips up to the shoulders with lifted collars, from the middle out to them, and of a straight arm."""
_HEIGHTS = 2.62, 2.9
"""Metres of a bar or ledge over the floor: no toe comes below half a metre, which tells a body in the air from one that
stands."""
_BEHIND = 0.04
"""Metres of the hips behind the bar."""
_ELBOW: Point = (1.0, 0.0, 0.35)
_SHRUG = 16.0
"""Degrees by which the collars are lifted."""
_LEGS = {
    "straight": ((0.09, -0.82, -0.03), (0.05, -0.85, 0.5), (0.1, 0.0, 1.0)),
    "bent": ((0.09, -0.6, -0.34), (0.0, -0.75, -0.65), (0.1, -0.4, 1.0)),
    "tucked": ((0.09, -0.42, 0.2), (0.0, -0.6, 0.8), (0.1, 0.3, 1.0)),
    "ledge": ((0.12, -0.68, 0.16), (0.1, -0.45, 0.9), (0.5, 0.2, 1.0)),
}
"""A foot below the hips, outward, up and forward, where its toes point and where its knee points."""


def _hanging(rng: random.Random, bar: Point, down: float, legs: str, kick: Point = (0.0, 0.0, 0.0)) -> Posture:
    """A body whose hips are `down` metres below the bar; `kick`: metres by which the left foot is moved, and the right
    one the other way."""
    out, up, ahead = bar
    at, toes, knee = _LEGS[legs]
    high = up - down
    feet = {}
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        moved = np.array(at) + sign * np.array(kick) + np.array([0.0, high, ahead - _BEHIND])
        feet[side] = FootPlace(near(rng, (moved[0], moved[1], moved[2]), 0.008), toes)
    hand = HandPlace((out, up, ahead), "floor", _ELBOW)
    posture = Posture((0.0, high, ahead - _BEHIND), (0, 0, 0), (2, 0, 0), (-6, 0, 0), 0.0, dict.fromkeys(SIDES, hand))
    return replace(posture, feet=feet, knees=dict.fromkeys(SIDES, knee))


@dataclass(frozen=True)
class HangForm:
    """How a body hangs; what is left out is drawn at random.

    Attributes:
        form: a key of `_DRAWN`, one of `FORMS_ALONG`, or `hang-one`: one hand lets go.
        ledge: off a ledge, not from a bar.
        swing: degrees by which it swings to each side, at least and at most.
        count: pulls, raises of the legs, or grips along the bar.
        side: to which it goes along, or of the hand that stays.
        seconds: for about how long.
    """

    form: str = ""
    ledge: bool | None = None
    swing: tuple[float, float] | None = None
    count: int | None = None
    side: str = ""
    seconds: float | None = None


def hang(rng: random.Random, hold: HangForm | None = None) -> Gesture:
    """A body that hangs from the first frame to the last; both hands stay at their places unless it goes along."""
    hold = hold or HangForm()
    form = hold.form or rng.choices(list(_DRAWN), list(_DRAWN.values()))[0]
    ledge = hold.ledge
    if ledge is None:
        ledge = form in ("hang-still", "hang-kick", "hang-pull") and rng.random() < 0.35
    legs = "ledge" if ledge else _legs(rng, form)
    lasts = rng.uniform(2.2, 7.5) if hold.seconds is None else hold.seconds
    bar: Point = (rng.uniform(0.18, 0.32), rng.uniform(*_HEIGHTS), rng.uniform(0.02, 0.1))
    side = hold.side or rng.choice(SIDES)
    if form in FORMS_ALONG:
        way = _Traverse(rng, form, bar, legs, side)
        return way.gesture(rng, hold.count, lasts)
    reach = _SHOULDERS + math.sqrt(_ARM**2 - (bar[0] - _HALF) ** 2 - _BEHIND**2)
    degrees = rng.uniform(*(hold.swing or _SWINGS.get(form, (0.5, 2.0))))
    if form == "hang-side":  # the shoulders roll, one of them down
        reach -= _HALF * math.sin(math.radians(degrees))
    done = Sequel([rng.uniform(0.1, 0.5)], [_hanging(rng, bar, reach, legs)])
    if form == "hang-one":
        _let_go(rng, done, bar, legs, side, lasts)
    else:
        _moves(rng, done, form, (bar, reach, legs), (hold.count, lasts))
    change = _swinging(rng, done, "forward" if form == "hang-side" else "left", degrees)
    told = ["hang", form, "hang-ledge" if ledge else "", "hang-bar" if not ledge else ""]
    untrue = ["rope", "bar" if ledge else "ledge", *(["swing"] if form != "hang-swing" else [])]
    untrue += ["pull"] if form != "hang-pull" else []
    length = done.times[-1] + rng.uniform(0.2, 0.5)
    return Gesture(length, tuple(filter(None, told)), change, untrue="|".join(untrue))


def _moves(
    rng: random.Random, done: Sequel, form: str, held: tuple[Point, float, str], wanted: tuple[int | None, float]
) -> None:
    """Add movements: as many as are wanted, or for so many seconds; one at least."""
    count, lasts = wanted
    number = 0
    while number < count if count and form in _COUNTED else not number or done.times[-1] < lasts - _ROOM.get(form, 0.4):
        _move(rng, done, form, *held)
        number += 1


def _swinging(rng: random.Random, done: Sequel, axis: str, swing: float) -> Callable[[StandingBody], None]:
    """Return the change of a body that passes through postures, and swings by `swing` degrees; see `_swing`."""
    rate, phase = rng.uniform(0.38, 0.5), rng.uniform(0, 6.3)
    whip = rng.uniform(0.2, 0.5)

    def change(body: StandingBody) -> None:
        body.shrug(np.full(len(body.joints), _SHRUG))
        pose(body, done.times, done.postures)
        t = np.arange(len(body.joints)) / FPS
        grown = 0.75 + 0.25 * eased(t / 2.0)
        angle = swing * grown * np.sin(2 * np.pi * rate * t + phase)
        legs_behind = swing * whip * grown * np.sin(2 * np.pi * rate * t + phase - 0.9)
        hands = body.joints[:, _WRISTS].copy()
        _swing(body, axis, angle, legs_behind)
        if axis == "forward":
            _hold_on(body, hands)

    return change


def _let_go(rng: random.Random, done: Sequel, bar: Point, legs: str, side: str, lasts: float) -> None:
    """Add the moment in which one hand lets go, and the other one, of `side`, carries the body."""
    sign, roll = SIGN[side], rng.uniform(5.0, 10.0)
    out, up, ahead = bar
    down = _SHOULDERS + _ARM - 0.01 + _HALF * math.sin(math.radians(roll))
    both = _hanging(rng, bar, down, legs)
    hangs = replace(
        both,
        pelvis=(sign * (out - _HALF), up - down, ahead - 0.01),
        tilt=(0.0, sign * roll, 0.0),
        neck=(-4.0, -0.5 * sign * roll, 0.0),
        hands={side: both.hands[side]},
    )
    feet = dict[str, FootPlace]()
    for each, foot in both.feet.items():
        feet[each] = replace(foot, at=_shifted(foot.at, SIGN[each] * sign * (out - _HALF)))
    done.then(max(1.2, 0.45 * lasts), done.postures[-1])
    done.then(rng.uniform(0.6, 0.9), replace(hangs, feet=feet), max(0.6, lasts - done.times[-1] - 1.0))


def _shifted(at: Point, out: float, ahead: float = 0.0) -> Point:
    return (at[0] + out, at[1], at[2] + ahead)


class _Traverse:
    """A body that goes along hand over hand: to a side of a ledge, or ahead from bar to bar.

    Attributes:
        where: metres of the body along its way.
        far: of each hand, by side.
    """

    def __init__(self, rng: random.Random, form: str, bar: Point, legs: str, side: str) -> None:
        self.form, self.bar, self.legs, self.side = form, bar, legs, side
        self.aside = form == "hang-shimmy"
        self.step = rng.uniform(0.2, 0.28) if self.aside else rng.uniform(0.32, 0.4)
        self.down = _SHOULDERS - 0.01
        self.down += math.sqrt(_ARM**2 - (0.5 * self.step + 0.06) ** 2 - (bar[0] - _HALF) ** 2)
        self.where, self.far = 0.0, dict[str, float](left=0.0, right=0.0)
        self.still = _hanging(rng, bar, self.down, legs)

    def at(self, lean: float) -> Posture:
        """Return the body where it is now, leaning by degrees to its left."""
        sign, (_, up, ahead) = SIGN[self.side], self.bar
        out, on = (sign * self.where, 0.0) if self.aside else (0.0, self.where)
        hands, feet = dict[str, HandPlace](), dict[str, FootPlace]()
        for side in SIDES:
            hand, foot, far = self.still.hands[side], self.still.feet[side], self.far[side]
            moved = (SIGN[side] * sign * far, 0.0) if self.aside else (0.0, far)
            hands[side] = replace(hand, at=_shifted(hand.at, *moved))
            feet[side] = replace(foot, at=_shifted(foot.at, SIGN[side] * (out + 0.012 * lean), on))
        pelvis = (out + 0.006 * lean, up - self.down, ahead - _BEHIND + on)
        neck = (-8.0, 0.0, 12.0 * sign if self.aside else 0.0)
        return replace(self.still, pelvis=pelvis, tilt=(0.0, -lean, 0.0), neck=neck, hands=hands, feet=feet)

    def gesture(self, rng: random.Random, count: int | None, lasts: float) -> Gesture:
        """Return the movement over so many grips, or seconds."""
        done = Sequel([rng.uniform(1.15, 1.4)], [self.at(0.0)])
        pace, rest, roll = rng.uniform(0.42, 0.6), rng.uniform(0.06, 0.2), rng.uniform(2.0, 5.0)
        grips, moves = 0, self.side
        while grips < count if count else done.times[-1] + pace + rest < lasts or grips < 2:
            short = self.aside or grips == 0
            self.far[moves] += self.step if short else 2 * self.step
            self.where += 0.5 * self.step if short else self.step
            moves, grips = OTHER_SIDE[moves], grips + 1
            done.then(pace, self.at(SIGN[moves] * roll), rest)
        kinds = ("hang", self.form, "hang-ledge" if self.legs == "ledge" else "hang-bar")
        return Gesture(done.times[-1] + rng.uniform(0.3, 0.6), kinds, _swinging(rng, done, "left", 0.0))


def _legs(rng: random.Random, form: str) -> str:
    """Draw how the legs hang from a bar, a key of `_LEGS`."""
    legs = rng.choices(["straight", "bent", "tucked"], (6, 3, 0 if form == "hang-raise" else 1))[0]
    if form == "hang-swing":
        return rng.choice(["straight", "straight", "bent"])
    return "straight" if form == "hang-raise" else legs


def _move(rng: random.Random, done: Sequel, form: str, bar: Point, reach: float, legs: str) -> None:
    """Add one pull, raise of the legs, kick or look to a sequence of a body that hangs.

    Args:
        reach: metres from the bar to the hips while it only hangs.
    """
    if form == "hang-pull":
        neck = (-14.0, 0.0, 0.0)
        top = _hanging(rng, bar, rng.uniform(0.6, 0.68), legs)
        done.then(rng.uniform(0.6, 1.1), replace(top, neck=neck, spine=(-4, 0, 0)), rng.uniform(0.05, 0.4))
        done.then(rng.uniform(0.7, 1.2), _hanging(rng, bar, reach, legs), rng.uniform(0.2, 0.8))
    elif form == "hang-raise":
        done.then(rng.uniform(0.6, 1.0), _hanging(rng, bar, reach, "tucked"), rng.uniform(0.1, 0.4))
        done.then(rng.uniform(0.6, 1.0), _hanging(rng, bar, reach, legs), rng.uniform(0.2, 0.6))
    elif form == "hang-kick":
        far = rng.uniform(0.08, 0.2)
        for sign in (1.0, -1.0):
            kick = (0.0, 0.25 * far if legs == "ledge" else 0.0, sign * far)
            done.then(rng.uniform(0.28, 0.45), _hanging(rng, bar, reach, legs, kick))
    else:
        moved = _hanging(rng, bar, reach + rng.uniform(-0.012, 0.0), legs)
        look = rng.uniform(-35, 35) if rng.random() < 0.4 else 0.0
        done.then(rng.uniform(0.8, 1.4), replace(moved, neck=(rng.uniform(-14, 8), 0, look)), rng.uniform(0.1, 0.6))


def _swing(body: StandingBody, axis: str, degrees: Array, legs: Array) -> None:
    """Turn a body about the bar by degrees (T,), and the legs about the hips by `legs` (T,) more.

    Args:
        body: it hangs.
        axis: `left`: to and fro; `forward`: from side to side.
        degrees, legs: positive to the back, or to the body's right.
    """
    frames = len(body.joints)
    unit = [1.0, 0.0, 0.0] if axis == "left" else [0.0, 0.0, 1.0]
    along = body.world(np.tile(unit, (frames, 1)), LEFT)
    lower = [4, 5, 7, 8, 10, 11]
    for joints, pivot, angle in (
        (lower, body.joints[:, :1], legs),
        (list(range(22)), body.joints[:, _WRISTS].mean(1, keepdims=True).mean(0, keepdims=True), degrees),
    ):
        turned = from_rotvec(along * np.radians(angle)[:, None])[:, None]
        body.joints[:, joints] = pivot + rotate(turned, body.joints[:, joints] - pivot)


def _hold_on(body: StandingBody, hands: Array) -> None:
    """Put both wrists back to where they were, (T, 2, 3), and solve the arms."""
    frames = len(body.joints)
    for (side, (_, shoulder, elbow, wrist)), place in zip(ARMS.items(), np.moveaxis(hands, 1, 0), strict=True):
        pole = body.world(np.tile(_ELBOW, (frames, 1)), side)
        upper, lower = (float(np.linalg.norm(HUMANML3D.offsets[joint])) for joint in (elbow, wrist))
        body.joints[:, elbow], body.joints[:, wrist] = two_bones(body.joints[:, shoulder], place, pole, (upper, lower))
