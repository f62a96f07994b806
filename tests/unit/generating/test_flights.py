"""Bodies that come down: drifting floors, and flights that last too long for their height."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.flights import LONGER, UP_M, fallen, lowered, on_floor
from marey.motion.features import HUMANML3D_263
from marey.posing.limbs import GRAVITY
from tests.support.bodies import Body, walker
from tests.unit.generating.test_asked import ask, make

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps


def features(joints: np.ndarray) -> np.ndarray:
    return LAYOUT.encode(joints)


def lowest(made: np.ndarray) -> np.ndarray:
    """Return metres (T,) from the floor to the lower toe."""
    return LAYOUT.decode(made)[:, [10, 11], 1].min(1)


def jumper(height: float, air_s: float, *, before_s: float = 1.0, after_s: float = 1.0) -> np.ndarray:
    """Return joints of a body that stands, is in the air and stands."""
    frames = [round(seconds * FPS) for seconds in (before_s, air_s, after_s)]
    joints = Body(sum(frames) / FPS).joints()
    share = np.linspace(-1, 1, frames[1] + 2)[1:-1]
    joints[frames[0] : frames[0] + frames[1], :, 1] += height * (1 - share**2)[:, None]
    return joints


def seconds_up(made: np.ndarray) -> float:
    return float((lowest(made) > UP_M).sum() / FPS)


def test_a_flight_lasts_as_long_as_its_height_allows() -> None:
    hangs = features(jumper(0.3, 1.4))
    falls = fallen(hangs, LAYOUT)
    assert falls is not None
    allowed = 2 * np.sqrt(2 * (0.3 - UP_M) / GRAVITY)
    assert seconds_up(hangs) > 1.2
    assert 0.8 * allowed < seconds_up(falls) < LONGER * allowed + 0.15
    assert lowest(falls).max() == pytest.approx(0.3, abs=0.03)
    assert len(hangs) - len(falls) == pytest.approx((seconds_up(hangs) - seconds_up(falls)) * FPS, abs=3)


def test_a_flight_that_falls_stays() -> None:
    height = 0.3
    assert fallen(features(jumper(height, 2 * np.sqrt(2 * height / GRAVITY))), LAYOUT) is None
    assert fallen(features(walker()), LAYOUT) is None


def test_a_dance_that_hangs_in_the_air_stands_meanwhile_and_its_jumps_stay() -> None:
    hangs = jumper(0.15, 0.7)
    stands = lowered(features(hangs), LAYOUT)
    assert stands is not None
    assert len(stands) == len(features(hangs)), "the time of a dance is kept"
    assert seconds_up(stands) == 0.0
    assert lowest(stands).min() > -0.01
    assert lowered(features(jumper(0.3, 2 * np.sqrt(2 * 0.3 / GRAVITY))), LAYOUT) is None
    assert make(hangs, ask("a person dances")).changes["grounded"]


def test_a_motion_that_begins_in_the_air_begins_as_it_lands() -> None:
    falls = fallen(features(jumper(0.3, 0.5, before_s=0.0, after_s=2.0)), LAYOUT)
    assert falls is not None
    assert lowest(falls)[0] < UP_M + 0.02
    assert len(falls) == pytest.approx(2.0 * FPS, abs=3)


def test_a_body_that_hovers_comes_down_and_one_that_jumps_still_jumps() -> None:
    joints = jumper(0.35, 0.5)
    assert on_floor(features(joints), LAYOUT) is None
    joints[..., 1] += np.linspace(0.0, 0.2, len(joints))[:, None]
    grounded = on_floor(features(joints), LAYOUT)
    assert grounded is not None
    assert lowest(grounded)[[0, 10, -1]].max() < 0.05
    assert lowest(grounded).max() == pytest.approx(0.35, abs=0.08)


def test_jumps_and_ways_are_brought_down_and_others_are_left() -> None:
    made = make(jumper(0.3, 1.4), ask("a person jumps"))
    assert made.changes["flights"] > 0.5
    hovers = walker(5.0)
    hovers[..., 1] += 0.1 * np.sin(np.pi * np.linspace(0, 1, len(hovers)))[:, None]
    assert make(hovers, ask("a person walks")).changes["grounded"]
    climbs = make(hovers, ask("a person climbs stairs"))
    assert "grounded" not in getattr(climbs, "changes", {})
