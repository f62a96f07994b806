"""Made clips of punches, stabs, slashes and blocks."""

from __future__ import annotations

import numpy as np
import pytest

from marey.data import gestures
from marey.data.gestures import made_gestures
from marey.data.part import Part
from tests.support.bodies import FPS
from tests.unit.data.test_gesture_acts import ELBOW, forward, speed
from tests.unit.data.test_gestures import FIGHTS, SHOULDER, WRIST, few, idle, of

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {name: few(14)[name] for name in FIGHTS})
        return list(made_gestures([idle(), idle(2.0)]))


def acting(part: Part) -> tuple[str, ...]:
    return SIDES if part.source.side == "both" else (part.source.side,)


def extent(part: Part, side: str) -> np.ndarray:
    """Metres of a wrist from its shoulder, (T,)."""
    return np.linalg.norm(part.joints[:, WRIST[side]] - part.joints[:, SHOULDER[side]], axis=-1)


def folded(part: Part, side: str) -> np.ndarray:
    """Degrees by which an elbow is bent, (T,)."""
    upper = part.joints[:, ELBOW[side]] - part.joints[:, SHOULDER[side]]
    fore = part.joints[:, WRIST[side]] - part.joints[:, ELBOW[side]]
    cosine = (upper * fore).sum(1) / np.linalg.norm(upper, axis=1) / np.linalg.norm(fore, axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1)))


def test_a_fist_shoots_from_its_shoulder_or_past_the_face(made: list[Part]) -> None:
    for part in of(made, "punch"):
        hit = []
        for side in acting(part):
            away = np.gradient(extent(part, side)) * FPS
            straight = (away > 2.0).any() and extent(part, side).max() > 0.46
            ahead = forward(part, WRIST[side]) > 0.3
            level = np.abs(part.joints[:, WRIST[side], 1] - part.joints[:, 15, 1]) < 0.25
            round_about = (speed(part.joints[:, WRIST[side]]) > 2.0) & ahead & level
            hit.append(straight or round_about.any())
        assert all(hit)


def test_a_stab_goes_forward_in_a_line(made: list[Part]) -> None:
    for part in of(made, "stab"):
        for side in acting(part):
            ahead = forward(part, WRIST[side])
            quick = np.gradient(ahead) * FPS > 1.5
            first = int(np.argmax(quick))
            assert quick.any()
            if side == part.source.side:
                assert ahead[first : first + 8].max() - ahead[max(first - 3, 0)] > 0.25
            assert ahead.max() > 0.4


def test_a_blade_sweeps_through_a_wide_arc(made: list[Part]) -> None:
    for part in of(made, "slash"):
        arcs = [0.0]
        for side in acting(part):
            seen = part.joints[:, WRIST[side]] - part.joints[:, 0]
            fast = speed(seen) > 2.0
            edges = np.flatnonzero(np.diff(np.concatenate([[False], fast, [False]]).astype(int)))
            arcs += [np.linalg.norm(np.diff(seen[a:b], axis=0), axis=-1).sum() for a, b in edges.reshape(-1, 2)]
        assert max(arcs) > 0.6


def test_a_bent_forearm_comes_up_quickly_and_stays_in_a_block(made: list[Part]) -> None:
    for part in of(made, "block"):
        for side in acting(part):
            wrist = part.joints[:, WRIST[side], 1] - part.joints[:, SHOULDER[side], 1]
            up = (wrist > -0.2) & (forward(part, WRIST[side]) > 0.1) & (folded(part, side) > 35)
            assert up.sum() >= 0.3 * FPS
            rises = np.gradient(part.joints[:, WRIST[side], 1]) * FPS
            assert rises.max() > 0.8
            assert speed(part.joints[:, WRIST[side]]).max() < 8.0


def test_elbows_and_hands_stay_out_of_the_trunk(made: list[Part]) -> None:
    for part in made:
        low, high = part.joints[:, 0], part.joints[:, 12]
        for joint in (18, 19, 20, 21):
            share = ((part.joints[:, joint] - low) * (high - low)).sum(1) / ((high - low) ** 2).sum(1)
            nearest = low + np.clip(share, 0, 1)[:, None] * (high - low)
            assert np.linalg.norm(part.joints[:, joint] - nearest, axis=-1).min() > 0.08, part.id
