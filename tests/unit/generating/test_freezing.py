"""Bodies that stop in the middle of a way and stay in its posture."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.shots.freezing import freezes, frozen
from marey.motion.features import HUMANML3D_263, encode_all
from tests.support.bodies import walker

LAYOUT = HUMANML3D_263


@pytest.mark.parametrize(
    ("before", "said"),
    [
        ("sneak", "stops"),
        ("sneak", "stops dead and looks around"),
        ("sneak", "waits"),
        ("walk", "freezes"),
        ("walk", "stops dead"),
        ("walk", "stops in his tracks"),
        ("walk", "stands completely still like a statue"),
    ],
)
def test_who_freezes_keeps_its_posture(before: str, said: str) -> None:
    assert freezes(before, "idle", said)


@pytest.mark.parametrize(
    ("before", "action", "said"),
    [("walk", "idle", "stops"), ("walk", "idle", "waits"), ("run", "idle", "freezes"), ("sneak", "wave", "waves")],
)
def test_who_only_stops_stands(before: str, action: str, said: str) -> None:
    assert not freezes(before, action, said)


def test_a_body_comes_to_rest_and_stays() -> None:
    held = frozen(encode_all(LAYOUT, walker(4.0)), 40, LAYOUT)
    assert held is not None
    assert len(held.after) == 40
    joints = LAYOUT.decode(np.concatenate([held.before, held.after])).astype(np.float64)
    speeds = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(-1) * 20
    begin = len(held.before)
    assert speeds[begin + held.entered + 2 :].max() < 0.1
    assert np.abs(np.diff(speeds[begin - 3 : begin + held.entered])).max() < 1.5


def test_a_way_that_is_too_short_is_not_held() -> None:
    assert frozen(encode_all(LAYOUT, walker(1.0)), 40, LAYOUT) is None
