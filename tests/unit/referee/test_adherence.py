"""Rates of actions: which are supported, and what is too little to say so."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.referee import Body
from marey.referee.adherence import ActionTrial, document, interval, judge_trial, markdown, rates
from marey.referee.prompts import ActionPrompt, action_prompts, development_prompts, studio_prompts
from marey.referee.rules import accepted_rules
from marey.referee.studio import StudioRates, judge_studio, studio_markdown, studio_rates
from marey.vocabulary.entries import load_vocabulary
from tests.unit.referee.bodies import FPS, standing, walking


def _trials(
    fails: dict[int, int], *, phrasings: int = 10, seeds: int = 4, authors: int = 2, action: str = "kick"
) -> list[ActionTrial]:
    """Trials of one action; of phrasing `n` the first `fails[n]` seeds fail."""
    return [
        ActionTrial(ActionPrompt(f"prompt {n}", (action,), "", n % authors), seed, seed >= fails.get(n, 0))
        for n in range(phrasings)
        for seed in range(seeds)
    ]


@pytest.mark.parametrize(
    ("trials", "standing"),
    [
        (_trials({}), "supported"),
        (_trials({0: 4, 1: 4}), "supported"),
        (_trials({0: 4, 1: 4, 2: 1}), "tried"),  # 31 of 40
        (_trials({0: 4, 1: 4, 2: 4}, phrasings=20), "tried"),  # 85 %, and three phrasings never work
        (_trials({}, phrasings=9), "unproven"),
        (_trials({}, authors=1), "unproven"),
        (_trials({}, seeds=3), "unproven"),
    ],
)
def test_an_action_is_supported_at_80_percent_of_enough_phrasings(trials: list[ActionTrial], standing: str) -> None:
    (rate,) = rates(trials)
    assert rate.standing == standing
    assert rate.share == sum(trial.passed for trial in trials) / len(trials)


def test_an_action_is_unjudged_where_the_rule_is_not_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("marey.referee.adherence.accepted_rules", lambda: frozenset({"bow"}))
    walk, bow = rates(_trials({}, action="walk") + _trials({}, action="bow"))
    assert (walk.standing, bow.standing) == ("unjudged", "supported")
    assert "1 of 1 actions with a precise rule are supported" in markdown("toy@1", [walk, bow])


def test_the_page_and_the_list_of_accepted_rules_agree() -> None:
    page = (Path(__file__).parents[3] / "docs/reference/referee.md").read_text()
    yes = {line.split(" | ")[0].removeprefix("| ") for line in page.splitlines() if line.endswith("| yes |")}
    assert accepted_rules() == yes
    assert yes < set(load_vocabulary().actions)


def test_actions_are_counted_apart_and_the_table_begins_with_the_best() -> None:
    trials = _trials(dict.fromkeys(range(10), 4), action="bow") + _trials({0: 4}, action="kick")
    found = rates(trials)
    assert [(rate.action, rate.share, rate.lost) for rate in found] == [("bow", 0.0, 10), ("kick", 0.9, 1)]
    lines = markdown("toy@1", found).splitlines()
    assert lines[0].startswith("Bundle `toy@1`: 1 of 2 actions with a precise rule are supported; 45.0% of 80 motions")
    assert [line.split(" | ")[0] for line in lines[4:]] == ["| kick", "| bow"]
    assert len(document("toy@1", {}, trials, rates(trials))["trials"]) == 80  # pyright: ignore[reportArgumentType]


@given(st.integers(1, 500), st.floats(0, 1))
def test_an_interval_holds_its_share_and_shrinks_with_the_sample(size: int, share: float) -> None:
    low, high = interval(share, size)
    assert 0 <= low <= share + 1e-9
    assert share - 1e-9 <= high <= 1
    narrow_low, narrow_high = interval(share, 4 * size)
    assert narrow_high - narrow_low <= high - low


def test_the_referee_judges_a_trial_by_the_actions_of_its_prompt() -> None:
    prompt = ActionPrompt("she walks", ("walk",), "", 1)
    assert judge_trial(prompt, 0, Body(walking(3.0, 1.2), FPS)).passed
    assert not judge_trial(prompt, 0, Body(standing(3.0), FPS)).passed


def test_every_action_has_prompts_of_two_authors_and_no_prompt_is_asked_twice() -> None:
    prompts = action_prompts()
    asked = Counter((prompt.actions, prompt.author) for prompt in prompts)
    for action in load_vocabulary().actions:
        assert asked[(action,), 1] + asked[(action,), 2] >= 10, action
        assert min(asked[(action,), 1], asked[(action,), 2]) >= 5, action
    texts = [prompt.text.casefold() for prompt in prompts]
    assert len(set(texts)) == len(texts)


def test_prompts_for_development_ask_for_every_action_and_are_no_held_out_prompts() -> None:
    prompts = development_prompts()
    assert {prompt.actions for prompt in prompts} == {(action,) for action in load_vocabulary().actions}
    texts = {prompt.text.casefold() for prompt in prompts}
    assert len(texts) == len(prompts) > 320
    assert not texts & {prompt.text.casefold() for prompt in (*action_prompts(), *studio_prompts())}


def test_motions_of_a_list_are_counted_with_what_a_user_is_told_of_them() -> None:
    walks, bows = ActionPrompt("walk_01", ("walk",), "", 3), ActionPrompt("take a bow", ("bow",), "", 3)
    flies = ActionPrompt("she flies away", (), "", 3)
    way, still = Body(walking(3.0, 1.2), FPS), Body(standing(3.0), FPS)
    known = {"scope": {"verdict": "known", "flags": []}, "quality": {"flags": []}}
    skates = {**known, "quality": {"flags": ["skating"]}}
    doubtful = {**known, "scope": {"verdict": "unknown", "flags": ["no-action"]}}
    tried = {**known, "scope": {"verdict": "tried", "flags": []}}
    matched = {**tried, "quality": {"flags": [], "match": {"value": 0.9}}}
    trials = [
        judge_studio(walks, 0, way, known),
        judge_studio(walks, 1, way, skates),
        judge_studio(bows, 0, still, doubtful),
        judge_studio(bows, 0, still, known),
        judge_studio(flies, 0, still, doubtful),
    ]
    assert [trial.passed for trial in trials] == [True, True, False, False, None]
    assert [trial.reasons for trial in trials[1:3]] == [("skating",), ("unknown", "no-action")]
    assert judge_studio(walks, 0, way, tried).reasons == ("tried",)
    assert not judge_studio(walks, 0, way, matched).flagged  # the match settles it
    found = studio_rates(trials)
    assert found == StudioRates(2, 1, 2, 1, 1, 1)
    assert "| do not | 2 | 50% |" in studio_markdown("toy@1", found)


def test_the_list_of_a_studio_asks_for_every_action_and_for_some_beyond_the_vocabulary() -> None:
    prompts = studio_prompts()
    assert len(prompts) == 300
    assert {action for prompt in prompts for action in prompt.actions} == set(load_vocabulary().actions)
    assert 0.1 < sum(not prompt.actions for prompt in prompts) / len(prompts) < 0.2
    assert len({prompt.text.casefold() for prompt in prompts}) == 300
