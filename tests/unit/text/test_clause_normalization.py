"""An action as captions say it; verbs are marked by stars."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.text.clause_normalization import normalize_clause
from marey.text.clauses import DOING, LIMBS, SIDES, Clause


def clause(marked: str) -> Clause:
    words = marked.split()
    return Clause(tuple(word.replace("*", "") for word in words), frozenset(k for k, w in enumerate(words) if "*" in w))


@pytest.mark.parametrize(
    ("said", "sentence"),
    [
        ("*take* five steps forward", "a person takes five steps forward"),
        ("*raise* its left arm, *bring* it down", "a person raises the left arm, lowers it"),
        ("*raise* its left arm, bring it down", "a person raises the left arm, lowers it"),
        ("slowly *bow*", "a person slowly bows"),
        ("*waved* to her friend", "a person waves to her friend"),
        ("*speed* up", "a person speeds up"),
        ("*let* the arm *go* up", "a person lets the arm go up"),
        ("*start* to *walk*", "a person starts to walk"),
        ("*keep* *going* for a while", "a person keeps going for a while"),
        ("a short walk", "a person takes a short walk"),
        ("a *bow*", "a person takes a bow"),
        ("a friendly wave", "a person gives a friendly wave"),
        ("right arm *waves*", "a person waves the right arm"),
        ("both hands *wave* overhead", "a person waves both hands overhead"),
        ("left hand up and down", "a person puts the left hand up and down"),
        ("right arm *goes* up", "a person's right arm goes up"),
        ("both hands *go* up", "both hands go up"),
        ("just *walking*", "a person is just walking"),
        ("person *bows*", "a person bows"),
        ("actor *bows*", "an actor bows"),
        (
            "*wave* with the right arm, the other arm *hanging*",
            "a person waves with the right arm, the other arm hanging",
        ),
        ("after some more steps, he *jogs* off", "he jogs off"),
        ("when the show is over, the actor *bends* forward", "the actor bends forward"),
        ("once upright, *wave* its two arms", "a person waves the two arms"),
        ("she *lifts* her arms then *brings* them down", "she lifts her arms then lowers them"),
        ("he *lifts* it high then *lets* it *fall*", "he lifts it high then lowers it"),
        ("the scout *drops* it too", "the scout lowers it"),
    ],
)
def test_a_clause_is_told_as_captions_say_it(said: str, sentence: str) -> None:
    assert normalize_clause(clause(said)) == sentence


@pytest.mark.parametrize(
    "said",
    [
        "a man *walks* forward",
        "she *waves* with her left arm",
        "the right arm *goes* up",
        "he *has* *lifted* the hand",
        "somebody *puts* the box down",
        "they *run* off",
        "he *lets* the reins go",
    ],
)
def test_what_is_told_already_stays(said: str) -> None:
    assert normalize_clause(clause(said)) == said.replace("*", "")


WORDS = [
    *sorted(DOING),
    *sorted(SIDES),
    *sorted(LIMBS),
    "a",
    "the",
    "her",
    "up,",
    "it",
    "when",
    "slowly",
    "*raise*",
    "*waved*",
    "*is*",
    "to",
]


@given(st.lists(st.sampled_from(WORDS), min_size=1, max_size=12))
def test_any_words_are_told_and_neither_side_nor_limb_is_lost(words: list[str]) -> None:
    sentence = normalize_clause(clause(" ".join(words)))
    assert sentence.strip()
    assert set(sentence.lower().replace(",", "").split()) >= {w for w in words if w in SIDES | LIMBS}
