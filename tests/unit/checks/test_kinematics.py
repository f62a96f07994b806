from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.checks.kinematics import gait, hand, heading, lean, turning_points
from marey.checks.quality import quality
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from tests.support.bodies import FPS, Body, bower, raiser, runner, steady, walker, waver


@pytest.mark.parametrize("turn", [-150, -90, 0, 45, 90, 170])
def test_the_turn_is_measured_positive_to_the_left(turn):
    assert gait(walker(6.0, turn=turn), FPS).turn == pytest.approx(turn, abs=6)


@pytest.mark.parametrize("speed", [0.6, 1.1, -0.7])
def test_travel_is_measured_along_the_way_the_body_faces(speed):
    body = gait(Body(5.0, speed=steady(speed), turn=60).joints(), FPS)
    assert body.along == pytest.approx(5 * speed, rel=0.08)
    assert body.path == pytest.approx(5 * abs(speed), rel=0.08)
    assert abs(body.sideways) < 0.3


@pytest.mark.parametrize("cadence", [1.4, 1.8, 2.4])
def test_steps_are_counted(cadence):
    body = gait(walker(6.0, cadence=cadence), FPS)
    assert abs(body.steps - 6 * cadence) <= 2


def test_only_runners_leave_the_floor():
    assert gait(walker(), FPS).airborne < 0.02
    assert gait(runner(), FPS).airborne > 0.1


def test_hands_are_told_apart_and_waves_counted():
    left, right = (hand(waver("left"), FPS, side) for side in (0, 1))
    assert left.peak > 0.2 > -0.3 > right.peak
    assert left.swings >= 8
    assert hand(raiser("left"), FPS, 0).swings <= 3
    assert left.start < 1.0
    assert left.end > 3.0


def test_a_bow_leans_forward_and_a_walk_does_not():
    assert lean(bower(), FPS).max() == pytest.approx(45, abs=4)
    assert np.abs(lean(walker(), FPS)).max() < 3


def test_heading_has_no_jump_through_a_full_turn():
    angle = heading(walker(10.0, turn=540), FPS)
    assert angle[-1] - angle[0] == pytest.approx(540, abs=10)
    assert np.abs(np.diff(angle)).max() < 15


@given(st.lists(st.booleans(), max_size=40))
def test_runs_are_the_stretches_of_true(mask):
    mask = np.array(mask, bool)
    rebuilt = np.zeros_like(mask)
    found = runs(mask)
    for a, b in found:
        assert a < b
        rebuilt[a:b] = True
    np.testing.assert_array_equal(rebuilt, mask)
    assert all(b < c for (_, b), (c, _) in pairwise(found))


@pytest.mark.parametrize("periods", [1, 3, 7])
def test_a_sine_of_n_periods_has_two_n_half_swings_and_small_ones_do_not_count(periods):
    wave = np.sin(2 * np.pi * periods * np.linspace(0, 1, 400, endpoint=False))
    assert 2 * periods - 1 <= turning_points(0.05 * wave, 0.03) <= 2 * periods + 1
    assert turning_points(0.01 * wave, 0.03) == 0


def test_smoothing_keeps_a_constant_and_the_shape():
    values = np.full((30, 22, 3), 4.0)
    np.testing.assert_allclose(smooth_seconds(values, 0.3, FPS), values)


def test_smoothing_is_by_seconds_and_not_by_frames():
    slow, quick = (np.sin(np.linspace(0.0, 6.0, count)) for count in (121, 241))
    at_20, at_40 = smooth_seconds(slow, 0.2, 20.0), smooth_seconds(quick, 0.2, 40.0)
    np.testing.assert_allclose(at_40[::2], at_20, atol=0.01)
    assert np.abs(at_20 - slow).max() > 0.01
    np.testing.assert_array_equal(smooth_seconds(slow, 0.01, 20.0), slow)


def test_quality_measures_skate_bones_floor_and_jerk():
    good = quality(walker(cadence=3.2), FPS)
    assert good.bone_drift < 1e-6
    assert good.penetration < 1e-6
    sliding = walker(cadence=3.2)
    sliding[:, :, 2] += np.linspace(0, 6, len(sliding))[:, None]  # 1.5 m/s on top: standing feet slide
    assert quality(sliding, FPS).skate > 0.9 > good.skate
    sunk = walker() - [0.0, 0.1, 0.0]
    assert quality(sunk, FPS).penetration == pytest.approx(0.1, abs=1e-6)
    stretched = walker()
    stretched[::2, 20] *= 1.05
    assert quality(stretched, FPS).bone_drift > 10 * max(good.bone_drift, 1e-9)
    assert quality(stretched, FPS).jerk > quality(walker(), FPS).jerk
