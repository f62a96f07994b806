"""Vaults: a short run-up, hands on top of a wall, and the legs swing over it to one side. Drawn with the legs to the
right and mirrored for the left."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.leaps import running, running_step
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_RUN_UP = ((0.48, 0.42), (0.62, 0.34), (0.6, 0.32))
"""Metres and seconds of the steps of a run-up, the last ones of these; the last is that of the left foot."""
_BEFORE_M, _BEHIND_M = 0.42, 0.75
"""Metres before the wall of the foot that takes off, and behind it of the foot that lands first."""
_LIFTED: Point = (0.3, 0.5, 0.8)


@dataclass(frozen=True)
class _Vault:
    """A vault with the legs to the right.

    Attributes:
        steps: of the run-up, two or three.
        high: metres of the wrists on top of the wall.
        starts: seconds before the first step.
        pace: factor of the seconds of the vault.
    """

    steps: int
    high: float
    starts: float
    pace: float

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        at: dict[str, float] = dict.fromkeys(SIDES, 0.0)
        side = RIGHT if self.steps % 2 == 0 else LEFT
        for step in _RUN_UP[-self.steps :]:
            at = running_step(done, feet, at, side, step)
            side = LEFT if side == RIGHT else RIGHT
        wall = at[LEFT] + _BEFORE_M
        self._up(done, feet, wall)
        self._over(done, wall)
        self._lands(done, feet, wall + _BEHIND_M)
        return done

    def _hands(self, wall: float, *sides: str) -> dict[str, HandPlace]:
        """Hands on top of the wall; one that is not named balances at the side."""
        top = HandPlace((0.34, self.high, wall + 0.08), "floor", (0.8, -0.1, -0.6))
        free = HandPlace((0.36, 0.02, 0.22), "shoulder", (0.5, -0.7, -0.5))
        return {side: top if side in sides else free for side in SIDES}

    def _up(self, done: Sequel, feet: StandingFeet, wall: float) -> None:
        """Plant both hands over the left foot, and push off it."""
        stood, hands = wall - _BEFORE_M, self._hands(wall, *SIDES)
        swings = FootPlace((0.16, 0.34, stood - 0.2), (0.2, -0.8, 0.1))
        places = {LEFT: feet[LEFT].flat(stood), RIGHT: swings}
        planted = Posture((0.0, 0.86, stood - 0.04), (24, 0, 0), (12, 0, 0), (-20, 0, 0), hands=hands, feet=places)
        done.then(0.18 * self.pace, planted)
        places = {LEFT: feet[LEFT].tiptoe(60, stood), RIGHT: FootPlace((0.46, 0.72, stood + 0.06), (0.5, -0.5, 0.5))}
        off = replace(planted, pelvis=(-0.04, 0.98, stood + 0.1), tilt=(38, -10, 0), spine=(12, -6, 0))
        done.then(0.18 * self.pace, replace(off, neck=(-26, 0, 0), feet=places, knees={RIGHT: _LIFTED}))

    def _over(self, done: Sequel, wall: float) -> None:
        """Pass over the wall on the hands, the legs at the right side."""
        beside = {
            RIGHT: FootPlace((0.86, self.high + 0.1, wall - 0.06), (0.5, -0.2, 0.6)),
            LEFT: FootPlace((-0.5, self.high - 0.02, wall - 0.2), (-0.5, -0.3, 0.6)),
        }
        across = {
            RIGHT: FootPlace((0.6, self.high + 0.06, wall + 0.42), (0.3, -0.2, 0.9)),
            LEFT: FootPlace((-0.34, self.high + 0.02, wall + 0.46), (-0.2, -0.2, 0.9)),
        }
        down = {
            RIGHT: FootPlace((0.2, 0.5, wall + 0.72), (0.1, -0.5, 0.85)),
            LEFT: FootPlace((0.04, 0.62, wall + 0.66), (0.0, -0.4, 0.9)),
        }
        beside_hands, behind_them = (-0.26, 0.14, wall - 0.16), (-0.26, 0.12, wall + 0.08)
        self._passes(done, 0.19, beside_hands, ((38, -22, 0), (8, -6, 0), (-24, 8, 0)), beside, wall, LEFT)
        self._passes(done, 0.15, behind_them, ((16, -26, 0), (4, -10, 0), (-10, 8, 0)), across, wall, LEFT)
        self._passes(done, 0.15, (-0.1, 0.08, wall + 0.36), ((8, -10, 0), (8, 0, 0), (-6, 0, 0)), down, wall)

    def _passes(
        self,
        done: Sequel,
        seconds: float,
        hips: Point,
        trunk: tuple[Point, Point, Point],
        feet: dict[str, FootPlace],
        wall: float,
        *hands: str,
    ) -> None:
        """Add a posture over the wall: hips left, over the hands and ahead, angles of pelvis, spine and neck."""
        at = (hips[0], self.high + hips[1], hips[2])
        held = self._hands(wall, *hands)
        done.then(seconds * self.pace, Posture(at, *trunk, 0.0, held, feet, dict.fromkeys(SIDES, _LIFTED)))

    def _lands(self, done: Sequel, feet: StandingFeet, there: float) -> None:
        """Land on the right foot, then on the left one, sink, and step on until both stand."""
        far, hands = there + 0.42, self._hands(there)
        places = {RIGHT: feet[RIGHT].tiptoe(18, there), LEFT: FootPlace((0.1, 0.34, there + 0.14), (0.1, -0.5, 0.85))}
        lands = Posture((-0.03, 0.92, there - 0.14), (10, 0, 0), (8, 0, 0), hands=hands, feet=places)
        done.then(0.16 * self.pace, lands)
        places = {RIGHT: feet[RIGHT].flat(there), LEFT: feet[LEFT].flat(far, 0.06)}
        sinks = replace(lands, pelvis=(-0.02, 0.8, there + 0.08), tilt=(16, 0, 0), spine=(12, 0, 0))
        done.then(0.16 * self.pace, replace(sinks, neck=(-8, 0, 0), feet=places))
        places = {RIGHT: feet[RIGHT].tiptoe(40, there), LEFT: feet[LEFT].flat(far)}
        done.then(0.16 * self.pace, running(far - 0.16, places, RIGHT, 0.6))
        places = {LEFT: feet[LEFT].flat(far), RIGHT: feet[RIGHT].flat(far - 0.1, 0.09)}
        done.then(0.24, Posture((0.0, 0.92, far - 0.02), (3, 0, 0), feet=places))
        done.then(0.26, Posture((0.0, 0.94, far), feet={side: foot.flat(far) for side, foot in feet.items()}))


def vault(rng: random.Random, side: str = "", high: float = 0.0) -> Gesture:
    """A vault over a wall, about 2 m ahead after the run-up.

    Args:
        rng: decides everything that is not given.
        side: to which the legs swing.
        high: metres of the top of what is vaulted; 0 = by chance.
    """
    side, high = side or rng.choice(SIDES), high or rng.uniform(0.9, 0.98)
    way = _Vault(rng.choice((2, 3)), high + 0.04, rng.uniform(0.15, 0.35), rng.uniform(0.95, 1.1))
    return on_feet(way.sequel, ["climb-onto", "vault"], rng.uniform(0.3, 0.6), side=side, mirror=side == LEFT)
