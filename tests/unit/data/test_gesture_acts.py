"""Made clips of bows that are drawn, pushes, throws, laughs, guards and dribbles."""

from __future__ import annotations

import numpy as np
import pytest

from marey.checks.kinematics import heading
from marey.data import gestures
from marey.data.gestures import made_gestures
from marey.data.part import Part
from tests.support.bodies import FPS
from tests.unit.data.test_gestures import OTHER, SHOULDER, WRIST, few, height, idle, of, tilt

HEAD, NECK, HIPS = 15, 12, 0
ELBOW = {"left": 18, "right": 19}
ACTS = ("draw-bow", "push", "throw", "laugh", "fight-stance", "dribble", "signal")


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gestures, "KINDS", {name: few(14)[name] for name in ACTS})
        return list(made_gestures([idle(), idle(2.0), idle(content="walk", speed=1.2)]))


def forward(part: Part, joint: int) -> np.ndarray:
    """Metres of a joint before the hips, as the body faces in the first frame, (T,)."""
    angle = np.radians(heading(part.joints, FPS)[0])
    seen = part.joints[:, joint] - part.joints[:, HIPS]
    return seen[:, 0] * np.sin(angle) + seen[:, 2] * np.cos(angle)


def speed(points: np.ndarray) -> np.ndarray:
    """Metres per second of (T, 3)."""
    return np.linalg.norm(np.gradient(points, axis=0), axis=-1) * FPS


def swings(values: np.ndarray, least: float) -> int:
    """Number of rises and falls of a signal (T,) by `least` or more."""
    count, low, high, rising = 0, values[0], values[0], 0
    for value in values:
        low, high = min(low, value), max(high, value)
        if rising <= 0 and value - low >= least:
            count, rising, high = count + 1, 1, value
        elif rising >= 0 and high - value >= least:
            count, rising, low = count + 1, -1, value
        low, high = (value if rising > 0 else low), (value if rising < 0 else high)
    return count


def test_one_arm_holds_the_bow_out_while_the_other_hand_is_at_the_face(made: list[Part]) -> None:
    for part in of(made, "draw-bow"):
        side, draws = part.source.side, OTHER[part.source.side]
        arm = part.joints[:, WRIST[side]] - part.joints[:, SHOULDER[side]]
        stretched = (np.linalg.norm(arm, axis=-1) > 0.48) & (np.abs(arm[:, 1]) < 0.2)
        face = np.linalg.norm(part.joints[:, WRIST[draws]] - part.joints[:, HEAD], axis=-1) < 0.25
        apart = np.linalg.norm(part.joints[:, WRIST[draws]] - part.joints[:, WRIST[side]], axis=-1) > 0.45
        high = part.joints[:, ELBOW[draws], 1] > part.joints[:, SHOULDER[draws], 1] - 0.05
        assert (stretched & face & apart & high).sum() >= 0.3 * FPS


def test_both_hands_are_ahead_of_a_leaning_trunk_for_most_of_a_push(made: list[Part]) -> None:
    pushes = of(made, "push")
    for part in pushes:
        leans = (tilt(part) > 10) & (forward(part, NECK) > 0)
        ahead = np.minimum(forward(part, 20), forward(part, 21)) > 0.3
        assert (leans & ahead).mean() >= 0.6
    assert any(np.ptp(part.joints[:, HIPS, 2]) > 1.0 for part in pushes)
    assert any(np.ptp(part.joints[:, HIPS, 2]) < 0.4 for part in pushes)


def test_a_throw_is_quick_and_stops_ahead_of_the_body(made: list[Part]) -> None:
    for part in of(made, "throw"):
        side = part.source.side
        for one in ("left", "right") if side == "both" else (side,):
            fast = speed(part.joints[:, WRIST[one]])
            peak = int(np.argmax(fast))
            assert fast[peak] > (2.5 if "nder" in str(part.source.captions) else 3.0)
            assert forward(part, WRIST[one])[peak : peak + 10].max() > 0.3
            assert forward(part, WRIST[one])[max(peak - 16, 0) : peak].min() < 0.2
            assert fast[peak + 8] < 0.5 * fast[peak]


def test_a_laugh_rocks_the_trunk_and_shakes_the_shoulders(made: list[Part]) -> None:
    for part in of(made, "laugh"):
        trunk = part.joints[:, NECK] - part.joints[:, HIPS]
        bent = np.degrees(np.arctan2(forward(part, NECK), trunk[:, 1]))
        assert swings(bent, 10.0) >= 4
        raised = part.joints[:, [16, 17], 1].mean(1) - part.joints[:, 9, 1]
        assert swings(np.diff(raised, 2), 0.002) >= 4
        assert np.ptp(part.joints[:, [7, 8]], axis=0).max() < 0.02


def test_hands_and_feet_are_in_guard_and_no_hand_strikes(made: list[Part]) -> None:
    for part in of(made, "fight-stance"):
        feet = part.joints[:, [7, 8]]
        ahead = np.abs(forward(part, 7) - forward(part, 8)) > 0.15
        apart = np.linalg.norm((feet[:, 0] - feet[:, 1])[:, [0, 2]], axis=-1) > 0.25
        guarded = ahead & apart
        for side in ("left", "right"):
            up = part.joints[:, WRIST[side], 1]
            guarded &= (up > part.joints[:, HIPS, 1]) & (up < part.joints[:, HEAD, 1] + 0.1)
            guarded &= forward(part, WRIST[side]) > 0.1
            assert np.percentile(speed(part.joints[:, WRIST[side]]), 90) < 1.5
        assert guarded.mean() >= 0.6


def test_one_hand_makes_strokes_beside_the_hips_in_a_dribble(made: list[Part]) -> None:
    dribbles = of(made, "dribble")
    for part in dribbles:
        wrist = part.joints[:, WRIST[part.source.side], 1] - part.joints[:, HIPS, 1]
        assert swings(wrist, 0.1) >= 8
        knee, chest = part.joints[:, [4, 5], 1].mean(), part.joints[:, [16, 17], 1].mean()
        level = np.median(part.joints[:, WRIST[part.source.side], 1])
        assert knee < level < chest
        assert height(part, part.source.side).max() < 0.0
    assert any(np.ptp(part.joints[:, HIPS, 2]) > 1.0 for part in dribbles)


def test_arms_are_held_in_three_or_more_places_away_from_the_trunk(made: list[Part]) -> None:
    for part in of(made, "signal"):
        places = []
        for side in ("left", "right"):
            seen = part.joints[:, WRIST[side]] - part.joints[:, SHOULDER[side]]
            away = seen[:, 1] > -0.3
            assert speed(seen).max() < 9.0
            assert away.any() or side != part.source.side
            for frame in np.flatnonzero(away)[::3]:
                if all(np.linalg.norm(seen[frame] - place) > 0.25 for place in places):
                    places.append(seen[frame])
        assert len(places) >= 3
