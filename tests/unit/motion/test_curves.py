"""Changes that are made at single frames, and fade around them."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.curves import fades


@pytest.mark.parametrize("frames", [[12], [6, 30], [12, 20, 36]])
def test_changes_fade_alike_before_the_first_frame_and_after_the_last(frames: list[int]) -> None:
    count, values = 50, np.arange(1.0, len(frames) + 1)[:, None] * [1.0, -2.0]
    spans = np.linspace(5.0, 9.0, len(frames))
    there = fades(np.array(frames), values, spans, count)
    back = fades(count - 1 - np.array(frames[::-1]), values[::-1], spans[::-1], count)
    np.testing.assert_allclose(back[::-1], there, atol=1e-12)
    for frame, value, span in ((frames[0], values[0], -spans[0]), (frames[-1], values[-1], spans[-1])):
        half = there[round(frame + span / 2)] / value
        assert ((half > 0.2) & (half < 0.8)).all()
        assert not there[round(frame + span * 1.2)].any()
