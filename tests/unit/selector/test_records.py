"""The match in a quality record, and its percentile among real clips."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.data.selector_values import document
from marey.motion.clip import MotionClip
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from marey.quality.record import Flag, MotionQuality, PromptMatch
from marey.selector import RULES
from marey.selector.records import PERCENT, match_of, percentile, real_values
from marey.vocabulary.scope import NamedAction, Scope
from tests.support.bodies import FPS, Array, bower, walker


def clip_of(joints: Array) -> MotionClip:
    pose = solve_pose(joints, HUMANML3D, fps=FPS)
    return MotionClip.of(pose.skeleton, pose.rotations, pose.root, np.zeros((len(joints), 4), bool), FPS)


def test_a_walk_matches_its_prompt_and_has_a_percentile_among_real_walks() -> None:
    matched = match_of(clip_of(walker()), ["a person walks"])
    assert matched.value is not None
    assert matched.value >= 0.5
    assert matched.percentile == percentile("walk", matched.value)
    assert matched.percentile is not None


def test_several_actions_have_no_percentile_and_unknown_ones_no_value() -> None:
    clip = clip_of(np.concatenate([walker(), bower() + np.array([0, 0, 4.4])]))
    several = match_of(clip, ["a person walks", "he bows"])
    assert several.value is not None
    assert several.percentile is None
    assert match_of(clip, ["the dog barks"]) == PromptMatch()
    assert match_of(clip_of(walker()[:6]), ["a person walks"]) == PromptMatch()


def test_the_action_that_the_encoder_reads_is_matched_where_words_name_none() -> None:
    clip, prompt = clip_of(walker()), ["skedaddles along"]
    scope = Scope((NamedAction("skedaddles along", "tried", "walk"),), by="encoder")
    assert match_of(clip, prompt) == PromptMatch()
    assert match_of(clip, prompt, scope.as_json()) == match_of(clip, ["a person walks"])
    assert match_of(clip, ["he bows"], scope.as_json()) == match_of(clip, ["he bows"])  # words decide
    for unread in (
        replace(scope, by="words"),
        replace(scope, flags=("negation",)),
        replace(scope, actions=(NamedAction("skedaddles along", "unknown"),)),
        replace(scope, actions=(NamedAction("does laundry", "tried", "launder"),)),
        replace(scope, actions=scope.actions * 2),
    ):
        assert match_of(clip, prompt, unread.as_json()) == PromptMatch()


def test_the_shipped_table_is_of_rules_and_rises() -> None:
    assert set(real_values()) <= set(RULES)
    for action, quantiles in real_values().items():
        assert len(quantiles) == 100 // PERCENT + 1
        assert list(quantiles) == sorted(quantiles)
        assert percentile(action, quantiles[-1]) == 100
        assert percentile(action, -0.1) == 0
    assert percentile("swim", 1.0) is None


def test_records_of_earlier_releases_have_no_match() -> None:
    record = MotionQuality(
        support=["feet"], float_s=0, skate=0, penetration_mm=0, pops=0, range_deg=0, self_contact=0, flags=[], ok=True
    ).model_dump(mode="json")
    del record["match"]
    assert MotionQuality.model_validate(record).match is None


def test_a_low_match_is_a_flag_until_a_better_one_replaces_it() -> None:
    record = MotionQuality(
        support=["feet"], float_s=0, skate=1, penetration_mm=0, pops=0, range_deg=0, self_contact=0,
        flags=[Flag.SKATING], ok=False,
    )  # fmt: skip
    low = record.with_match(PromptMatch(value=0.49))
    assert low.flags == [Flag.SKATING, Flag.OFF_PROMPT]
    assert low.with_match(PromptMatch(value=0.5)).flags == [Flag.SKATING]
    assert low.with_match(PromptMatch()).flags == [Flag.SKATING]
    sound = record.model_copy(update={"flags": [], "ok": True})
    assert not sound.with_match(PromptMatch(value=0.1)).ok
    assert sound.with_match(PromptMatch(value=0.9)).ok


def test_the_table_leaves_out_actions_that_real_clips_do_not_match() -> None:
    class Data:
        sha256 = "0" * 64

        class manifest:
            sources = ()
            tier = "commercial"

    text = document(Data(), {"walk": [1.0] * 9 + [0.2], "sit": [0.0] * 20, "run": [1.0] * 9})  # type: ignore[arg-type]
    assert "walk = [0.2, 1.0" in text
    assert "sit" not in text
    assert "run" not in text


@pytest.mark.parametrize("action", ["walk", "run", "turn"])
def test_the_actions_most_in_demand_have_a_percentile(action: str) -> None:
    assert action in real_values()


def test_a_motion_that_leaves_out_a_part_does_not_show_its_prompt() -> None:
    record = MotionQuality(
        support=["feet"], float_s=0, skate=0, penetration_mm=0, pops=0, range_deg=0, self_contact=0, flags=[], ok=True
    )
    left_out = record.with_match(PromptMatch(value=1.0)).with_part_left_out()
    assert (left_out.flags, left_out.ok, left_out.match) == ([Flag.PART_LEFT_OUT], False, PromptMatch())
    low = record.with_match(PromptMatch(value=0.2)).with_part_left_out()
    assert (low.flags, low.match) == ([Flag.OFF_PROMPT, Flag.PART_LEFT_OUT], PromptMatch(value=0.2))
