"""Runs, sprints, walks backward and turns that are made of straight gaits: speed, direction, and feet that stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.checks.kinematics import heading
from marey.data import gestures
from marey.data.describe import describe_text
from marey.data.gesture_ways import Bending, relaid
from marey.data.gestures import KINDS, made_gestures
from marey.data.pack import PackClip
from marey.data.part import Part
from tests.support.bodies import FPS, Body, steady

KINDS_OF_TRAVEL = ("walk-backward", "run", "sprint", "turn", "walk", "leap", "sneak")
COUNT = 9
STANDS = 0.02  # metres over the lowest toe


def gait(content: str, speed: float, duty: float, cadence: float) -> Part:
    joints = Body(5.0, speed=steady(speed), duty=duty, cadence=cadence).joints().astype(np.float32)
    said = ((content,),)
    source = PackClip(content, "cmu", content, "", "train", 0, 0, source=content, captions=said)
    return Part(content, source, content, False, joints, describe_text(said, joints, FPS))


@pytest.fixture(scope="module")
def made() -> list[Part]:
    with pytest.MonkeyPatch.context() as patch:
        kinds = {action: replace(KINDS[action], count=COUNT) for action in KINDS_OF_TRAVEL}
        patch.setattr(gestures, "KINDS", kinds)
        return list(made_gestures([gait("walk", 1.1, 0.62, 1.8), gait("run", 3.2, 0.3, 2.8)]))


def of(made: list[Part], action: str) -> list[Part]:
    found = [part for part in made if part.content == action]
    assert len(found) == COUNT
    return found


def ahead(part: Part) -> np.ndarray:
    """Metres a second (T - 1,) in the direction that the body faces."""
    moved = np.diff(part.joints[:, 0].astype(np.float64), axis=0) * FPS
    angle = np.radians(heading(part.joints.astype(np.float64), FPS))[:-1]
    return moved[:, 0] * np.sin(angle) + moved[:, 2] * np.cos(angle)


def turned(part: Part) -> float:
    """Degrees to the left."""
    angle = heading(part.joints.astype(np.float64), FPS)
    return float(angle[-1] - angle[0])


def slips(joints: np.ndarray) -> float:
    """Metres a second of low toes over the floor, their median."""
    toes = joints[:, [10, 11]].astype(np.float64)
    low = toes[..., 1] < toes[..., 1].min() + STANDS
    return float(np.median(np.linalg.norm(np.gradient(toes, axis=0)[..., [0, 2]], axis=-1)[low]) * FPS)


def captions_of(part: Part) -> str:
    return " ".join(text for author in part.source.captions[:3] for text in author).lower()


def test_walks_backward_face_away_from_their_way(made: list[Part]) -> None:
    for part in of(made, "walk-backward"):
        assert ahead(part).max() < 0.05
        assert -2.7 < ahead(part).mean() < -0.38
        assert np.linalg.norm((part.joints[-1, 0] - part.joints[0, 0])[[0, 2]]) > 0.6
        assert abs(turned(part)) < 60


def test_runs_and_sprints_fly_from_the_first_frame_to_the_last(made: list[Part]) -> None:
    for action, least, most in (("run", 1.9, 4.1), ("sprint", 4.0, 5.4)):
        for part in of(made, action):
            assert least < ahead(part).mean() < most
            assert ahead(part).min() > 0.6 * ahead(part).mean()
            assert abs(turned(part)) < 45
            flies = (part.joints[:, [10, 11], 1] > part.joints[:, [10, 11], 1].min() + 0.04).all(1)
            assert flies.sum() >= 2


def test_turns_go_to_the_side_that_is_told_and_other_walks_hardly_turn(made: list[Part]) -> None:
    for part in of(made, "turn"):
        assert 45 < abs(turned(part)) < 200
        side = "left" if turned(part) > 0 else "right"
        assert side == part.source.side
        assert side in captions_of(part)
        assert ahead(part).min() > 0.3
    for part in of(made, "walk"):
        assert 10 < abs(turned(part)) < 45
        assert part.source.side == ("left" if turned(part) > 0 else "right")


def test_standing_feet_stay_on_every_way(made: list[Part]) -> None:
    walk = slips(gait("walk", 1.1, 0.62, 1.8).joints)
    for part in made:
        if part.content == "leap":
            continue
        assert slips(part.joints) < (0.6 if part.source.id == "run" else walk + 0.03), part.id


def test_a_corner_turns_where_it_is_and_strides_grow() -> None:
    walk = gait("walk", 1.1, 0.62, 1.8).joints
    laid = relaid(walk, stride=1.1, curve=Bending(90.0, 0.4, 0.6))
    angle = heading(laid, FPS)
    third = len(angle) // 3
    assert abs(angle[third] - angle[0]) < 5
    assert abs(angle[-1] - angle[-third]) < 5
    assert angle[-1] - angle[0] == pytest.approx(90, abs=3)
    path = np.linalg.norm(np.diff(laid[:, 0], axis=0)[:, [0, 2]], axis=-1).sum()
    assert path == pytest.approx(1.1 * np.linalg.norm(walk[-1, 0] - walk[0, 0]), rel=0.03)


def test_leaps_fly_far_with_the_legs_apart_and_land_on_the_other_foot(made: list[Part]) -> None:
    for part in of(made, "leap"):
        toes = part.joints[:, [10, 11], 1].astype(np.float64)
        low = toes < toes.min() + 0.07
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ~low.any(1), [0]]))).reshape(-1, 2)
        first, last = max(edges, key=lambda edge: edge[1] - edge[0])
        assert (last - first) / FPS > 0.25
        assert np.linalg.norm((part.joints[last - 1, 0] - part.joints[first, 0])[[0, 2]]) > 0.8
        assert np.argmin(toes[first - 1]) != np.argmin(toes[last])
        thighs = part.joints[(first + last) // 2, [4, 5]] - part.joints[(first + last) // 2, [1, 2]]
        cosine = thighs[0] @ thighs[1] / np.linalg.norm(thighs, axis=-1).prod()
        assert np.degrees(np.arccos(cosine)) > 55
        assert 0.06 < np.ptp(part.joints[first:last, 0, 1]) < 0.6


def test_sneaks_are_slow_and_low_with_the_trunk_forward(made: list[Part]) -> None:
    walk = gait("walk", 1.1, 0.62, 1.8).joints
    for part in of(made, "sneak"):
        assert 0.3 < ahead(part).mean() < 1.2
        assert abs(turned(part)) < 45
        assert part.joints[:, 0, 1].mean() < 0.95 * walk[:, 0, 1].mean()
        assert part.joints[:, 12, 1].mean() < walk[:, 12, 1].mean() - 0.08
        lifted = np.ptp(part.joints[:, [10, 11], 1], axis=0)
        assert lifted.min() > np.ptp(walk[:, 10, 1])
