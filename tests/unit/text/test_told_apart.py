"""Movements that signs set apart, as the pipeline reads them."""

from __future__ import annotations

import pytest

from marey.text.pipeline import TextPipeline
from marey.text.told_apart import clauses_apart
from marey.vocabulary.entries import load_vocabulary
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("He ducks, comes up with a hook", ["He ducks", "comes up with a hook"]),
        ("kneels. Then she waves", ["kneels", "she waves"]),
        ("duck -> roll", ["duck", "roll"]),
        ("bows, arms wide", ["bows, arms wide"]),
        ("jumps, lands softly", ["jumps, lands softly"]),
        ("as he runs, he waves, then he bows", ["as he runs, he waves", "he bows"]),
        ("a routine (kick, punch, block), then a bow", ["a routine (kick, punch, block)", "a bow"]),
    ],
)
def test_signs_set_clauses_apart(text: str, parts: list[str]) -> None:
    assert clauses_apart(text) == parts


@pytest.mark.parametrize(
    ("prompt", "movements"),
    [
        ("The goalie throws the ball, ducks, and then raises both fists in triumph", 3),
        ("Turn left, then turn right.", 2),
        ("While running, he waves to the crowd, then sits down.", 2),
        ("As she walks forward, she claps her hands", 0),
        ("sidestep right, sidestep left", 2),
        ("hop once on the right leg, then twice on the left leg, then stop", 3),
        ("a backhand swing, then a quick side step to the right, then a forehand swing", 3),
        ("march five steps, turn left and keep marching", 3),
        ("she crouches to tie her shoe; then she gets up and walks off", 3),
        ("walk ahead, then turn left", 0),
        ("bends his knees, jumps up and lands", 0),
        ("a karate form: block, punch, kick", 0),
        ("shrugs, both palms up", 0),
        ("he hails a cab: arm straight up", 0),
        ("a nurse rocks a baby in her arms, standing", 0),
        ("football player heads the ball", 0),
        ("basketball star takes a jump shot", 0),
        ("a man walks up while waving with his left hand", 0),
    ],
)
def test_parts_that_are_movements_are_rows(reading: TextPipeline, prompt: str, movements: int) -> None:
    (read,) = reading.features([prompt])
    assert len(read.movements) == movements


def test_a_stop_before_a_gaze_ends_a_way(reading: TextPipeline) -> None:
    (read,) = reading.features(["jogs in, skids to a stop, looks up, looks right"])
    assert [each.prompt for each in read.movements] == ["jogs in", "skids to a stop, looks up, looks right"]


@pytest.mark.parametrize(
    ("prompt", "thrown"),
    [
        ("a boy picks up a snowball with his left hand, then throws it", "throws it with the left hand"),
        ("a boy picks up a snowball with his left hand, then throws it with the right arm", None),
        ("a boy picks up a snowball, then throws it", "throws it"),
    ],
)
def test_the_hand_that_has_taken_something_throws_it(reading: TextPipeline, prompt: str, thrown: str | None) -> None:
    (read,) = reading.features([prompt])
    assert read.movements[-1].prompt == (thrown or "throws it with the right arm")


def test_who_ties_a_shoe_gets_up_from_the_crouch(reading: TextPipeline) -> None:
    (read,) = reading.features(["he crouches to tie his shoe; then he gets up"])
    assert read.movements[-1].graph.text.startswith("a person stands upright")


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("jogs ahead, then marches in place", ["run", "walk"]),
        ("strolls forward, then treads on the spot", ["walk", "walk"]),
        ("slips and falls, then stands up", ["die", "get-up"]),
        ("slash from left to right, then slash upwards", ["slash", "slash"]),
        ("duck behind the crate, peep to the right, then duck down again", ["crouch", "idle", "crouch"]),
        ("stops, glances left, glances right, shrugs", ["idle", "idle"]),
        ("he waves, then strolls up and looks around puzzled", ["wave", "walk", "idle"]),
    ],
)
def test_movements_that_were_read_as_one(reading: TextPipeline, prompt: str, actions: list[str]) -> None:
    vocabulary = load_vocabulary()
    (read,) = reading.explain([prompt])
    assert len(read.movements) == len(actions)
    for said, action in zip(read.movements, actions, strict=True):
        assert action == "idle" or said.startswith(vocabulary.need(action).plain_words), (said, action)


@pytest.mark.parametrize("prompt", ["a guard halts and looks behind him", "he stops and glances left"])
def test_a_stop_with_a_gaze_is_standing(reading: TextPipeline, prompt: str) -> None:
    (read,) = reading.explain([prompt])
    assert not read.movements
    assert "stands" in read.graph.text
