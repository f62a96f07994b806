"""Features of a motion that is played faster or slower."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.features import HUMANML3D_263
from marey.motion.paced_features import pace_features
from tests.support.bodies import walker


@pytest.mark.parametrize("frames", [40, 79, 150])
def test_the_same_way_takes_another_time(frames: int) -> None:
    layout = HUMANML3D_263
    features = layout.encode(walker(4.0, turn=60.0))
    paced = pace_features(features, layout.slices, frames)
    assert paced.shape == (frames, layout.dim)
    before, after = layout.decode(features), layout.decode(paced)
    times = np.linspace(0, len(before) - 1, frames)
    expected = np.stack([np.interp(times, np.arange(len(before)), before[:, 0, axis]) for axis in range(3)], axis=-1)
    np.testing.assert_allclose(after[:, 0], expected, atol=0.1)
    np.testing.assert_allclose(after[-1, :, 1], before[-1, :, 1], atol=1e-4)
    moves = layout.slices["velocities"]
    assert np.abs(paced[:, moves]).mean() == pytest.approx(np.abs(features[:, moves]).mean() * 79 / frames, rel=0.1)
    assert set(np.unique(paced[:, layout.slices["contacts"]])) <= {0.0, 1.0}
