"""Handstands: kicked up to from a lunge, held, walked on, and left the way they were entered."""

from __future__ import annotations

import math
import random
from dataclasses import replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.tumbling import FLOOR, OWN, Limb, Tumble, Whole, pair
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_RAISED = pair(Limb((0.2, 0.53, 0.06), towards=(0.5, 0.1, 1.0)))
_AHEAD = pair(Limb((0.24, -0.1, 0.44), towards=(0.6, -0.6, -0.2)))
_LOOKS = (-26, 0, 0)
"""Of the neck: a body on its hands looks at the floor between them."""
_APART, _WRIST = 0.2, 0.06
"""Metres of a hand beside the middle, and of its wrist over the floor."""
_ELBOWS = (0.6, 0.1, -1.0)
_HIP, _LEG = 0.09, 0.868
"""Metres of an ankle beside and below the pelvis of a straight leg."""
_LUNGE, _REACH = 0.52, 0.52
"""Metres of the front foot before the body, and of the hands before that foot."""
_STEP_M, _STEP_S = 0.17, 0.42
"""Metres of half a step of a hand, and seconds of a step."""
_SWAY_S = 0.9
_POINTED = 0.3
"""Share by which the toes of a leg in the air point to its front."""


def handstand(
    rng: random.Random, side: str = "", *, times: int | None = None, hold: float | None = None, steps: int = 0
) -> Gesture:
    """Handstands of a body that stands before them and behind them.

    Args:
        rng: decides everything that is not given.
        side: left or right, of the foot that steps ahead and leaves the floor last.
        times: how many, one after the other; None = one.
        hold: seconds on the hands; None = one or two.
        steps: of the hands, one after the other, ahead.
    """
    pace, lunges = rng.uniform(0.95, 1.1), side or rng.choice(SIDES)
    done, stands = Tumble(times=[rng.uniform(0.2, 0.5)]), 0.0
    for number in range(times or 1):
        lasts = hold if hold is not None else 0.3 if steps else rng.uniform(1.0, 1.8)
        done.then(0.5 * pace, Whole((0.0, stands), hands=_RAISED, feet=_feet(stands, stands)), 0.1 if number else 0.0)
        stands = _once(rng, done, stands, steps, lasts, pace)
    told = done if lunges == LEFT else done.mirrored()
    return replace(told.gesture(rng, ["handstand"], lunges), times=times or 1)


def _once(rng: random.Random, done: Tumble, stands: float, steps: int, hold: float, pace: float) -> float:
    """Add one handstand of a body that stands so many metres ahead, and return where it stands then."""
    front = stands + _LUNGE
    rising = Whole((0.0, stands + 0.16), 0.99, (4, 0, 0), hands=_RAISED, feet=_feet(stands + 0.5 * _LUNGE, stands, 0.1))
    done.then(0.22 * pace, rising)
    done.then(0.22 * pace, Whole((0.0, stands + 0.36), 0.93, (16, 0, 0), hands=_RAISED, feet=_feet(front, stands)))
    hands: dict[str, float] = dict.fromkeys(SIDES, front + _REACH)
    for seconds, whole in _up(front, hands):
        done.then(seconds * pace, whole)
    for number in range(steps):
        moved = SIDES[number % 2]
        far = _STEP_M if number in (0, steps - 1) else 2 * _STEP_M
        before, hands = hands, {**hands, moved: hands[moved] + far}
        done.then(0.5 * _STEP_S, _stepping(before, hands, moved))
        done.then(0.5 * _STEP_S, _over(hands, 176.0))
    sways, sway = max(round(hold / _SWAY_S), 1), rng.choice((-1.0, 1.0)) * rng.uniform(1.0, 2.0)
    for number in range(sways):
        done.then(hold / sways, _over(hands, 180.0 + sway * (-1) ** number))
    back = 0.5 * sum(hands.values()) - _REACH
    for seconds, whole in _down(back, hands):
        done.then(seconds * pace, whole)
    return back


def _feet(left: float, right: float, lifted: float = 0.0) -> dict[str, Limb]:
    """Feet so many metres ahead; the left one is lifted."""
    return {LEFT: Limb((0.0, lifted, left), OWN), RIGHT: Limb((0.0, 0.0, right), OWN)}


