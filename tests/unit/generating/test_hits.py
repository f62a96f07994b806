"""Blows that make a body go some steps."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.hits import states_hit
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263

LAYOUT = HUMANML3D_263


@pytest.mark.parametrize(
    ("prompt", "way"),
    [
        ("staggers back three steps as if hit in the chest", (0.0, -1.0)),
        ("recoils two steps from a punch", (0.0, -1.0)),
        ("is shoved and staggers a few steps to the left", (1.0, 0.0)),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_a_body_that_is_hit_goes_the_steps_that_are_stated(prompt: str, way: tuple[float, float], seed: int) -> None:
    assert states_hit(prompt)
    features = stated_features(LAYOUT, "flinch", FineWish(prompt=prompt), None, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    gone = joints[-1, 0] - joints[0, 0]
    assert gone[0] * way[0] + gone[2] * way[1] > 0.4


def test_a_blow_of_no_place_and_no_steps_is_drawn_as_a_gesture() -> None:
    assert not states_hit("gets hit")
    assert stated_features(LAYOUT, "flinch", FineWish(prompt="gets hit"), None, 1) is None
