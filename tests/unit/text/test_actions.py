"""The actions of a prompt, in the order of time; verbs are marked by stars."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.text.actions import MAX_ACTIONS, split_actions
from marey.text.graph import SemanticGraph, build_graph
from marey.text.roles import Frame


def graph(marked: str) -> SemanticGraph:
    words = marked.split()
    frames = [Frame(k) for k, word in enumerate(words) if "*" in word]
    return build_graph(marked.replace("*", ""), frames, max_actions=8, max_specifics=16)


@pytest.mark.parametrize(
    ("prompt", "acts"),
    [
        ("a man *walks* and then *bows*", ["a man walks", "a person bows"]),
        ("He *walks* ahead. Then he *waves* his left arm.", ["He walks ahead", "he waves his left arm"]),
        ("someone *jogs* along, *stops* and *bows*", ["someone jogs along", "a person bows"]),
        ("she *waves* first and after that *strolls* off", ["she waves", "a person strolls off"]),
        ("first *bow*, then *wave*, and finally *run*", ["a person bows", "a person waves", "a person runs"]),
        ("After *bowing* to the crowd, she *walks* off.", ["a person is bowing to the crowd", "she walks off"]),
        ("Before *walking* off, she *bows*.", ["she bows", "a person is walking off"]),
        ("a girl *bows* before *starting* to *walk*", ["a girl bows", "a person is starting to walk"]),
        ("he *bows* after *waving*", ["a person is waving", "he bows"]),
        ("a boy *ends* by *bowing*, followed by *waving*", ["a boy bowing", "a person is waving"]),
        ("*walking* and *bowing*", ["a person is walking", "a person is bowing"]),
        ("he *lifts* the left arm, and next the right one", ["he lifts the left arm", "he lifts the right arm"]),
        ("a dancer *bows* and next *waves*", ["a dancer bows", "a person waves"]),
        ("*Have* the character *run* ahead, *slow* to a stop, and *bow*.", ["a person runs ahead", "a person bows"]),
        ("she *walks* on, *comes* to a halt at the door, and *bows*", ["she walks on", "a person bows"]),
        ("After a short walk, she *gives* a wave.", ["a person takes a short walk", "she gives a wave"]),
        ("After a short run she *drops* back to a walk.", ["a person takes a short run", "she drops back to a walk"]),
        ("he *jogs* a lap, *slows* down, and *waves*", ["he jogs a lap, then slows down", "a person waves"]),
        ("the guard *turns* left, *walks* a few steps more, and *salutes*",
         ["the guard turns left, then walks a few steps more", "a person salutes"]),
        ("a boy *waves* once he has *finished* *walking*",
         ["he has finished walking", "a boy waves"]),
        ("Prior to *bowing*, she *walks*.", ["she walks", "a person is bowing"]),
        ("she *walks* and, once they *come* to a standstill, *greets* a guest",
         ["she walks and, once they come to a standstill", "a person greets a guest"]),
        ("First he *bows*, second he *waves*.", ["he bows", "he waves"]),
        ("He *walks* ahead. All of a sudden they *run* off.", ["He walks ahead", "they run off"]),
        ("he *raises* the left hand and *waves* with the right one",
         ["he raises the left hand", "a person waves with the right one"]),
        ("the magician *waves*, *lets* the hand *drop* and *bows*",
         ["the magician waves, then lets the hand drop", "a person bows"]),
        ("a woman *bows*, then *raises* both hands", ["a woman bows", "a person raises both hands"]),
        ("he *runs* and then *keeps* *walking*", ["he runs", "a person keeps walking"]),
        ("she *waves* and *keeps* the left hand up", ["she waves", "a person keeps the left hand up"]),
        ("*jog* ahead and gradually *slow* down into a walk",
         ["a person jogs ahead", "a person gradually slows down into a walk"]),
        ("*Make* the character *run* ahead, *slow* to a stop, and bow.", ["a person runs ahead", "a person bows"]),
        ("*walks* ahead, *halts*, right hand wave", ["a person walks ahead", "a person waves the right hand"]),
        ("She *strolls* on, and when she has stopped she *gives* a wave.", ["She strolls on", "she gives a wave"]),
        ("She *lifts* the left hand. Then she *does* the same with the right.",
         ["She lifts the left hand", "She lifts the right hand"]),
        ("left arm wave, followed by a bow", ["a person waves the left arm", "a person takes a bow"]),
        ("he *sets* out from the door, *runs*, then *bows*", ["a person runs", "a person bows"]),
    ],
)  # fmt: skip
def test_what_follows_in_time_is_told_act_by_act(prompt: str, acts: list[str]) -> None:
    assert list(split_actions(graph(prompt))) == acts


@pytest.mark.parametrize(
    "prompt",
    [
        "a person *walks* forward",
        "He *bows* deeply, and then he *comes* back up slowly.",
        "a man *leans* forward and *stands* upright again",
        "the girl *lifts* both arms and *lets* them *fall* to her sides",
        "lift the left arm once, then back to the side",
        "she *raises* a hand and *waves* to someone",
        "a person *lifts* the right hand up, *holds* two seconds, *lowers* it",
        "the athlete *breaks* into a run and *keeps* *running*",
        "He *puts* one foot before the other and *keeps* *going* straight on.",
        "he *turns* to his left and *walks* that way",
        "The actor *walks* ahead and *hangs* a right.",
        "the man *turns* off to the right, then they *continue* *walking*",
        "she *lifts* the arm in one slow motion, and then *lowers* it all the way",
        "someone *lifts* both arms and *waves*",
        "after *bowing*, the man *straightens* up",
        "the actor *bows* and *returns* to an upright stance",
        "*have* the hero *walk* up the street, *turn* left, and *continue* on foot",
        "a person *bows* before the king",
        "a man *takes* the next left on foot",
        "a man *walks* next to a wall",
        "a woman *walks*, *keeping* the trunk upright",
        "a woman *raises* the hand and then *lowers* it again",
        "someone *lets* both hands *go* up and *come* down",
        "a person *bends* forward and *comes* back up",
        "he *walks* forward and *turns* to the left",
        "he *walks*, then *turns* left and *walks* on",
        "he *walks* forward, then left",
        "a woman *stands* with the feet together and *waves*",
        "when the music *starts*, he *dances*",
        "she *strides* on. Every movement is hesitant. The trunk stays upright.",
        "*slows* down, then at a walk",
        "person *greets* someone far away, right hand wave",
        "dance",
    ],
)
def test_what_is_one_act_is_said_by_the_whole_prompt(prompt: str) -> None:
    assert split_actions(graph(prompt)) == (prompt.replace("*", ""),)


def test_too_many_acts_are_said_together_in_the_last() -> None:
    prompt = " then ".join(["he *bows*"] * (MAX_ACTIONS + 2))
    acts = split_actions(graph(prompt))
    assert len(acts) == MAX_ACTIONS
    assert acts[-1] == "he bows then he bows then he bows"


def test_a_prompt_of_joins_alone_is_one_act() -> None:
    for prompt in ("and then", "then then then", "after, before", ". , ;", "first"):
        assert split_actions(graph(prompt)) == (prompt,)


WORDS = [
    "and",
    "then",
    "after",
    "that",
    "before",
    "first",
    "next",
    "afterwards,",
    "he",
    "the",
    "left",
    "right",
    "hand,",
    "it",
    "up",
]
VERBS = ["*walks*", "*walking*", "*bow*,", "*stops*", "*turns*", "*raises*.", "*stands*", "*lowers*"]


@given(st.lists(st.sampled_from(WORDS + VERBS), min_size=1, max_size=24))
def test_any_order_of_words_has_acts_and_every_act_says_something(words: list[str]) -> None:
    found = split_actions(graph(" ".join(words)))
    assert 1 <= len(found) <= MAX_ACTIONS
    assert all(act.strip() for act in found)
