"""Rates of the rules of the referee on labelled clips."""

from __future__ import annotations

import tomllib

import pytest

from marey.evaluator.referee_rates import Verdicts, accepted_list, page, rates


def _clip(action: str, *seen: str, source: str = "one") -> Verdicts:
    return Verdicts("clip", action, source, frozenset(seen))


def test_a_rule_passes_its_own_clips_and_falsely_those_of_others() -> None:
    clips = [_clip("walk", "walk"), _clip("walk"), _clip("idle", "walk", "idle"), _clip("sneak", "walk", "sneak")]
    rate = next(rate for rate in rates(clips) if rate.action == "walk")
    assert (rate.clips, rate.passed) == (2, 1)
    assert (rate.others, rate.falsely, rate.of) == (1, 1, (("idle", 1),))  # sneak implies walk


@pytest.mark.parametrize(("missed", "falsely", "accepted"), [(1, 0, True), (2, 0, False), (0, 1, True), (0, 2, False)])
def test_a_rule_is_accepted_with_one_miss_and_few_false_passes(missed: int, falsely: int, accepted: bool) -> None:
    own = [_clip("walk", *(() if n < missed else ("walk",))) for n in range(10)]
    others = [_clip("idle", *(("walk",) if n < falsely else ())) for n in range(20)]
    rate = next(rate for rate in rates([*own, *others]) if rate.action == "walk")
    assert rate.accepted is accepted


def test_a_kick_in_a_dance_is_no_false_pass_of_a_single_action() -> None:
    own, dances = [_clip("kick", "kick")], [_clip("dance", "dance", "kick")] * 10
    rate = next(rate for rate in rates([*own, *dances, _clip("walk")]) if rate.action == "kick")
    assert (rate.others, rate.falsely, rate.single_others, rate.single_falsely) == (11, 10, 1, 0)
    assert rate.accepted


def test_a_rule_that_passes_no_clip_is_not_accepted() -> None:
    rate = next(rate for rate in rates([_clip("kick"), _clip("walk")]) if rate.action == "kick")
    assert not rate.accepted


def test_the_list_holds_the_accepted_rules() -> None:
    listed = tomllib.loads(accepted_list([_clip("walk", "walk"), _clip("kick")]))["accepted"]
    assert listed == ["walk"]


def test_the_page_has_a_row_for_each_action_and_fold() -> None:
    text = page([_clip("walk", "walk"), _clip("dance", "kick", source="two")], ["cmu"])
    assert text.count("\n| fold ") == 5
    assert "| walk | 1 | 100.0% | 0.0% | — | 1/1 —, 0/0 — |  | yes |" in text
    assert "| kick | 0 | — | 50.0% | 0.0% | 0/0 0.0%, 0/0 — | dance 1 | no clips |" in text
    assert "| all | 2 | 50.0% |" in text
