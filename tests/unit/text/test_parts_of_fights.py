"""Deeds of a fight and rises after falls, each read as a movement of its own."""

from __future__ import annotations

import pytest

from marey.text.by_context import with_words_by_context
from marey.text.clause_parts import parts_in_time
from marey.text.elided_words import with_elided
from marey.text.lost_footing import THROWN_BACK, with_falls, with_thrown_bodies
from marey.text.pipeline import TextPipeline
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("a boxer throws two jabs and ducks", "a boxer throws two jabs and dodges under it"),
        ("jab, cross, duck", "jab, cross, dodge under it"),
        ("blocks, ducks, then kicks", "blocks, dodges under it, then kicks"),
        ("walks to the right and ducks", "walks to the right and ducks"),
        ("punches and ducks behind a wall", "punches and ducks behind a wall"),
    ],
)
def test_a_duck_behind_a_blow_is_a_dodge(prompt: str, read: str) -> None:
    assert with_words_by_context(prompt) == read


def test_and_joins_two_deeds_of_a_fight_one_after_the_other() -> None:
    assert parts_in_time("punches twice and dodges") == [("punches twice", "punch"), ("dodges", "dodge")]
    assert len(parts_in_time("punches and waves")) < 2


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("block high, block low", "block high, then block low"),
        ("blocks high and low", "blocks high, then blocks low"),
        ("high block, low block", "blocks high, then blocks low"),
        ("a monk kicks high, then low", "a monk kicks high, then kicks low"),
        ("block high", "block high"),
        ("blocks high and high", "blocks high and high"),
    ],
)
def test_a_deed_at_two_heights_is_done_twice(prompt: str, read: str) -> None:
    assert with_elided(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("knocked down, gets up", "falls to the ground, gets up"),
        ("tackled to the ground, springs back up", "falls to the ground, then gets up"),
        ("falls backward, slowly gets back on his feet", "falls backward, then slowly gets up"),
        ("she falls and scrambles to her feet", "she falls, then gets up"),
        ("falls down and gets back up", "falls down and gets back up"),
        ("goes down and comes back up", "goes down and comes back up"),
        ("falls and stands still", "falls and stands still"),
    ],
)
def test_who_falls_and_rises_by_any_words_gets_up(prompt: str, read: str) -> None:
    assert with_falls(prompt) == read


def test_a_body_that_a_blast_throws_falls_and_is_no_thrower() -> None:
    text = with_thrown_bodies("knocked down by explosion, slowly gets back on his feet")
    assert text == f"{THROWN_BACK}, slowly gets back on his feet"


@pytest.mark.parametrize(
    ("prompt", "parts"),
    [
        ("a boxer throws two jabs and ducks", ["a boxer throws two jabs", "dodges under it"]),
        ("someone throws a tomato at him and he dodges out of the way", []),
        ("block high, block low", ["block high", "block low"]),
        ("knocked down by explosion, slowly gets back on his feet", [THROWN_BACK, "slowly gets up"]),
        ("prone to crouch to stand", ["lies prone", "crouches", "stands up"]),
        ("walks forward, turns and returns", ["walks forward", "turns around", "walks forward"]),
    ],
)
def test_they_are_read_as_movements(reading: TextPipeline, prompt: str, parts: list[str]) -> None:
    (read,) = reading.features([prompt])
    assert [each.prompt for each in read.movements] == parts