def _on_floor(hands: dict[str, float]) -> dict[str, Limb]:
    return {side: Limb((_APART, _WRIST, at), FLOOR, _ELBOWS) for side, at in hands.items()}


def _leg(ahead: float, length: float = _LEG) -> Limb:
    """A leg so many degrees ahead of the line of the trunk, its toes pointed; one that is shorter is bent."""
    down, front = math.cos(math.radians(ahead)), math.sin(math.radians(ahead))
    towards = (0.1, -down + _POINTED * front, front + _POINTED * down)
    return Limb((_HIP, -length * down, length * front), towards=towards)


def _over(hands: dict[str, float], tilt: float) -> Whole:
    """On the hands, upside down."""
    middle = 0.5 * sum(hands.values())
    return Whole((0.0, middle), 1.11, (tilt, 0, 0), (0, 0, 0), _LOOKS, _on_floor(hands), pair(_leg(0.0)), splay=0.0)


def _up(front: float, hands: dict[str, float]) -> list[tuple[float, Whole]]:
    """Seconds and poses from the lunge until the body is upside down."""
    middle = 0.5 * (front + sum(hands.values()) / 2)
    down = _tipped(front, hands, 92.0, -14.0)
    kicks = Whole((0.0, middle), 1.05, (132, 0, 0), (10, 0, 0), _LOOKS, _on_floor(hands), splay=0.05)
    kicks = replace(kicks, feet={LEFT: _leg(52.0, 0.78), RIGHT: _leg(-28.0)})
    joins = replace(_over(hands, 168.0), feet={LEFT: _leg(26.0, 0.82), RIGHT: _leg(-8.0)})
    return [(0.5, down), (0.3, kicks), (0.28, joins), (0.3, _over(hands, 180.0))]


def _tipped(foot: float, hands: dict[str, float], tilt: float, behind: float) -> Whole:
    """On the left foot and both hands, the other leg lifted behind."""
    whole = Whole((0.0, foot + 0.04), 0.92, (tilt, 0, 0), (22, 0, 0), (-16, 0, 0), _on_floor(hands), splay=0.1)
    return replace(whole, feet={LEFT: Limb((0.0, 0.0, foot), OWN), RIGHT: _leg(behind)})


def _down(back: float, hands: dict[str, float]) -> list[tuple[float, Whole]]:
    """Seconds and poses from the handstand until the body stands so many metres ahead."""
    middle = 0.5 * sum(hands.values())
    splits = replace(_over(hands, 166.0), feet={LEFT: _leg(40.0, 0.8), RIGHT: _leg(-10.0)})
    reaches = Whole((0.0, middle - 0.3), 1.06, (134, 0, 0), (12, 0, 0), _LOOKS, _on_floor(hands), splay=0.05)
    reaches = replace(reaches, feet={LEFT: _leg(96.0, 0.82), RIGHT: _leg(-16.0)})
    rises = Whole((0.0, back - 0.12), 0.9, (40, 0, 0), (22, 0, 0), (-10, 0, 0), _AHEAD, _feet(back, back - 0.34))
    steps = {LEFT: Limb((0.0, 0.0, back), OWN), RIGHT: Limb((0.0, 0.09, back - 0.2), OWN)}
    return [
        (0.36, splits),
        (0.3, reaches),
        (0.26, _tipped(back, hands, 104.0, -20.0)),
        (0.5, rises),
        (0.3, Whole((0.0, back - 0.06), 0.98, (8, 0, 0), feet=steps)),
        (0.3, Whole((0.0, back), feet=_feet(back, back))),
    ]


def _stepping(before: dict[str, float], hands: dict[str, float], moved: str) -> Whole:
    """Upside down on one hand, while the other one goes ahead."""
    middle = {side: 0.5 * (before[side] + hands[side]) for side in SIDES}
    held = {**_on_floor(middle), OTHER_SIDE[moved]: _on_floor(hands)[OTHER_SIDE[moved]]}
    held[moved] = Limb((_APART, _WRIST + 0.07, middle[moved]), FLOOR, _ELBOWS)
    return replace(_over(middle, 174.0), hands=held)
