"""Captions by the words of the vocabulary."""

from __future__ import annotations

import pytest

from marey.data.spoken import PHRASES, SENTENCES, SUBJECTS, all_sayings, sayings, spoken
from marey.items.prompts import check_prompt
from marey.referee.prompts import action_prompts, development_prompts, studio_prompts
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists, match_scope

ACTIONS = tuple(load_vocabulary().actions)


@pytest.mark.parametrize("action", ACTIONS)
def test_captions_are_words_that_are_read_as_the_action(action: str) -> None:
    said = {text for number in range(20) for text in spoken(action, f"clip {number}")}
    assert len(said) >= 10
    assert any(text.startswith(tuple(f"{each} " for each in SUBJECTS)) for text in said)
    for text in said:
        assert check_prompt(text) == text
        assert not {"left", "right"} & set(text.split())
        assert action in {named.action for named in match_scope(text, ActionLists((action,))).actions}


def test_a_clip_has_the_same_captions_each_time_and_others_than_its_neighbour() -> None:
    first, again, other = spoken("wave", "a"), spoken("wave", "a"), spoken("wave", "b")
    assert first == again != other
    assert 1 < len(set(first)) == len(first) <= PHRASES
    assert spoken("juggle", "a") == ()


def test_words_that_are_not_true_of_a_clip_are_left_out() -> None:
    said = " ".join(text for number in range(40) for text in spoken("climb-stairs", f"clip {number}", r"\bdown|desce"))
    assert "up" in said
    assert "down" not in said
    assert "desce" not in said


def test_every_action_has_sentences_that_are_no_held_out_prompts() -> None:
    held_out = {prompt.text.casefold() for prompt in (*action_prompts(), *development_prompts(), *studio_prompts())}
    assert set(all_sayings()) == set(ACTIONS)
    for action, written in all_sayings().items():
        assert len(set(written)) == len(written) >= 60, action
        assert not held_out & {text.casefold() for text in written}
        assert all(check_prompt(text) == text for text in written)


def test_a_clip_has_some_of_the_sentences_of_its_action() -> None:
    some = sayings("wave", "a")
    assert len(set(some)) == SENTENCES
    assert set(some) <= set(all_sayings()["wave"])
    assert some != sayings("wave", "b")
    assert sayings("juggle", "a") == ()
