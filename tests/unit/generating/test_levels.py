"""Heights at which the movements behind a climb are done."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.shots.levels import lifted, raised_rows
from marey.motion.features import HUMANML3D_263, encode_all
from tests.support.bodies import Body

LAYOUT = HUMANML3D_263
FEET = [7, 8, 10, 11]
STANDS = encode_all(LAYOUT, Body(2.0).joints())


def stairs(begins: float, ends: float) -> np.ndarray:
    """Features of a body that rises or sinks evenly."""
    return lifted(STANDS, begins + (ends - begins) * np.clip(np.linspace(-0.3, 1.3, len(STANDS)), 0.0, 1.0), LAYOUT)


def floors(*rows: tuple[str, str, np.ndarray]) -> list[tuple[float, float]]:
    """Height of the feet in the first and the last frame of each row."""
    found = []
    for each in raised_rows(rows, LAYOUT):
        lowest = LAYOUT.decode(each.features)[:, FEET, 1].min(axis=1)
        found.append((float(lowest[0]), float(lowest[-1])))
    return found


UP, WAVES = ("climb-stairs", "climbs the stairs", stairs(0.0, 0.8)), ("wave", "waves", STANDS)


def test_what_follows_a_climb_is_done_where_it_has_ended() -> None:
    climbs, waits, waves = floors(UP, ("idle", "stops at the top", STANDS), WAVES)
    assert climbs == pytest.approx((0.0, 0.8), abs=0.05)
    assert waits == pytest.approx((0.8, 0.8), abs=0.05)
    assert waves == waits
    assert [each.base for each in raised_rows([UP, WAVES], LAYOUT)] == pytest.approx([0.0, 0.8], abs=0.05)


def test_climbs_add_up() -> None:
    assert floors(UP, UP, WAVES)[-1] == pytest.approx((1.6, 1.6), abs=0.1)


@pytest.mark.parametrize(
    ("action", "said"), [("jump", "jumps down"), ("walk", "steps off the box"), ("die", "falls off"), ("", "descends")]
)
def test_who_comes_down_is_on_the_floor_again(action: str, said: str) -> None:
    down, waves = floors(UP, (action, said, STANDS), WAVES)[1:]
    assert down == waves == pytest.approx((0.0, 0.0), abs=0.05)


def test_the_way_down_begins_where_the_way_up_has_ended() -> None:
    down = floors(UP, ("climb-stairs", "walks back down", stairs(0.6, 0.0)), WAVES)[1]
    assert down == pytest.approx((0.8, 0.0), abs=0.05)


@pytest.mark.parametrize("said", ["sits down", "looks down", "kneels down", "puts the box down", "walks off"])
def test_who_stays_up_is_not_let_down(said: str) -> None:
    assert floors(UP, ("", said, STANDS))[1] == pytest.approx((0.8, 0.8), abs=0.05)


def test_rows_on_the_floor_stay_as_they_are() -> None:
    rows = raised_rows([WAVES, ("climb-stairs", "walks up to the stairs", STANDS), WAVES], LAYOUT)
    assert all(np.array_equal(each.features, STANDS) for each in rows)


@pytest.mark.parametrize(
    "said", ["vaults over a fence", "clambers over the wall", "gets across a barrier", "hurdles it"]
)
def test_who_passes_over_something_is_on_the_floor_behind_it(said: str) -> None:
    over = ("climb-onto", said, stairs(0.0, 0.8))
    assert floors(over, WAVES)[1] == pytest.approx((0.0, 0.0), abs=0.05)
    onto = ("climb-onto", "climbs onto a box", stairs(0.0, 0.8))
    assert floors(onto, WAVES)[1] == pytest.approx((0.8, 0.8), abs=0.05)
