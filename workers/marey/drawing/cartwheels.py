"""Cartwheels: sideways over the hands, one limb after another on the floor."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.tumbling import FLOOR, OWN, Limb, Tumble, Whole, pair
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN

_RAISED = pair(Limb((0.27, 0.5, 0.05), towards=(0.4, 0.2, -1.0)))
_OUT = pair(Limb((0.52, 0.1, 0.04), towards=(0.2, -0.4, -1.0)))
_FLAT = (0.0, 0.2, -1.0)
"""Where the elbow of a hand on the floor points."""
_HIP, _LEG = 0.08, 0.795
"""Metres of a hip below and beside the pelvis, and of a straight leg."""
_WRIST = 0.06
"""Metres of a wrist over the floor."""


@dataclass(frozen=True)
class _Wheel:
    """One cartwheel to the left, metres to the left of where the body stood.

    Attributes:
        behind, first: of the right and of the left foot before it.
        reach, wide: from the left foot to the left hand, and between the hands.
        split: share to which the legs are apart, 0 to 1.
        turned: degrees that the body has turned over before.
    """

    behind: float
    first: float
    reach: float
    wide: float
    split: float
    turned: float

    @property
    def hands(self) -> dict[str, float]:
        """Places of the hands."""
        return {LEFT: self.first + self.reach, RIGHT: self.first + self.reach + self.wide}

    @property
    def landing(self) -> float:
        """Place of the right foot, on which the body lands."""
        return self.hands[RIGHT] + self.reach

    def hand(self, side: str) -> Limb:
        """A hand on the floor."""
        return Limb((SIGN[side] * self.hands[side], _WRIST, 0.06), FLOOR, _FLAT)

    def lunge(self, share: float = 0.5) -> Whole:
        """On both feet, far apart, with the arms raised; `share` of the weight is on the left foot."""
        at = self.behind + share * (self.first - self.behind)
        feet = {LEFT: foot(LEFT, self.first), RIGHT: foot(RIGHT, self.behind)}
        return Whole((at, 0.0), 0.93, (0, -8 - self.turned, 0), hands=_RAISED, feet=feet, splay=0.2)

    def poses(self) -> list[tuple[float, Whole]]:
        """Seconds and poses from the lunge until the right foot stands."""
        middle = 0.5 * sum(self.hands.values())
        apart = math.radians(36 + 24 * self.split)
        leg = (_HIP + _LEG * math.sin(apart), -_HIP - _LEG * math.cos(apart), 0.0)
        legs = pair(Limb(leg, towards=(math.sin(apart), -math.cos(apart), 0.35)))
        over = Whole((middle, 0.02), 1.1, (0, -180 - self.turned, 0), (0, 0, 0), (-24, 0, 0), feet=legs)
        over = replace(over, hands={side: self.hand(side) for side in SIDES}, splay=0.0)
        down = self._tipped(over, 1.0)
        up = self._tipped(over, -1.0)
        return [
            (0.36, down),
            (0.16, replace(over, at=(middle - 0.3, 0.02), height=1.09, tilt=(0, -142 - self.turned, 0))),
            (0.14, over),
            (0.14, replace(over, at=(middle + 0.3, 0.02), height=1.09, tilt=(0, -218 - self.turned, 0))),
            (0.18, up),
        ]

    def _tipped(self, over: Whole, way: float) -> Whole:
        """On a foot and the hand next to it: the left ones on the way down, `way` 1, the right ones on the way up.

        The pelvis tips less than the chest: a hip spreads no farther than to a right angle."""
        side = LEFT if way > 0 else RIGHT
        stands = self.first if way > 0 else self.landing
        return replace(
            over,
            at=(stands + 0.1 * way, 0.0),
            height=0.91,
            tilt=(0, -180 + 98 * way - self.turned, 0),
            spine=(0, -34 * way, 0),
            neck=(-20, 0, 0),
            hands={**over.hands, OTHER_SIDE[side]: _RAISED[side]},
            feet={**over.feet, side: foot(side, stands)},
        )


def foot(side: str, at: float) -> Limb:
    """A foot that stands, `at` metres to the left of where the body stood."""
    return Limb((SIGN[side] * (at - SIGN[side] * 0.1), 0.0, 0.0), OWN)


_PACE, _QUICK = (1.1, 1.4), (0.85, 1.0)
"""Factors of the seconds above, also where there is little time."""
_LEISURE_S = (3.2, 1.8)
"""Seconds that a leisurely cartwheel takes, and those of each further one."""


def cartwheel(rng: random.Random, side: str = "", times: int | None = None, seconds: float | None = None) -> Gesture:
    """Cartwheels of a body that stands with its side to where it goes.

    Args:
        rng: decides everything that is not given.
        side: left or right, to which it goes.
        times: how many, one out of the other; None = one.
        seconds: that there are; None = as many as it takes.
    """
    times = times or 1
    first, more = _LEISURE_S
    hurried = seconds is not None and seconds < first + more * times
    pace, side = rng.uniform(*(_QUICK if hurried else _PACE)), side or rng.choice(SIDES)
    wheel = _Wheel(-0.1, rng.uniform(0.46, 0.58), rng.uniform(0.44, 0.5), rng.uniform(0.38, 0.44), rng.random(), 0.0)
    done = Tumble(times=[rng.uniform(0.2, 0.7)])
    done.then(0.45 * pace, Whole(tilt=(0, 0, 0), hands=_RAISED), rng.uniform(0.05, 0.2))
    lifted = {LEFT: Limb((0.6 * wheel.first, 0.12, 0.03), OWN)}
    done.then(0.24 * pace, Whole((0.06, 0.0), 0.99, (0, 2, 0), hands=_RAISED, feet=lifted))
    for _ in range(times):
        done.then(0.2 * pace, wheel.lunge())
        for seconds, whole in wheel.poses():
            done.then(seconds * pace, whole)
        last = wheel
        wheel = replace(
            wheel, behind=last.landing, first=last.landing + rng.uniform(0.46, 0.54), turned=last.turned + 360
        )
        swung = {LEFT: Limb((wheel.first - 0.08, 0.16, 0.03), OWN), RIGHT: foot(RIGHT, wheel.behind)}
        done.then(0.2 * pace, replace(wheel.lunge(0.2), tilt=(0, 24 - wheel.turned, 0), feet=swung))
    _stand(rng, done, wheel, pace)
    told = done if side == LEFT else done.mirrored()
    return replace(told.gesture(rng, ["cartwheel"], side), times=times)


def _stand(rng: random.Random, done: Tumble, wheel: _Wheel, pace: float) -> None:
    """Onto both feet, far apart, and the right one to the left one; the arms come down."""
    end = wheel.first - 0.1
    still = Whole((end, 0.0), tilt=(0, -wheel.turned, 0))
    still = replace(still, feet={LEFT: foot(LEFT, wheel.first), RIGHT: foot(RIGHT, end - 0.1)})
    done.then(0.18 * pace, replace(wheel.lunge(0.55), tilt=(0, 4 - wheel.turned, 0)))
    half = {**still.feet, RIGHT: Limb((-0.5 * (wheel.behind + end), 0.09, 0.0), OWN)}
    done.then(0.24 * pace, replace(still, at=(end + 0.04, 0.0), hands=_OUT, feet=half))
    done.then(0.24 * pace, replace(still, hands=pair(Limb((0.4, -0.24, 0.04), towards=(0.2, -0.4, -1.0)))))
    done.then(0.4 * pace, still, rng.uniform(0.2, 0.6))
