"""Output of `marey text parse` and `POST /v1/texts/parse` for a prompt."""

from __future__ import annotations

import json

import pytest

from marey.bundles import TextSpec
from marey.cli.commands import text as command
from marey.text.loading import load_rewriter
from marey.text.parsed import NO_ACTION
from marey.text.pipeline import TextPipeline
from marey.text.rewriters import Rewrite
from marey.text.words import EDGE_PUNCTUATION
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def plain() -> TextPipeline:
    return shared_pipeline()


def variant(plain: TextPipeline, **changes: object) -> TextPipeline:
    """A pipeline of another specification that shares the loaded parts."""
    spec = TextSpec().model_copy(update=changes)
    rewriter = load_rewriter(spec.rewriter, plain.labeller)
    return TextPipeline(spec, rewriter=rewriter, labeller=plain.labeller, encoder=plain.encoder)


def test_a_prompt_without_an_action_carries_a_warning(plain: TextPipeline) -> None:
    none, some = plain.explain(["slow walk forward", "a person walks"])
    assert none.to_json()["warnings"] == [NO_ACTION]
    assert some.to_json()["warnings"] == []


def test_a_bundle_that_reads_no_actions_warns_of_none(plain: TextPipeline) -> None:
    judge = TextPipeline.load(TextSpec(labeller="none"))
    assert judge.explain(["a person walks"])[0].warnings == ()


def test_parts_over_the_limits_are_named(plain: TextPipeline) -> None:
    (parsed,) = variant(plain, max_actions=1, max_specifics=1).explain(["a person walks forward, jumps, and waves."])
    assert parsed.warnings[0].startswith("2 actions over the model's limit: 'jumps', 'waves'")
    assert parsed.to_json()["cut"]["actions"] == ["jumps", "waves"]
    assert parsed.graph.cut.actions == ("jumps,", "waves.")


def test_the_prompt_and_the_text_that_was_read_are_told_apart(plain: TextPipeline) -> None:
    prompt = "Before bowing, she walks ahead."
    (parsed,) = variant(plain, in_order=True).explain([prompt])
    view = parsed.to_json()
    assert (view["prompt"], view["text"]) == (prompt, "she walks ahead, and then a person is bowing.")
    assert view["rewrite_reason"] == "the model reads several actions as one sentence each, in the order of time"
    assert plain.explain([prompt])[0].rewrite_reason is None


def test_a_rewriter_is_named_with_its_rewrite_and_with_the_reason_for_a_refused_one(plain: TextPipeline) -> None:
    rules = variant(plain, rewriter="rules")
    (made,) = rules.explain(["walk 2m forward"])
    assert made.prompt == "walk 2m forward"
    assert made.graph.text == "a person walks 2 meters forward"
    assert made.rewrite_reason == "rewritten by the rewriter 'rules'"

    class Another:
        name = "rules"

        def rewrite(self, prompt: str) -> Rewrite:
            return Rewrite(prompt.replace("left", "right"))

        def prefetch(self, prompts: object) -> None:
            pass

    rules.rewriter = Another()
    (refused,) = rules.explain(["a person raises the left arm"])
    assert refused.graph.text == refused.prompt
    assert refused.rewrite_reason is not None
    assert refused.rewrite_reason.startswith("the rewrite of 'rules' was not used: ")


def test_shown_texts_of_nodes_have_no_punctuation_and_words_keep_it(plain: TextPipeline) -> None:
    prompt = "(a person) walks forward, then waves. 'Loudly!'"
    (parsed,) = plain.explain([prompt])
    view = parsed.to_json()
    assert view["text"] == prompt
    assert view["words"] == prompt.split()
    for node in view["nodes"]:
        assert node["text"].strip(EDGE_PUNCTUATION) == node["text"]
    stored = [node.text for node in parsed.graph.nodes]
    assert "forward," in stored, "the stored graph, which the features are made of, is not changed"
    assert plain.features([prompt])[0].graph == parsed.graph


def test_the_command_shows_prompt_text_reason_and_warnings(
    plain: TextPipeline, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ordered = variant(plain, in_order=True)
    for prompt in ("Before bowing, she walks ahead.", "slow walk forward"):
        command.draw(ordered.explain([prompt])[0].to_json())
    assert capsys.readouterr().out.splitlines() == [
        "prompt: Before bowing, she walks ahead.",
        "read as: she walks ahead, and then a person is bowing.",
        "why: the model reads several actions as one sentence each, in the order of time",
        "  walks",
        "    ARG0: she",
        "    ARGM-DIR: ahead",
        "  bowing",
        "    ARGM-TMP: then",
        "    ARG0: a person",
        "prompt: slow walk forward",
        f"warning: {NO_ACTION}",
    ]
    json.dumps(ordered.explain(["a person walks"])[0].to_json())
