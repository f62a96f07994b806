"""Slopes of the soak: what grows is told from what merely varies."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.trend import fit

SECONDS = np.arange(0, 900, 5.0)


def noise(scale: float) -> np.ndarray:
    return np.random.default_rng(7).normal(0, scale, len(SECONDS))


def test_noise_around_a_level_is_flat() -> None:
    trend = fit(SECONDS, 150 + noise(3))
    assert abs(trend.slope) < trend.interval
    assert trend.verdict("MB", negligible=2.0) == "flat"


def test_a_leak_under_the_noise_of_one_sample_is_found() -> None:
    trend = fit(SECONDS, 150 + noise(1) + SECONDS / 3600 * 40)
    assert trend.slope == pytest.approx(40, abs=trend.interval)
    assert trend.verdict("MB", negligible=2.0).startswith("grows by")


def test_what_grows_less_than_anybody_would_look_for_is_flat() -> None:
    assert fit(SECONDS, 150 + SECONDS / 3600).verdict("MB", negligible=2.0) == "flat"


def test_a_line_through_three_half_minutes_is_refused() -> None:
    with pytest.raises(ValueError, match="too few"):
        fit(SECONDS[:18], noise(1)[:18])
