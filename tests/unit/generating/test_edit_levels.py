"""Heights of the new frames of an edit, and of the kept ones beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.generation.shots.edit_levels import levelled, stands_at
from marey.generation.shots.levels import FEET, lifted
from marey.motion.features import HUMANML3D_263, encode_all
from marey.text.features import TextFeatures
from tests.support.bodies import Body
from tests.support.prepared import text_features

LAYOUT = HUMANML3D_263
STANDS = encode_all(LAYOUT, Body(2.0).joints())
NONE = STANDS[:0]
NEAR = 0.05


def at(metres: float) -> np.ndarray:
    return lifted(STANDS, metres, LAYOUT)


def way(begins: float, ends: float) -> np.ndarray:
    """Features of a body that rises or sinks evenly."""
    return lifted(STANDS, begins + (ends - begins) * np.clip(np.linspace(-0.3, 1.3, len(STANDS)), 0.0, 1.0), LAYOUT)


def text(prompt: str) -> TextFeatures:
    return replace(text_features(1), prompt=prompt, rewritten=prompt)


def ends(features: np.ndarray) -> tuple[float, float]:
    """Height of the lowest foot in the first and the last frame."""
    lowest = LAYOUT.decode(features)[:, FEET, 1].min(axis=1)
    return float(lowest[0]), float(lowest[-1])


UP, DOWN, OVER, WAVES = map(
    text,
    ("a person climbs stairs", "a person climbs down the stairs", "a person climbs over a fence", "a person waves"),
)


def test_frames_behind_a_climb_go_on_where_it_ended() -> None:
    made = levelled(STANDS, way(0.0, 0.8), STANDS, UP, LAYOUT)
    assert ends(made.features) == pytest.approx((0.0, 0.8), abs=NEAR)
    assert (made.before, made.after) == pytest.approx((0.0, 0.8), abs=NEAR)
    assert made.floors == pytest.approx((0.0, 0.8), abs=NEAR)


def test_frames_before_a_way_down_are_raised_so_that_no_floor_is_below_0() -> None:
    made = levelled(STANDS, way(0.8, 0.0), STANDS, DOWN, LAYOUT)
    assert ends(made.features) == pytest.approx((0.8, 0.0), abs=NEAR)
    assert (made.before, made.after) == pytest.approx((0.8, 0.0), abs=NEAR)


def test_a_way_down_from_where_a_motion_stands_ends_on_the_floor() -> None:
    made = levelled(at(0.8), way(0.8, 0.0), at(0.8), DOWN, LAYOUT)
    assert (made.before, made.after) == pytest.approx((0.0, -0.8), abs=NEAR)


def test_who_climbs_over_something_goes_on_on_the_same_floor() -> None:
    made = levelled(STANDS, way(0.0, 0.8), STANDS, OVER, LAYOUT)
    assert (made.before, made.after) == (0.0, 0.0)
    assert made.floors == (0.0, 0.0)


def test_frames_that_stay_in_their_place_keep_their_height() -> None:
    made = levelled(STANDS, way(0.0, 0.8), STANDS, UP, LAYOUT, stay=True)
    assert (made.before, made.after) == (0.0, 0.0)


def test_new_frames_of_a_raised_motion_are_done_at_its_height() -> None:
    made = levelled(at(0.8), STANDS, at(0.8), WAVES, LAYOUT)
    assert ends(made.features) == pytest.approx((0.8, 0.8), abs=NEAR)
    assert (made.before, made.after) == pytest.approx((0.0, 0.0), abs=NEAR)
    assert ends(levelled(at(0.8), STANDS, NONE, WAVES, LAYOUT).features) == pytest.approx((0.8, 0.8), abs=NEAR)
    assert ends(levelled(NONE, STANDS, at(0.8), WAVES, LAYOUT).features) == pytest.approx((0.8, 0.8), abs=NEAR)


def test_a_climb_that_is_painted_over_takes_its_height_away() -> None:
    made = levelled(STANDS, STANDS, at(0.8), WAVES, LAYOUT)
    assert made.after == pytest.approx(-0.8, abs=NEAR)


def test_who_hangs_or_is_in_a_jump_does_not_stand_there() -> None:
    hanging = at(0.8)
    joints = LAYOUT.decode(hanging).copy()
    joints[:, [20, 21], 1] = joints[:, 15:16, 1] + 0.4
    assert stands_at(hanging, LAYOUT) == pytest.approx(0.8, abs=NEAR)
    assert stands_at(encode_all(LAYOUT, joints), LAYOUT) == 0.0
    jump = way(0.8, 0.0)
    assert stands_at(jump, LAYOUT) == 0.0
    assert stands_at(NONE, LAYOUT) == 0.0
