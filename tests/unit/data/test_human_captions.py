"""Captions in other people's words: complete, true to side and order, and never an evaluation prompt."""

from __future__ import annotations

import re
from typing import get_args

import pytest

from marey.checks.prompts import PromptSet, evaluation_prompts
from marey.data.captions import caption, seeded
from marey.data.human_captions import human_caption, human_captions, human_sequence
from tests.support.bodies import bower, raiser, runner, walker, waver
from tests.unit.data.test_captions import facts, plain

SIDE = {"side", "other", "hands", "arms", "it", "one", "is"}
GAIT = {"steps", "metres", "seconds", "pace"}
KNOWN = {
    "walk": GAIT,
    "run": GAIT,
    "walk_back": GAIT,
    "turn": GAIT | {"side", "degrees", "right_angle"},
    "raise_one": SIDE | {"height", "lasting", "seconds"},
    "raise_both": SIDE - {"other", "one"} | {"height", "lasting", "seconds", "pair"},
    "wave_one": SIDE | {"count", "lasting", "seconds"},
    "wave_both": SIDE - {"other", "one"} | {"count", "lasting", "seconds", "pair"},
    "bow": {"seconds"},
}
EXAMPLES = {
    "walk": lambda: facts("2/walk", "normal", walker()),
    "turn": lambda: facts("2/walk-turn-left", "elderly", walker(5.0, turn=90)),
    "run": lambda: facts("2/run", "active", runner()),
    "wave": lambda: facts("2/wave-left-hand", "youthful", waver("left")),
    "raise": lambda: facts("2/raise-up-right-hand", "chimpira", raiser("right")),
    "both": lambda: facts("2/wave-both-hands", "giant", waver("both")),
    "bow": lambda: facts("1/bow", "proud", bower()),
}


def fields_of(text: str) -> set[str]:
    return set(re.findall(r"{(\w+)}", text))


def test_every_act_that_prompts_ask_for_is_told_in_many_ways():
    assert set(human_captions().actions) == set(KNOWN)
    assert all(len(rows) >= 60 for rows in human_captions().actions.values())


@pytest.mark.parametrize("action", KNOWN)
def test_captions_of_an_act_name_only_what_is_measured_on_it(action):
    for row in human_captions().actions[action]:
        assert fields_of(row) <= KNOWN[action], row
        if "side" in KNOWN[action] and not action.endswith("_both"):
            assert fields_of(row) & {"side", "hands", "arms", "one"}, row


def test_frames_have_each_act_once():
    for rows, actions in ((human_captions().two, "ab"), (human_captions().stop, "ab"), (human_captions().three, "abc")):
        for row in rows:
            named = [name[0] for name in re.findall(r"{([abc](?:_\w+)?)}", row)]
            assert sorted(named) == list(actions), row


def test_one_side_after_the_other_names_both_sides():
    for row in (row for rows in human_captions().same.values() for row in rows):
        assert fields_of(row) == {"a_side", "b_side"}, row


@pytest.mark.parametrize("name", EXAMPLES)
def test_every_told_caption_is_complete_english(name):
    found = EXAMPLES[name]()
    texts = {human_caption(found, seeded(k)) for k in range(300)}
    assert len(texts) > 100
    for text in texts:
        assert text is not None
        assert not re.search(r"[{}<>]|\s\s|\s[.,]|\bthe both\b|\b(and|a|the)[.]?$", text), text


@pytest.mark.parametrize(("name", "side", "wrong"), [("turn", "left", "right"), ("raise", "right", "left")])
def test_a_told_side_is_the_side_of_the_motion(name, side, wrong):
    for k in range(300):
        text = (human_caption(EXAMPLES[name](), seeded(k)) or "").lower()
        assert side in text, text
        if name == "turn":
            assert not re.search(rf"\b{wrong}\b(?!.angle)", text), text


def test_a_told_sequence_says_both_acts_and_is_complete():
    parts = [EXAMPLES["walk"](), EXAMPLES["wave"]()]
    texts = {text for k in range(300) if (text := human_sequence(parts, seeded(k))) is not None}
    assert len(texts) > 150
    for text in texts:
        assert re.search("wav|left|greet|hand|arm|hello|bye|farewell", text.lower()), text
        assert not re.search(r"[{}<]|\s\s|\s[.,]|\bthe both\b", text), text


def test_some_captions_of_a_clip_are_told_and_some_made_by_the_grammar():
    rows = [re.sub(r"{\w+}", "", row) for row in human_captions().actions["bow"]]
    whole = {plain(row) for row in rows if row}
    drawn = [plain(caption([EXAMPLES["bow"]()], seeded(k))) for k in range(200)]
    share = sum(any(text.startswith(row[:30]) for row in whole) for text in drawn) / len(drawn)
    assert 0.3 < share < 0.8


@pytest.mark.parametrize("which", get_args(PromptSet))
def test_no_prompt_of_a_set_is_told(which):
    tables = (human_captions().actions, human_captions().same, human_captions().pairs)
    patterns = [re.compile(pattern(row)) for table in tables for rows in table.values() for row in rows]
    for prompt in evaluation_prompts(which):
        assert not any(p.fullmatch(plain(prompt.text)) for p in patterns), prompt.text


def pattern(row: str) -> str:
    """A pattern of a caption with any words in its fields."""
    pieces = [re.escape(plain(piece)).replace("\\ ", " ") for piece in re.split(r"{\w+}", row)]
    return " ?[a-z ]+ ?".join(pieces)
