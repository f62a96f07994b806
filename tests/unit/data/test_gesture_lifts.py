"""Made clips of hands that drink, reach over the head or circle around the shoulder."""

from __future__ import annotations

import numpy as np
import pytest

from marey.data import gestures
from marey.data.gestures import made_gestures
from marey.data.part import Part
from tests.support.bodies import FPS
from tests.unit.data.test_gestures import OTHER, SHOULDER, WRIST, few, height, idle, of

HEAD, HIPS = 15, 0
TOP = 0.2
"""Metres of the top of the head over the head joint."""


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {name: few(14)[name] for name in ("drink", "reach-up", "arm-circles")})
        return list(made_gestures([idle(), idle(2.0)]))


def hands(part: Part) -> tuple[str, ...]:
    return ("left", "right") if part.source.side == "both" else (part.source.side,)


def test_a_hand_stays_before_the_mouth_in_a_drink(made: list[Part]) -> None:
    drinks = of(made, "drink")
    assert {part.source.side for part in drinks} == {"left", "right", "both"}
    for part in drinks:
        for side in hands(part):
            seen = part.joints[:, WRIST[side]] - part.joints[:, HEAD]
            near = (np.linalg.norm(seen, axis=-1) < 0.25) & (seen[:, 2] > 0.0)
            assert near.sum() >= 0.5 * FPS
            assert not near[0]
            assert not near[-1]
        if part.source.side != "both":
            assert height(part, OTHER[part.source.side]).max() < -0.3


def test_a_hand_reaches_over_the_top_of_the_head_and_returns(made: list[Part]) -> None:
    for part in of(made, "reach-up"):
        for side in hands(part):
            over = part.joints[:, WRIST[side], 1] - part.joints[:, HEAD, 1] > TOP
            assert over.sum() >= 5
            assert not over[0]
            assert not over[-1]
    heels = [np.ptp(part.joints[:, [7, 8], 1], axis=0).max() for part in of(made, "reach-up")]
    assert max(heels) > 0.05


def test_straight_arms_circle_over_the_head_and_past_the_hips(made: list[Part]) -> None:
    for part in of(made, "arm-circles"):
        for side in hands(part):
            wrist, shoulder = part.joints[:, WRIST[side]], part.joints[:, SHOULDER[side]]
            over = wrist[:, 1] > part.joints[:, HEAD, 1] + 0.1
            assert over.any()
            assert (wrist[np.argmax(over) :, 1] < part.joints[:, HIPS, 1].min() + 0.1).any()
            arm = np.linalg.norm(wrist - shoulder, axis=-1)
            assert arm[over].min() > 0.48
            entered = int((over[1:] & ~over[:-1]).sum())
            assert entered >= 1
