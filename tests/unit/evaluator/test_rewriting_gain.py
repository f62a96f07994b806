"""The gain of rewriting on prompts in verbs that the vocabulary lacks, with recorded answers."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from pathlib import Path

import pytest

from marey.evaluator import rewriting_gain
from marey.evaluator.recorded_answers import RecordedAnswers
from marey.evaluator.rewriting_gain import GainRow, answering, gain_markdown, measure_gain, recorded_answers
from marey.referee import RULES
from marey.referee.prompts import other_verb_prompts
from marey.vocabulary.scope import every_action, match_scope
from tests.support.models import NOT_KEEPING, load, random_bundle
from tests.support.texts import shared_pipeline


def test_every_prompt_is_out_of_the_vocabulary_and_has_an_answer_and_a_rule() -> None:
    prompts = other_verb_prompts()
    assert len(prompts) == len({prompt.text for prompt in prompts}) == 40
    assert set(recorded_answers()) == {prompt.text for prompt in prompts}
    for prompt in prompts:
        assert match_scope(prompt.text, every_action()).verdict == "unknown", prompt.text
        assert set(prompt.actions) <= RULES.keys()


def test_answers_are_given_by_prompt_and_no_other() -> None:
    def asked(url: str, prompt: str) -> str:
        body = json.dumps({"messages": [{"role": "system", "content": "…"}, {"role": "user", "content": prompt}]})
        with urllib.request.urlopen(f"{url}/chat/completions", body.encode(), timeout=10) as reply:
            return json.load(reply)["choices"][0]["message"]["content"]

    with RecordedAnswers({"he jigs": "A man dances."}) as served:
        assert asked(served.url, "he jigs") == "A man dances."
        with pytest.raises(urllib.error.HTTPError, match="404"):
            asked(served.url, "he naps")


def test_both_readings_are_generated_with_the_same_seeds_and_judged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    prompts = [prompt for prompt in other_verb_prompts() if prompt.actions in {("throw",), ("walk-backward",)}]
    pipeline = shared_pipeline()
    monkeypatch.setattr(rewriting_gain, "pipeline_of", lambda generator: pipeline)
    generator = load(random_bundle(NOT_KEEPING, tmp_path / "random"))
    with answering(ask=False) as endpoint:
        rows = measure_gain(generator, prompts, endpoint, seeds=2)
    answers = recorded_answers()
    assert [row.prompt for row in rows] == [prompt.text for prompt in prompts]
    for row in rows:
        assert row.seeds == 2
        assert 0 <= min(row.plain, row.aligned) <= max(row.plain, row.aligned) <= 2
        assert row.read == (row.prompt if row.refused else answers[row.prompt])
    assert any(row.refused is None for row in rows)


def test_the_report_pairs_the_readings_by_prompt() -> None:
    rows = [GainRow("he jigs", "dance", "A man dances.", None, 1, 4, 4), GainRow("b", "nod", "b", "no verb", 2, 2, 4)]
    text = gain_markdown("own", rows)
    assert "1 rewrites were not used" in text
    assert "| all, 2 | 38% " in text
    assert "| 75% " in text
    assert "| +38 ± 74 |" in text
    assert "| rewritten, 1 | 25% " in text
    assert "- b: not used, no verb" in text
