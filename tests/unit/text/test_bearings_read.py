"""Prompts that have a body bear itself in some way, as the pipeline reads them."""

from __future__ import annotations

import pytest

from marey.generation.wish import action_of
from marey.text.pipeline import TextPipeline
from marey.vocabulary.entries import load_vocabulary
from tests.support.texts import shared_pipeline

STANDS = load_vocabulary().need("idle").plain_words


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a sad woman walks with her head hanging", "a person walks forward"),
        ("a soldier salutes", STANDS),
        ("a man crosses his arms and looks left", STANDS),
        ("a person sits and thinks with his hand on his chin", "a person sits on a chair, a person sits"),
        (
            "a limping boxer throws a punch",
            "a person strikes with the fist, a limping boxer throws a punch",
        ),  # not drawn
        ("an old chair falls over", "an old chair falls over"),
        ("a man carries a heavy box to the door", "a person walks forward"),
        ("a person walks with a load", "a person walks with a load"),
        ("does three burpees", STANDS),
        ("leans against the wall with folded arms", STANDS),
        ("leans on a railing", STANDS),
        ("wades through the river", "a person walks forward"),
        ("look up at sky", STANDS),
        ("rubs the back of the neck", STANDS),
        ("the fencer lunges", STANDS),
        ("the knight lunges with his sword", "a person stabs, the knight lunges with his sword"),
        ("a golfer takes a full swing", STANDS),
        ("a maestro raises his baton", STANDS),
        ("a man does five lunges", STANDS),
        ("guard waits", STANDS),
        ("EMOTE_facepalm", STANDS),
        ("CROUCH_walk_bwd", "a person walks backward, walk backward"),
        ("CROUCH_walk_L", "a person steps sideways, walk sideways left"),
        ("tiptoes across the room", "a person sneaks, a person tiptoes across the room"),
        ("a man eats soup while seated", "a person sits on a chair, a man seated"),
        ("kneels on one knee and aims rifle", "a person kneels down, a person kneels on one knee"),
    ],
)
def test_the_model_reads_what_is_not_drawn(reading: TextPipeline, prompt: str, read: str) -> None:
    assert reading.features([prompt])[0].rewritten == read


@pytest.mark.parametrize(
    ("prompt", "movements"),
    [
        (
            "an old man walks to a bench and sits down",
            [
                ("an old man walks to a bench", "a person walks forward"),
                ("sits down", "a person sits down"),
            ],
        ),
        (
            "stand still for two seconds, answer the phone with the right hand, nod twice, and hang up",
            [
                ("stand still for two seconds", None),
                ("answer the phone with the right hand", STANDS),
                ("nod twice", None),
                ("hang up with the right hand", STANDS),
            ],
        ),
        (
            "a person leans against a wall, then walks away",
            [("a person leans against a wall", STANDS), ("walks away", None)],
        ),
        ("walks forward and lunges", [("walks forward", None), ("lunges", STANDS)]),
        ("a person walks forward and salutes", [("a person walks forward", None), ("salutes", STANDS)]),
        ("a man sits down and yawns", []),  # on the chair, in the same movement
        ("he walks in, sits down and yawns", [("he walks in", None), ("sits down and yawns", "a person sits down")]),
        ("he walks in, shrugs and salutes", [("he walks in", None), ("shrugs and salutes", STANDS)]),
        (
            "walks in, crosses his arms and walks out",
            [("walks in", None), ("crosses his arms", STANDS), ("walks out", None)],
        ),
    ],
)
def test_movements_keep_their_words_and_are_read_without_their_bearing(
    reading: TextPipeline, prompt: str, movements: list[tuple[str, str | None]]
) -> None:
    found = reading.features([prompt])[0].movements
    assert [each.prompt for each in found] == [text for text, _ in movements]
    for each, (_, read) in zip(found, movements, strict=True):
        assert read is None or each.rewritten == read


@pytest.mark.parametrize(
    ("prompt", "movements"),
    [
        ("he chops wood with an axe, five strokes", []),
        ("a conductor leads the orchestra with large gestures", []),
        ("he drinks water, wipes his brow with a sleeve and walks off", ["drink", "idle", "walk"]),
    ],
)
def test_how_or_how_often_work_is_done_is_no_movement(reading: TextPipeline, prompt: str, movements: list[str]) -> None:
    (features,) = reading.features([prompt])
    assert [action_of(each) for each in features.movements] == movements
    if not movements:
        assert action_of(features) == "idle"


def test_a_bundle_without_plain_actions_reads_prompts_as_they_are() -> None:
    prompt = "a soldier salutes"
    assert shared_pipeline().features([prompt])[0].rewritten == prompt


def test_it_says_that_words_are_drawn(reading: TextPipeline) -> None:
    drawn, sequence, plain = reading.explain(["a soldier salutes", "he walks forward and salutes", "a man bows"])
    assert drawn.to_json()["rewrite_reason"].startswith("manners and gestures are drawn")
    assert "drawn" in sequence.to_json()["rewrite_reason"]
    assert "drawn" not in (plain.to_json().get("rewrite_reason") or "")
