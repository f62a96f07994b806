"""Actions that a prompt says and its motion does not show, and ways that are not straight or do not travel."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.skeleton import HUMANML3D
from marey.selector.matching import match, wanted_of
from marey.selector.motion import Motion
from marey.selector.unshown import named_beside, unshown_actions
from tests.support.bodies import Body, runner, walker, waver

FPS = 20.0


@pytest.mark.parametrize(
    ("prompt", "read", "found"),
    [
        ("a clown struts in and claps", {"walk"}, ("clap",)),
        ("she stands there, then kneels", {"idle"}, ("kneel",)),
        ("she stands there without kneeling", {"idle"}, ()),
        ("he strolls up as if he kicks a can", {"walk"}, ()),
        ("he walks past someone, and claps", {"walk"}, ()),
        ("he swims with strong kicks", {"swim"}, ()),
        ("rides over the waves, jumps in the air", {"jump"}, ()),
        ("he squats and kneels", {"squat"}, ()),
        ("he walks and waves", set(), ()),
    ],
)
def test_verbs_that_are_not_read_are_found_beside_those_that_are(
    prompt: str, read: set[str], found: tuple[str, ...]
) -> None:
    assert named_beside(prompt, frozenset(read)) == found


def test_a_verb_is_missed_only_where_the_motion_does_not_show_it() -> None:
    said = "he strolls along, and waves", ["walk"]
    assert unshown_actions(*said, walker(4.0), HUMANML3D, FPS) == ("wave",)
    assert unshown_actions(*said, waver("left"), HUMANML3D, FPS) == ()


def grade(joints: np.ndarray, sentence: str) -> float:
    steps = wanted_of([sentence])
    assert steps is not None
    return match(Motion(joints, FPS), steps)


def test_a_run_on_a_curve_need_not_be_straight() -> None:
    bent = runner(4.0)
    angle = np.linspace(0.0, np.radians(100), len(bent))
    turned = bent.copy()
    root = bent[:, :1] * [1.0, 0.0, 1.0]
    step = np.diff(root[:, 0], axis=0, prepend=root[:1, 0])
    ways = np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    def rotated(points: np.ndarray) -> np.ndarray:
        c, s = (ways[:, k].reshape(-1, *[1] * (points.ndim - 2)) for k in (0, 1))
        x, z = points[..., 0], points[..., 2]
        return np.stack([c * x + s * z, points[..., 1], c * z - s * x], axis=-1)

    turned = rotated(bent - root) + np.cumsum(rotated(step[:, None]), axis=0)
    assert grade(turned, "a person runs") < 0.5
    assert grade(turned, "a person runs, and curves to the left") >= 0.5


def test_steps_in_place_are_a_jog_on_the_spot_only_if_the_words_say_so() -> None:
    lifts = Body(4.0).joints()
    time = np.arange(len(lifts)) / FPS
    for side, sign in ((0, 1.0), (1, -1.0)):
        up = 0.14 * np.maximum(sign * np.sin(2 * np.pi * 1.25 * time), 0.0)
        for joint in ((4, 7, 10), (5, 8, 11))[side]:
            lifts[:, joint, 1] += up
    assert grade(lifts, "a person jogs in place") >= 0.5
    assert grade(lifts, "a person jogs") < 0.5
