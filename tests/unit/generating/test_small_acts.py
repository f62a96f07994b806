"""Small acts of head and hands that are drawn: where hands are, how often, and how long."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.generation.bearing import BorneSpan, borne_spans
from marey.generation.bearing_drawing import borne
from marey.generation.fine_wish import FineWish
from marey.generation.gaits import shifting
from marey.generation.port import Request
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.bearings import load_bearings
from tests.support.bearings import OnceMade
from tests.support.bodies import Body
from tests.unit.generating.test_timelines import text_of

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, HEAD = 0, 15
WRISTS = {"left": 20, "right": 21}


def drawn(prompt: str, seconds: float = 4.0, action: str = "idle") -> np.ndarray:
    """Return the joints of a body that stands, with the bearings of a prompt."""
    made = OnceMade(Body(seconds).joints())
    span = BorneSpan(0, len(made.features), stated_bearings(prompt), action, 3, prompt)
    return LAYOUT.decode(borne(made, LAYOUT, [span])).astype(np.float64)


def turns(values: np.ndarray, least: float) -> int:
    """Return how often values change their direction by `least` at least."""
    found, last, up = 0, values[0], 0
    for each in values:
        if abs(each - last) > least and np.sign(each - last) != up:
            found, up = found + 1, np.sign(each - last)
        last = max(last, each) if up > 0 else min(last, each) if up < 0 else last
    return found


def test_hands_at_the_head_stay_before_it() -> None:
    for bearing in load_bearings().values():
        for pose in bearing.arms.values():
            places = np.array(pose.path or [pose.hand or (0.0, 0.0, 1.0)])
            swung = np.concatenate([places + np.array(pose.shake) * way for way in (-1.0, 1.0)])
            if pose.at == "head":
                assert np.linalg.norm(swung, axis=1).min() > 0.08, bearing.id


def test_who_is_winded_stoops_with_the_hands_on_the_knees_and_breathes() -> None:
    joints = drawn("puts his hands on his knees, panting", seconds=7.0)
    held = joints[60:80]
    for wrist, knee in ((20, 4), (21, 5)):
        assert np.linalg.norm(held[:, wrist] - held[:, knee], axis=-1).max() < 0.25
    assert held[:, HEAD, 1].max() < joints[0, HEAD, 1] - 0.12
    assert turns(joints[50:100, HEAD, 1], 0.005) >= 2
    (winded,) = stated_bearings("puts his hands on his knees, panting")
    assert winded.shown_in("idle") == "body"
    assert not winded.shown_in("walk")


def test_a_kiss_leaves_the_mouth_ahead() -> None:
    joints = drawn("blows a kiss to the crowd")
    hand = joints[:, WRISTS["right"]] - joints[:, HEAD]
    at_mouth = int(np.linalg.norm(hand, axis=1).argmin())
    assert np.linalg.norm(hand[at_mouth]) < 0.24
    assert hand[at_mouth:, 2].max() > 0.33
    assert hand[np.linalg.norm(hand, axis=1) < 0.35, 2].min() > 0.04


@pytest.mark.parametrize(
    ("prompt", "side"),
    [
        ("wipes his mouth with the back of his left hand", "left"),
        ("wipes her nose with the back of the right hand", "right"),
        ("pushes up his glasses with his left hand", "left"),
    ],
)
def test_the_named_hand_acts_on_the_face(prompt: str, side: str) -> None:
    joints = drawn(prompt)
    near = {one: np.linalg.norm(joints[:, wrist] - joints[:, HEAD], axis=1).min() for one, wrist in WRISTS.items()}
    assert min(near, key=lambda one: near[one]) == side
    assert near[side] < 0.25 < 0.4 < max(near.values())


def test_hands_rub_the_arms_up_and_down() -> None:
    joints = drawn("rubs his arms to keep warm")
    for wrist in WRISTS.values():
        assert turns(joints[:, wrist, 1], 0.08) > 10


def test_a_gesture_fills_the_time_that_its_prompt_names() -> None:
    swings = [turns(drawn(prompt, 6.0)[:, 21, 1], 0.04) for prompt in ("beckons", "beckons for 6 seconds")]
    assert swings[1] >= swings[0] + 4
    held = [
        (np.linalg.norm((joints := drawn(prompt, 6.0))[:, 21] - joints[:, HEAD], axis=1) < 0.3).sum() / FPS
        for prompt in ("facepalms", "facepalms, 6 seconds")
    ]
    assert held[1] > held[0] + 1.5


def test_a_wave_of_a_stated_length_fills_it() -> None:
    features = stated_features(LAYOUT, "wave", FineWish(side="left", prompt="waves for 3 seconds", fixed=True), 60, 1)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    up = joints[:, 20, 1] > joints[:, HEAD, 1]
    assert up.sum() / FPS > 1.5
    assert turns(joints[up][:, 20, 0], 0.08) >= 5
    rises = int(joints[:20, 20, 1].argmax()) - np.flatnonzero(joints[:, 20, 1] > joints[0, 20, 1] + 0.02)[0]
    assert rises / FPS > 0.3
    assert (joints[:, 21, 1] < joints[:, PELVIS, 1] + 0.2).all()


def test_weight_goes_over_both_feet_in_a_short_motion() -> None:
    joints = Body(3.0).joints()
    for seed in range(4):
        moved = shifting(joints, LAYOUT, 0, len(joints), "", np.random.default_rng(seed))
        aside = (moved - joints)[:, PELVIS, 0]
        assert aside.min() < -0.03 < 0.03 < aside.max()


@pytest.mark.parametrize(
    ("prompt", "plain", "shown"),
    [
        ("jumps with joy", "a person jumps", "arms-jubilant"),
        ("walks backward in fear", "a person walks backward", "hands-warding"),
        ("stands up angrily", "a person gets up from a seat", "fists-down"),
        ("jumps with joy, arms crossed", "a person jumps", ""),
    ],
)
def test_moods_show_in_the_arms_beside_actions_that_hide_them(prompt: str, plain: str, shown: str) -> None:
    spans = borne_spans(Request(replace(text_of(prompt, 8), rewritten=plain), 1, frames=60), FPS, 60)
    names = {each.name for span in spans for each in span.stated}
    assert names & {"arms-jubilant", "hands-warding", "fists-down"} == ({shown} if shown else set())
