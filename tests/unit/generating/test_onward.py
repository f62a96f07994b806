"""Ways that go on where a network turns them back."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.onward import gone_on_with_strides, without_return
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import Body, walker

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps


def there_and_back(seconds: float) -> np.ndarray:
    """Return features (T, D) of a walk ahead, and back without a turn."""
    ahead = walker(seconds)
    return LAYOUT.encode(np.concatenate([ahead, ahead[::-1][1:]]))


@pytest.mark.parametrize("seconds", [3.0, 4.5])
def test_who_walks_backward_half_of_the_way_goes_on(seconds: float) -> None:
    features = there_and_back(seconds)
    onward = without_return(features, LAYOUT)
    assert onward is not None
    assert len(onward) == len(features)
    joints = LAYOUT.decode(onward).astype(np.float64)
    assert np.diff(joints[::10, 0, 2]).min() > 0.2, "it goes ahead all the time"
    assert skate(joints, find_contacts(joints, HUMANML3D, FPS), HUMANML3D, FPS) < 0.08
    steps = np.linalg.norm(np.diff(joints - joints[:, :1], axis=0), axis=-1).max(axis=1)
    assert steps.max() < 1.5 * np.linalg.norm(np.diff(walker(4.0) - walker(4.0)[:, :1], axis=0), axis=-1).max()


def test_other_ways_stay() -> None:
    assert without_return(LAYOUT.encode(walker(6.0)), LAYOUT) is None
    assert without_return(LAYOUT.encode(walker(6.0, turn=180.0)), LAYOUT) is None
    assert without_return(LAYOUT.encode(Body(4.0).joints()), LAYOUT) is None
    assert without_return(there_and_back(0.8), LAYOUT) is None, "too short to go on"


def test_strides_are_made_again() -> None:
    longer = gone_on_with_strides(LAYOUT.encode(walker(3.0)), LAYOUT, 160)
    assert longer is not None
    joints = LAYOUT.decode(longer)
    assert joints[-1, 0, 2] / joints[59, 0, 2] == pytest.approx(160 / 60, rel=0.12)
