"""Rules of arms: a standing body whose hands follow drawn paths shows one action, and a body at rest none of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from marey.posing.bones import two_bones
from marey.quality.record import SHOWN
from marey.selector import RULES, Motion
from tests.support.bodies import FPS, LENGTH, Array, Body, walker

T = np.arange(round(4 * FPS)) / FPS
REST = (0.0, -0.5, 0.0)
"""A hanging hand from its shoulder: ahead, up, out, metres."""


def path(*points: tuple[float, tuple[float, float, float]]) -> Array:
    """(T, 3) a hand through points at seconds, from its shoulder: ahead, up, out."""
    seconds, places = [second for second, _ in points], np.array([place for _, place in points])
    return np.stack([np.interp(T, seconds, places[:, axis]) for axis in range(3)], axis=-1)


def still(place: tuple[float, float, float]) -> Array:
    return path((0, place))


def with_hands(left: Array, right: Array, joints: Array | None = None) -> Array:
    """A standing (or another) body that faces +Z, its hands on these paths."""
    joints = Body(4.0).joints() if joints is None else joints.copy()
    for sign, (shoulder, elbow, wrist), hand in ((1, (16, 18, 20), left), (-1, (17, 19, 21), right)):
        goal = joints[:, shoulder] + np.stack([sign * hand[:, 2], hand[:, 1], hand[:, 0]], axis=-1)
        pole = np.broadcast_to([0.3 * sign, -1.0, -0.2], goal.shape)
        joints[:, elbow], joints[:, wrist] = two_bones(joints[:, shoulder], goal, pole, (LENGTH[elbow], LENGTH[wrist]))
    return joints


def waving(rate: float, size: float, axis: int, place: tuple[float, float, float]) -> Array:
    hand = still(place)
    hand[:, axis] += size * np.sin(2 * np.pi * rate * T)
    return hand


def stepping(pose: tuple[float, float, float], begin: float, taken: float, held: float) -> Array:
    """From rest to a pose in `taken` seconds, held, and back."""
    return path(
        (0, REST), (begin, REST), (begin + taken, pose), (begin + taken + held, pose), (begin + 2 * taken + held, REST)
    )


def nodding() -> Array:
    joints = Body(4.0).joints()
    joints[:, 15, 2] += 0.06 * np.sin(2 * np.pi * 1.0 * T)
    return joints


ACTIONS: dict[str, Callable[[], Array]] = {
    "guide": lambda: with_hands(stepping((0.2, -0.1, 0.45), 1.0, 0.6, 1.2), still(REST)),
    "aim": lambda: with_hands(still((0.45, 0.0, -0.1)), still((0.45, 0.0, -0.1))),
    "block": lambda: with_hands(stepping((0.25, 0.05, -0.1), 1.0, 0.3, 1.0), still(REST)),
    "stab": lambda: with_hands(
        path((0, REST), (0.8, (0.05, -0.15, 0.1)), (1.3, (0.05, -0.15, 0.1)), (1.5, (0.48, -0.1, 0.0))), still(REST)
    ),
    "reach-forward": lambda: with_hands(stepping((0.48, -0.1, 0.0), 1.0, 0.7, 0.6), still(REST)),
    "cast-spell": lambda: with_hands(
        *[path((0, REST), (0.8, (0.08, -0.2, 0.0)), (1.2, (0.08, -0.2, 0.0)), (1.5, (0.48, 0.0, 0.0)))] * 2
    ),
    "wash": lambda: with_hands(waving(1.0, 0.1, 2, (0.35, -0.2, 0.0)), still(REST)),
    "talk": lambda: with_hands(waving(0.8, 0.1, 1, (0.3, -0.3, 0.0)), waving(0.7, 0.1, 1, (0.3, -0.3, 0.0))),
    "dribble": lambda: with_hands(waving(1.6, 0.12, 1, (0.25, -0.35, 0.1)), still(REST)),
    "clap": lambda: with_hands(*[waving(1.5, 0.12, 2, (0.35, -0.2, -0.06))] * 2),
    "arm-circles": lambda: with_hands(
        np.stack([0.5 * np.sin(2 * np.pi * T / 2), -0.5 * np.cos(2 * np.pi * T / 2), 0.02 + 0 * T], axis=-1),
        still(REST),
    ),
    "shoot-basket": lambda: with_hands(
        *[path((0, REST), (0.8, (0.2, -0.15, -0.1)), (1.3, (0.2, -0.15, -0.1)), (1.6, (0.2, 0.45, -0.1)), (2.4, REST))]
        * 2
    ),
    "signal": lambda: with_hands(
        path(
            (0, REST),
            (0.5, (0.0, 0.0, 0.5)),
            (1.0, (0.0, 0.0, 0.5)),
            (1.4, (0.5, 0.0, 0.0)),
            (1.9, (0.5, 0.0, 0.0)),
            (2.3, (0.1, 0.5, 0.1)),
            (2.8, (0.1, 0.5, 0.1)),
            (3.4, REST),
        ),
        still(REST),
    ),
    "carry": lambda: with_hands(still((0.3, -0.3, 0.0)), still((0.3, -0.3, 0.0)), walker()),
    "fight-stance": lambda: with_hands(still((0.28, -0.1, 0.0)), still((0.25, -0.1, 0.0)), astride(Body(4.0).joints())),
    "nod": nodding,
}


def astride(joints: Array) -> Array:
    """A body with one foot ahead of the other."""
    for hip, knee, ankle, toe, ahead in ((1, 4, 7, 10, 0.18), (2, 5, 8, 11, -0.18)):
        joints[:, [ankle, toe], 2] += ahead
        forward = np.broadcast_to([0.0, 0.0, 1.0], (len(joints), 3))
        joints[:, knee], joints[:, ankle] = two_bones(
            joints[:, hip], joints[:, ankle].copy(), forward, (LENGTH[knee], LENGTH[ankle])
        )
    return joints


@pytest.mark.parametrize("action", ACTIONS)
def test_hands_on_their_paths_show_the_action(action: str) -> None:
    assert RULES[action](Motion(ACTIONS[action](), FPS), "") >= SHOWN


@pytest.mark.parametrize("action", ACTIONS)
def test_a_body_at_rest_and_a_walk_show_none_of_them(action: str) -> None:
    for joints in (with_hands(still(REST), still(REST)), walker()):
        assert RULES[action](Motion(joints, FPS), "") < SHOWN


@pytest.mark.parametrize("action", ["block", "reach-forward", "guide", "dribble", "arm-circles"])
def test_the_other_hand_does_not_count_where_a_side_is_named(action: str) -> None:
    motion = Motion(ACTIONS[action](), FPS)
    assert RULES[action](motion, "left") >= SHOWN
    assert RULES[action](motion, "right") < SHOWN


@pytest.mark.parametrize(
    ("action", "other"),
    [
        ("clap", "wash"),
        ("arm-circles", "stab"),
        ("dribble", "aim"),
        ("stab", "aim"),
        ("shoot-basket", "clap"),
        ("signal", "talk"),
        ("talk", "aim"),
        ("aim", "wash"),
        ("carry", "fight-stance"),
        ("fight-stance", "signal"),
        ("shoot", "aim"),
    ],
)
def test_one_action_is_not_taken_for_another(action: str, other: str) -> None:
    assert RULES[action](Motion(ACTIONS[other](), FPS), "") < SHOWN
