"""Gaits on the spot and short clips."""

from __future__ import annotations

import numpy as np
import pytest

from marey.data.lengthen import between_idles, closes, repeated, travelling
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import Body, raiser, steady, walker


def on_the_spot(joints):
    """The same gait with its pelvis over one place."""
    return joints - (joints[:, :1] - joints[:1, :1]) * [1.0, 0.0, 1.0]


def test_a_gait_on_the_spot_travels_as_its_feet_say() -> None:
    real = walker(4.0)
    made = travelling(on_the_spot(real))
    assert made is not None
    assert made[-1, 0, 2] - made[0, 0, 2] == pytest.approx(real[-1, 0, 2] - real[0, 0, 2], rel=0.1)
    assert skate(made, find_contacts(made, HUMANML3D, 20.0), HUMANML3D, 20.0) < 0.1


def test_legs_that_never_touch_the_floor_give_no_travel() -> None:
    assert travelling(on_the_spot(walker(3.0)) + np.array([0.0, 0.3, 0.0])) is None


@pytest.mark.parametrize("end", [41, 40], ids=["ends as it begins", "ends a frame before"])
def test_a_cycle_is_repeated_without_a_jump_and_goes_on(end: int) -> None:
    cycle = walker(20.0, cadence=2.0)[20:end]  # two steps of half a second
    assert closes(cycle)
    longer = repeated(cycle)
    assert len(longer) >= 50
    assert (
        np.linalg.norm(np.diff(longer, axis=0), axis=-1).max()
        < 1.1 * np.linalg.norm(np.diff(cycle, axis=0), axis=-1).max() + 0.02
    )
    np.testing.assert_allclose(np.diff(longer[:, 0, 2]).mean(), np.diff(cycle[:, 0, 2]).mean(), rtol=1e-6)


def test_a_short_action_stands_between_idles_unchanged() -> None:
    action = raiser("left", 1.2)
    idle = Body(4.0, speed=steady(0.0)).joints()
    made = between_idles(action, [idle], "raise")
    assert made is not None
    assert len(made) > len(action) + 20
    local = lambda j: j - j[:, :1] * [1.0, 0.0, 1.0]  # noqa: E731
    peak = int(made[:, 20, 1].argmax()) - int(action[:, 20, 1].argmax())
    assert np.abs(local(made)[peak + 4 : peak + 20] - local(action)[4:20]).max() < 0.01


def test_half_a_cycle_does_not_close() -> None:
    assert not closes(walker(20.0, cadence=2.0)[20:31])


def test_nothing_is_put_beside_a_pose_that_no_idle_has() -> None:
    lying = raiser("left", 1.2)[..., [0, 2, 1]] * [1.0, 1.0, -1.0]
    assert between_idles(lying, [Body(4.0, speed=steady(0.0)).joints()], "lie") is None
