"""The examples of the page `/live`: prompts that the shipped bundle was measured to obey."""

from __future__ import annotations

from marey.bundles import find_bundle
from marey.checks.prompts import evaluation_prompts
from marey.models.mogo.examples import LEAST, SETS, act_of
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


def test_a_bundle_without_measurements_has_none() -> None:
    assert prompts_of("mogo-starter@000000000000") == []
