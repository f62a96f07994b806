"""Curves through points, beside those of SciPy, which is no part of the product."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.ndimage import gaussian_filter1d

from marey.posing.curves import blurred, closed, monotone, turning_evenly

STEPS = st.lists(st.floats(0.01, 3.0), min_size=1, max_size=8)


@given(STEPS, st.data())
def test_a_path_is_that_of_scipy(steps: list[float], data: st.DataObject) -> None:
    times = np.concatenate([[0.3], 0.3 + np.cumsum(steps)])
    points = data.draw(arrays(np.float64, (len(times), 2), elements=st.floats(-5, 5).map(lambda x: round(x, 3))))
    at = np.linspace(times[0] - 0.5, times[-1] + 0.5, 57)
    expected = PchipInterpolator(times, points)(np.clip(at, times[0], times[-1]))
    np.testing.assert_allclose(monotone(times, points, at), expected, atol=1e-9)


def test_a_path_passes_its_points_and_goes_no_farther() -> None:
    times, points = [0.0, 0.4, 1.0, 1.2], np.array([[0.0], [1.0], [1.0], [-2.0]])
    path = monotone(times, points, np.linspace(-1, 2, 301))
    assert path.max() == pytest.approx(1.0)
    assert path.min() == pytest.approx(-2.0)
    np.testing.assert_allclose(monotone(times, points, np.array(times)), points, atol=1e-12)


@pytest.mark.parametrize("shape", [(30,), (30, 3), (30, 4, 2)])
def test_a_blurred_curve_is_that_of_scipy(shape: tuple[int, ...]) -> None:
    values = np.random.default_rng(0).normal(size=shape)
    expected = gaussian_filter1d(values, 1.1, axis=0, mode="nearest")
    np.testing.assert_allclose(blurred(values, 1.1), expected, atol=1e-12)


@given(arrays(np.float64, (6, 3), elements=st.floats(-2, 2).map(lambda x: round(x, 3))))
def test_a_closed_path_is_that_of_scipy(points: np.ndarray) -> None:
    phase = np.linspace(-0.7, 2.3, 97)
    whole = np.concatenate([points, points[:1]])
    expected = CubicSpline(np.linspace(0, 1, 7), whole, bc_type="periodic")(phase % 1.0)
    np.testing.assert_allclose(closed(points, phase), expected, atol=1e-9)


def test_directions_turn_no_faster_than_allowed_and_end_as_they_did() -> None:
    angles = np.radians(np.concatenate([np.zeros(8), [20.0, 110.0], np.full(8, 130.0)]))
    ways = np.stack([np.sin(angles), np.zeros_like(angles), np.cos(angles)], axis=-1)
    most = np.radians(28.0)
    even = turning_evenly(ways, most)
    turns = np.arccos(np.clip((even[1:] * even[:-1]).sum(-1), -1.0, 1.0))
    assert turns.max() < most + 1e-3
    assert turns.sum() == pytest.approx(angles[-1], abs=1e-3)
    np.testing.assert_allclose(even[[0, -1]], ways[[0, -1]], atol=1e-6)
    np.testing.assert_allclose(even[[3, -3]], ways[[3, -3]], atol=0.02)
    assert turning_evenly(ways, np.pi) is ways
