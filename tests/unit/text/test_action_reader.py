"""The reader of the action that a prompt asks for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.core.errors import InvalidFile
from marey.referee.prompts import development_prompts
from marey.text.action_reader import (
    AGREED,
    OUTSIDE,
    SEVERAL,
    SURE,
    SURE_OF_SEVERAL,
    ActionReader,
    ReadAction,
    action_reader,
    named_actions,
)
from marey.text.parsed import without_punctuation
from marey.vocabulary.entries import load_vocabulary
from tests.support.texts import shared_encoder, shared_reading_encoder

EVERY = pytest.mark.parametrize("every", [4, pytest.param(1, marks=pytest.mark.slow)])
"""Of so many prompts, one is read: rates of all take seconds."""


def read(prompts: Sequence[str]) -> list[ReadAction]:
    vectors = shared_reading_encoder().pooled([without_punctuation(prompt) for prompt in prompts])
    return [action_reader().read(prompt, vector) for prompt, vector in zip(prompts, vectors, strict=True)]


def test_it_knows_every_action_and_the_shipped_encoder() -> None:
    assert action_reader().classes == (*load_vocabulary().actions, SEVERAL, OUTSIDE)
    assert action_reader().encoder_sha256 == shared_encoder().sha256


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("A young deer hunter hunkers low in the tall grass and stays there, watching.", "crouch"),
        ("A furious innkeeper boots the door open with the sole of her foot.", "kick"),
        ("Bends over at the hips to loosen up the hamstrings", "bend-over"),
    ],
)
def test_it_reads_what_no_list_of_words_has(prompt: str, action: str) -> None:
    assert read([prompt])[0].action == action


@EVERY
def test_nine_of_ten_prompts_of_one_action_are_read_right(every: int) -> None:
    prompts = development_prompts()[::every]
    found = read([prompt.text for prompt in prompts])
    right = sum(each.name == prompt.actions[0] for each, prompt in zip(found, prompts, strict=True))
    wrong = sum(each.action not in (None, *prompt.actions) for each, prompt in zip(found, prompts, strict=True))
    assert right >= 0.9 * len(prompts)
    assert wrong <= 0.03 * len(prompts)


@EVERY
def test_few_others_are_read_as_one_action(every: int) -> None:
    several = [each.action for each in read([text for text, _ in sequence_prompts()[::every]])]
    outside = [each.action for each in read(outside_prompts()[::every])]
    assert sum(action is not None for action in several) <= 0.2 * len(several)
    assert sum(action is not None for action in outside) <= 0.1 * len(outside)


def test_prompts_whose_words_name_several_actions_must_be_read_surely() -> None:
    prompts = [
        "a goblin hums a tune",
        "she strolls ahead, then breaks into a jog",
        "he stands and waves",
    ]
    assert [each.least for each in read(prompts)] == [SURE, SURE_OF_SEVERAL, AGREED]


def test_the_only_action_that_the_words_name_is_believed_sooner() -> None:
    (read_as,) = read(["a man traipses"])
    assert read_as.action == "walk"
    assert AGREED <= read_as.probability < SURE


def test_an_action_that_the_words_are_only_close_to_is_not_believed_sooner() -> None:
    (roams,) = read(["a man roams"])
    assert named_actions("a man roams") == {"walk"}
    assert named_actions("a man roams", surely=True) == set()
    assert (roams.name, roams.action) == ("walk", None)
    assert AGREED < roams.probability < SURE


def test_who_stands_by_the_words_does_where_the_network_knows_nothing() -> None:
    assert [each.action for each in read(["a guard waits at the door", "a guard stands at the gate"])] == 2 * ["idle"]


def test_in_doubt_it_names_none() -> None:
    assert ReadAction("walk", SURE).action == "walk"
    assert ReadAction("walk", SURE - 0.01).action is None
    assert ReadAction("walk", SURE_OF_SEVERAL - 0.01, SURE_OF_SEVERAL).action is None
    assert ReadAction(SEVERAL, 0.99).action is None
    assert ReadAction(OUTSIDE, 0.99).action is None


def test_another_file_is_refused(tmp_path: Path) -> None:
    save_file({"hidden": np.zeros((1, 1), np.float32)}, tmp_path / "other.safetensors")
    with pytest.raises(InvalidFile, match="not a reader of actions"):
        ActionReader.load(tmp_path / "other.safetensors")
