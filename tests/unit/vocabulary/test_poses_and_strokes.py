"""Words of poses of yoga, of strokes, stamps and skates, and of manners that others hide."""

from __future__ import annotations

from dataclasses import replace

import pytest

from marey.vocabulary.bearing_words import BarePrompt, parts_by_gestures, stated_bearings
from marey.vocabulary.scope import every_action, match_scope

DRAWN = replace(every_action(), drawn=True)


@pytest.mark.parametrize(
    ("prompt", "name"),
    [
        ("warrior two pose, arms stretched out, holding it for four seconds", "yoga-pose"),
        ("warrior pose", "yoga-pose"),
        ("holds warrior one for five seconds", "yoga-pose"),
        ("tree pose on the left leg", "yoga-pose"),
        ("goes into downward dog", "yoga-pose"),
        ("does yoga: mountain", "yoga-pose"),
        ("bowling a cricket ball", "cricket-ball"),
        ("bowls overarm", "cricket-ball"),
        ("the fast bowler runs in and bowls", "cricket-ball"),
        ("bowls a strike", "bowling"),
        ("paddling a canoe", "paddling"),
        ("kayaks down the river", "paddling"),
        ("rows a canoe", "rowing"),
        ("spin attack sword 360 degrees", "spun-slash"),
        ("spins around and slashes with a katana", "spun-slash"),
        ("whirlwind attack with his axe", "spun-slash"),
        ("sumo stomp left and right", "sumo-stomp"),
        ("a sumo wrestler stamps his foot", "sumo-stomp"),
        ("practices tai chi in the park", "tai-chi"),
        ("swatting at a fly", "swatting"),
        ("waves away a bee", "swatting"),
        ("sneezes violently", "sneeze"),
        ("coughs violently", "cough-fit"),
        ("coughs twice", "cough"),
        ("walking against strong wind", "headwind"),
        ("battles fierce winds", "headwind"),
        ("walks in heavy wind", "headwind"),
        ("pushes a stalled car with great effort", "heavy-push"),
        ("shoves the crate with all his strength", "heavy-push"),
        ("cowers in fear, backing away", "shrinking"),
        ("backs away cowering", "shrinking"),
        ("cowers in fear, then backs away", "cower"),
        ("cowers in fear", "cower"),
        ("soldier reloads", "reloading"),
        ("ice skates", "skating"),
        ("a skater glides across the ice", "skating"),
        ("rides a skateboard", "board-riding"),
        ("skis down the hill", "skiing"),
    ],
)
def test_words_ask_for_a_bearing(prompt: str, name: str) -> None:
    assert [each.name for each in stated_bearings(prompt)] == [name]


@pytest.mark.parametrize(
    "prompt",
    [
        "a warrior poses with his sword",
        "a warrior pose with a raised sword",
        "sits on a chair",
        "spin kick",
        "spins around and strikes with the fist",
        "walks past the wind farm",
        "pushes a button",
        "pushes a shopping cart",
        "lifts a heavy box",
        "heavy box push walk",
        "surfs the web",
        "walks with a skateboard under his arm",
        "paddles in the pool",
        "a fly lands on his hand",
    ],
)
def test_other_words_ask_for_none(prompt: str) -> None:
    assert not stated_bearings(prompt)


@pytest.mark.parametrize(
    "prompt",
    [
        "sobbing, face in hands, shoulders shaking",
        "crying, head in hands, his whole body trembling",
        "weeping, hands over face",
        "praying, hands clasped, eyes closed",
        "panting, hands on knees, shoulders heaving",
        "sneezes, eyes shut",
    ],
)
def test_faces_and_heaving_shoulders_are_no_other_action(prompt: str) -> None:
    assert BarePrompt.of(prompt).text == ""
    assert match_scope(prompt, DRAWN).verdict == "known"


def test_a_gesture_stays_with_the_hand_at_the_mouth() -> None:
    assert parts_by_gestures("coughing, hand over mouth, shoulders heaving") == ()


def test_shaking_shoulders_of_who_does_not_heave_are_read() -> None:
    assert "shaking" in BarePrompt.of("salutes, body shaking").text


@pytest.mark.parametrize(
    ("prompt", "parts"),
    [
        ("salutes sharply then does an about-turn", ("salutes sharply", "does an about-turn")),
        ("shrugs helplessly, turns and leaves", ("shrugs helplessly", "turns and leaves")),
        ("salutes and sharply turns", ("salutes", "sharply turns")),
    ],
)
def test_how_a_gesture_is_done_is_said_of_it(prompt: str, parts: tuple[str, ...]) -> None:
    assert parts_by_gestures(prompt) == parts


@pytest.mark.parametrize(
    ("prompt", "read_as"),
    [
        ("ice skating gracefully", "walk"),
        ("rollerblades along the path", "walk"),
        ("rides a skateboard", "idle"),
        ("surfs a big wave", "idle"),
        ("skis down the hill", "idle"),
        ("wall run", "run"),
        ("slumps down against the wall", "sit-floor"),
    ],
)
def test_what_is_only_approximated_is_close(prompt: str, read_as: str) -> None:
    scope = match_scope(prompt, DRAWN)
    assert scope.verdict == "close"
    assert read_as in {each.read_as for each in scope.actions}
    assert "other-subject" not in scope.flags
