"""The reader of prompts that ask for several movements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from marey.bundles import TextSpec
from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.core.errors import InvalidFile
from marey.generation.wish import action_of
from marey.referee.prompts import development_prompts
from marey.text.action_reader import OUTSIDE, action_reader
from marey.text.clause_order import CONTEXT, ReadClause, comes_with, in_order, without_joints
from marey.text.keys import feature_key
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.pipeline import TextPipeline
from marey.text.sequence_reader import (
    DRAWN_S,
    MOST_CUTS,
    REST_S,
    ReadMovement,
    SequenceReader,
    _placed,
    sequence_reader,
    turned_to_carry,
)
from marey.vocabulary.bearing_words import as_written
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import STANDING
from tests.support.texts import order_of_time, shared_encoder, shared_pipeline, shared_reading_encoder

EVERY = pytest.mark.parametrize("every", [6, pytest.param(1, marks=pytest.mark.slow)])
"""Of so many prompts, one is read: rates of all take seconds."""


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


def read(prompt: str) -> tuple[ReadMovement, ...]:
    encoder = shared_reading_encoder()
    reader, bare = sequence_reader(), as_written(prompt)
    written = reader.written_clauses(bare, encoder.encode(prompt), encoder.pooled)
    return reader.read(bare, written, order_of_time)


def test_it_knows_every_action_and_the_shipped_encoder() -> None:
    assert sequence_reader().classes == (*load_vocabulary().actions, OUTSIDE, CONTEXT)
    assert sequence_reader().encoder_sha256 == shared_encoder().sha256


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("The old knight walks to the altar, kneels down, and then bows.", ["walk", "kneel", "bow"]),
        ("before bowing, he claps", ["clap", "bow"]),
        ("he claps after a deep bow", ["bow", "clap"]),
        ("jog -> jump -> cheer", ["run", "jump", "cheer"]),
        ("The knight kneels, then stands up and bows.", ["kneel", "get-up", "bow"]),
        ("she is sitting on a chair, then gets up and leaves", ["sit", "stand-up", "walk"]),
        ("A kid dances. Then he lies down on the floor.", ["dance", "lie-down"]),
        ("The tumbler rolls forward along the mat, gets up and draws a bow.", ["roll", STANDING, "draw-bow"]),
        ("While his friends are away the old man dances.", []),
        ("While the others wait, the guard kneels, then bows.", ["kneel", "bow"]),
        ("A boy dances until he is tired and then sits down on the floor.", ["dance", "sit-floor"]),
        ("She walks up the path, makes a wide turn to her right and then waits.", ["turn", STANDING]),
        ("turn left, then walk four steps, then wave", ["turn", "walk", "wave"]),
        ("crawls to the tent, kneels and finally lies down without looking back", ["crawl", "kneel", "lie-down"]),
        ("kneels, then does not stand up", []),
        ("a knight blocks a strike, steps back, then slashes with his sword", ["block", "walk-backward", "slash"]),
        ("lies on his back asleep, wakes up, then waves", ["lie", "lie", "wave"]),
        ("lies on his back asleep, wakes up, then gets up", ["lie", "get-up"]),
        ("climbs a few stairs, waits, then climbs on", ["climb-stairs", STANDING, "climb-stairs"]),
        ("bends down, picks up a key and walks off", ["pick-up", "walk"]),
        ("he kneels, then plays chess, then walks off", ["kneel", "kneel", "walk"]),
    ],
)
def test_movements_come_in_the_order_of_time(prompt: str, actions: list[str]) -> None:
    assert [movement.action for movement in read(prompt)] == actions


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("drives the car and swerves left and right", "drive"),
        ("hangs from a bar, then does pull-ups", "hang"),
    ],
)
def test_what_is_done_at_a_wheel_or_by_hands_that_hold_is_part_of_it(prompt: str, action: str) -> None:
    assert read(prompt) == (ReadMovement(prompt, action),)


def test_who_hangs_and_walks_away_does_two_things() -> None:
    assert [movement.action for movement in read("hangs from a bar, then walks away")] == ["hang", "walk"]


def test_a_movement_keeps_its_words_but_those_that_join_it() -> None:
    assert [movement.text for movement in read("He takes two steps back, and then he waves his left hand.")] == [
        "He takes two steps back",
        "he waves his left hand",
    ]
    assert without_joints(", and then he bows,") == "he bows"
    assert without_joints("and after a short pause, she bows") == "she bows"
    assert without_joints("then") == "then"
    assert without_joints("and as he runs, he waves") == "as he runs, he waves"


def test_what_trails_behind_a_movement_comes_with_it() -> None:
    assert comes_with("lugs a heavy crate", "staggering under the load")
    assert comes_with("pushes on", "step by step")
    assert not comes_with("lugs a heavy crate", "walking off")
    assert not comes_with("lugs a heavy crate", "stops by the door")


@EVERY
def test_three_of_four_development_prompts_are_read_right(every: int) -> None:
    prompts = sequence_prompts()[::every]
    right = [[each.action for each in read(text)] == list(actions) for text, actions in prompts]
    assert np.mean(right) >= 0.7


@EVERY
def test_few_other_prompts_are_split(reading: TextPipeline, every: int) -> None:
    single = reading.features([prompt.text for prompt in development_prompts()][:: 3 * every])
    outside = reading.features(outside_prompts()[::every])
    assert sum(bool(each.movements) for each in single) <= 0.1 * len(single) + 1
    assert sum(bool(each.movements) for each in outside) <= 0.15 * len(outside) + 1


def test_prompts_beside_each_other_are_encoded_in_few_passes_and_as_if_alone(
    reading: TextPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    passes: list[Sequence[str]] = []

    def count(encode: Callable[..., object]) -> Callable[..., object]:
        return lambda self, texts: passes.append(texts) or encode(self, texts)

    fresh = TextPipeline(reading.spec, rewriter=reading.rewriter, labeller=reading.labeller, encoder=reading.encoder)
    for name in ("pooled", "encodings"):
        monkeypatch.setattr(MiniLMEncoder, name, count(getattr(MiniLMEncoder, name)))
    prompts = [text for text, _ in sequence_prompts()[:20] if "→" not in text][:12]  # of "then", parts are encoded
    together = fresh.features(prompts)
    assert sum(bool(each.movements) for each in together) > 6
    assert len(passes) < len(prompts)
    alone = TextPipeline(fresh.spec, rewriter=fresh.rewriter, labeller=fresh.labeller, encoder=fresh.encoder)
    assert [each.to_blob() for each in together] == [alone.features([text])[0].to_blob() for text in prompts]


def test_a_blow_in_a_sequence_is_short(reading: TextPipeline) -> None:
    (prompt,) = reading.explain(["gets hit in the stomach and sits down on the ground"])
    (text,) = reading.features(["gets hit in the stomach and sits down on the ground"])
    assert [each.seconds for each in text.movements] == [DRAWN_S, None]
    assert prompt.movements[0] == load_vocabulary().need("flinch").plain_words


def clauses(*written: str) -> list[ReadClause]:
    """Return clauses written as `name:text`, each with its place in time before the name if it is not that in the
    text: `2 name:text`."""
    named = [each.partition(":") for each in written]
    return [
        ReadClause(
            name.split()[-1], 0.9, text.strip(), text.startswith("&"), int(name.split()[0]) if " " in name else at
        )
        for at, (name, _, text) in enumerate(named, 1)
    ]


@pytest.mark.parametrize(
    ("written", "groups"),
    [
        (["walk:he walks", "bow:and bows"], [["walk"], ["bow"]]),
        (["2 bow:he bows", "1 sit:after sitting", "wave:then waves"], [["sit"], ["bow"], ["wave"]]),
        (["walk:he walks", "wave:&while waving", "bow:then bows"], [["walk", "wave"], ["bow"]]),
        (["3 walk:he walks", "wave:&while waving", "1 bow:having bowed"], [["bow"], ["walk", "wave"]]),
        (["hop:hops", "hop:and hops again", "bow:then bows"], [["hop"], ["bow"]]),
    ],
)
def test_groups_of_clauses_in_the_order_of_time(written: list[str], groups: list[list[str]]) -> None:
    assert [[clause.name for clause in group] for group in in_order(clauses(*written))] == groups


def test_clauses_that_ask_for_nothing_are_left_out() -> None:
    context = ReadClause(CONTEXT, 0.9, "while the others eat")
    assert in_order([context, ReadClause("walk", 0.9, "he walks")]) == [[ReadClause("walk", 0.9, "he walks")]]


def test_a_long_list_of_clauses_is_read_in_bounded_time() -> None:
    assert len(read(", then he waves, then he bows" * 40)) <= MOST_CUTS + 1


def test_a_bundle_says_whether_its_prompts_are_read_so(reading: TextPipeline) -> None:
    prompt = "she bows low, then strolls off"
    (features,) = reading.features([prompt])
    assert [each.prompt for each in features.movements] == ["she bows low", "strolls off"]
    assert features.movements[1].rewritten == "a person walks forward, a person strolls off"
    assert features.rewritten == prompt
    (parsed,) = reading.explain([prompt])
    assert parsed.to_json()["movements"] == [each.rewritten for each in features.movements]
    plain = reading.spec.model_copy(update={"movements": False})
    assert feature_key(prompt, plain) != feature_key(prompt, reading.spec)
    assert "movements" not in TextSpec().model_dump()
    with pytest.raises(ValueError, match="needs plain_action"):
        TextSpec(movements=True)


def test_a_way_that_ends_with_a_stop_comes_to_rest(reading: TextPipeline) -> None:
    walks, waves = reading.features(["a person walks forward and stops", "a man waves and stops"])
    assert [each.rewritten for each in walks.movements] == [
        "a person walks forward",
        load_vocabulary().need(STANDING).plain_words,
    ]
    assert [each.seconds for each in walks.movements] == [None, REST_S]
    assert waves.movements == ()


def test_a_way_of_a_number_of_steps_comes_to_rest(reading: TextPipeline) -> None:
    steps, walk, stairs = reading.features(["takes three steps forward", "walks forward", "walks up three steps"])
    assert [each.rewritten for each in steps.movements] == [
        "a person walks forward, a person takes three steps forward",
        load_vocabulary().need(STANDING).plain_words,
    ]
    assert walk.movements == stairs.movements == ()


def test_a_way_to_a_stop_is_read_though_the_whole_is_in_doubt(reading: TextPipeline) -> None:
    (read,) = reading.features(["sprints forward then stops suddenly"])
    assert [load_vocabulary().said_first(each.rewritten) for each in read.movements] == ["sprint", STANDING]


@pytest.mark.parametrize(
    ("prompt", "actions"),
    [
        ("sits down on a chair, waits, then stands back up", ["sit-down", "sit", "stand-up"]),
        ("lies down, rests for a while and gets up", ["lie-down", "lie", "get-up"]),
        ("sits down, drinks a coffee and then stands up", ["sit-down", "drink", "stand-up"]),
        ("touches toes then stands up", ["bend-over", STANDING]),
        ("crouches behind a box, waits, then stands up and runs", ["crouch", "crouch", STANDING, "run"]),
        ("look over the right shoulder, then continue walking", [STANDING, "walk"]),
        ("jogs up, then jumps over the fence, then keeps running", ["run", "leap", "run"]),
    ],
)
def test_a_movement_begins_where_the_one_before_ends(reading: TextPipeline, prompt: str, actions: list[str]) -> None:
    (read,) = reading.features([prompt])
    assert [action_of(each) for each in read.movements] == actions


def test_who_only_looks_stands(reading: TextPipeline) -> None:
    (read,) = reading.features(["looks left, then looks right"])
    assert load_vocabulary().said_first(read.rewritten) == STANDING
    assert read.movements == ()


@pytest.mark.parametrize(
    ("prompt", "movements"),
    [
        ("walk forward, stop, look around", ["walk forward", "stop, look around"]),
        ("a man walks forward, stops and looks around", ["a man walks forward", "stops and looks around"]),
        ("The hero walks up to a door and knocks on it", ["The hero walks to a door", "knocks on it"]),
        ("get up from lying on the ground", []),
        ("stand up from a chair and walk away", ["stand up from a chair", "walk away"]),
        ("a soldier sneaks forward in a crouch", []),
    ],
)
def test_movements_around_a_stop_a_place_and_an_origin(
    reading: TextPipeline, prompt: str, movements: list[str]
) -> None:
    (read,) = reading.features([prompt])
    assert [each.prompt for each in read.movements] == movements


def test_a_prompt_that_is_no_sequence_is_read_as_the_likeliest_action(reading: TextPipeline) -> None:
    prompt = "arabesque, ballet, hold"
    read = action_reader().read(prompt, shared_reading_encoder().pooled([prompt])[0])
    assert (read.name, read.action) == ("arabesque", None)
    (features,) = reading.features([prompt])
    assert action_of(features) == "arabesque"


def test_one_action_is_one_text(reading: TextPipeline) -> None:
    prompts = [
        "The waiter takes a bow",
        "a person waves both arms high over the head, left and right",
        "he walks forward, then turns left around the corner",
    ]
    assert [each.movements for each in reading.features(prompts)] == [(), (), ()]


def test_another_file_is_refused(tmp_path: Path) -> None:
    save_file({"hidden": np.zeros((1, 1), np.float32)}, tmp_path / "other.safetensors")
    with pytest.raises(InvalidFile, match="not a reader of sequences"):
        SequenceReader.load(tmp_path / "other.safetensors")


def test_a_way_to_a_seat_is_read_without_the_seat() -> None:
    assert (
        ReadMovement("A king walks over to the golden throne", "walk").worded
        == ReadMovement("A king walks", "walk").worded
    )
    assert "chair" in ReadMovement("sits down on the chair", "sit-down").worded
    assert "door" in ReadMovement("walks to the door", "walk").worded


@pytest.mark.parametrize(
    ("before", "movement", "found"),
    [
        (("walks", "walk"), ("carries it back", "carry"), ["walks", "turns around", "carries it"]),
        (("walks", "walk"), ("takes the box back", "walk-backward"), ["walks", "turns around", "takes the box"]),
        (("turns around", "turn-around"), ("brings it back", "walk"), ["turns around", "brings it"]),
        (("walks", "walk"), ("takes a step back", "walk-backward"), ["walks", "takes a step back"]),
        (("walks", "walk"), ("takes it back", "reach-forward"), ["walks", "takes it back"]),
    ],
)
def test_who_carries_something_back_turns_round_first(
    before: tuple[str, str], movement: tuple[str, str], found: list[str]
) -> None:
    turned = list(turned_to_carry(ReadMovement(*each) for each in (before, movement)))
    assert [each.text for each in turned] == found
    assert found[-1] == movement[0] or turned[-1].action != "walk-backward"


def test_a_clause_that_comes_first_in_time_is_not_at_once_with_the_one_before_it() -> None:
    clauses = [ReadClause("nod", 0.9, "he nods"), ReadClause("talk", 0.9, "after talking", at_once=True)]
    assert [each.at_once for each in _placed(clauses, lambda *_: [1, 0])] == [False, False]
    assert [each.at_once for each in _placed(clauses, lambda *_: [0, 1])] == [False, True]
