"""The examples of the page `/live`: prompts that the shipped bundle was measured to obey."""

from __future__ import annotations

from collections import Counter

import pytest

from marey.bundles import find_bundle
from marey.checks.judge import Expectation
from marey.checks.prompts import HeldOutPrompt, evaluation_prompts
from marey.models.mogo.examples import CANDIDATES, LEAST, LONGEST, SETS, act_of, candidates, choose, pairs
from marey.models.mogo.live_examples import measured, prompts_of
from tests.support.marey import REPOSITORY


def test_examples_are_prompts_that_the_bundle_was_measured_to_obey() -> None:
    reference = find_bundle(str(REPOSITORY / "models" / "mogo-starter")).reference
    offered = prompts_of(reference)
    assert len(offered) >= 3
    for row in measured()[reference]:
        assert row["obeyed"] >= LEAST * row["sessions"]
        assert row["sessions"] >= 6
    prompts = {each.text: each for which in SETS for each in evaluation_prompts(which)}
    acts = [act_of(prompts[prompt]) for prompt in offered]
    assert len(set(acts)) == len(acts)
    assert not any(prompts[prompt].separate for prompt in offered)


def test_the_best_prompt_of_each_action_is_chosen_and_none_that_is_rarely_obeyed() -> None:
    def prompt(text: str, act: str, side: str = "") -> HeldOutPrompt:
        return HeldOutPrompt(text, act, (Expectation(act, side),), False)  # pyright: ignore[reportArgumentType]

    asked = [
        prompt("waves left", "wave", "left"), prompt("waves its left hand", "wave", "left"),
        prompt("waves right", "wave", "right"), prompt("bows", "bow"), prompt("walks", "walk"),
    ]  # fmt: skip
    obeyed = {"waves left": 19, "waves its left hand": 20, "waves right": 20, "bows": 17, "walks": 18}
    rows = choose(asked, {text: [True] * n + [False] * (20 - n) for text, n in obeyed.items()})
    # one for each action, other sides after all actions, "bows" under nine of ten
    assert [row["prompt"] for row in rows] == ["waves its left hand", "walks", "waves right"]
    assert rows[0] == {"prompt": "waves its left hand", "obeyed": 20, "sessions": 20}


@pytest.mark.parametrize("seeds", [1, 2, 4])
def test_each_prompt_comes_first_and_second_as_often_beside_another_action(seeds: int) -> None:
    prompts = [
        HeldOutPrompt(f"{act} {number}", act, (Expectation(act, side),), False)  # pyright: ignore[reportArgumentType]
        for act, side in (("walk", ""), ("wave", "left"), ("wave", "right"), ("bow", ""), ("kick", "left"))
        for number in range(CANDIDATES)
    ]
    found = pairs(prompts, seeds)
    assert not [pair for pair in found if act_of(pair[0]) == act_of(pair[1])]
    for place in (0, 1):
        counted = Counter(pair[place].text for pair in found)
        assert counted.keys() == {prompt.text for prompt in prompts}
        assert min(counted.values()) >= seeds
    assert len(set(found)) == len(found), "no two sessions are the same"


def test_candidates_are_short_prompts_of_one_action_each() -> None:
    found = candidates()
    assert all(len(prompt.text) <= LONGEST and len(prompt.expected) == 1 and not prompt.separate for prompt in found)
    assert max(Counter(map(act_of, found)).values()) == CANDIDATES
    words = {each.text for which in SETS for each in evaluation_prompts(which)}
    assert {prompt.text for prompt in found} <= words
    assert len(found) > 10


def test_a_bundle_without_measurements_has_none() -> None:
    assert prompts_of("mogo-starter@000000000000") == []
