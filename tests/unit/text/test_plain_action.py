"""The action that a prompt asks for, said first in plain words."""

from __future__ import annotations

import pytest

from marey.bundles import TextSpec
from marey.text.keys import feature_key
from marey.text.pipeline import TextPipeline
from marey.text.plain_action import MOST_WORDS, with_plain_action
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import third_person
from marey.vocabulary.scope import every_action, match_scope
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def pipeline() -> TextPipeline:
    return shared_pipeline()


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("The waiter takes a bow.", "a person bows, the waiter takes a bow."),
        ("jog", "a person runs, jog"),
        ("NPC waves twice with the left hand", "a person waves a hand, NPC waves twice with the left hand"),
        ("A yogi stands in tree pose", "a person balances on one leg, a yogi stands in tree pose"),
        ("I bow", "a person bows, I bow"),
        ("he walks and turns a corner", "a person turns, he walks and turns a corner"),
        ("He walks slowly, no running", "a person walks, he walks slowly, no running"),
    ],
)
def test_it_comes_before_the_prompt(prompt: str, read: str) -> None:
    assert with_plain_action(prompt) == read


@pytest.mark.parametrize(
    "prompt",
    [
        "A person bows twice",  # plain as it is
        "she bows and then waves",  # several
        "the dog barks",  # none
        "qwe rty",
        "he doesn't run",  # not to be done
        "walk " + "very " * MOST_WORDS + "slowly",  # long
    ],
)
def test_other_prompts_stay_as_written(prompt: str) -> None:
    assert with_plain_action(prompt) == prompt


@pytest.mark.parametrize("action", load_vocabulary().actions)
def test_the_plain_words_of_an_action_name_it(action: str) -> None:
    verb, *rest = load_vocabulary().need(action).plain.split()
    scope = match_scope(" ".join(["a person", third_person(verb), *rest]), every_action())
    assert [each.action for each in scope.actions] == [action]


def test_a_bundle_says_whether_its_prompts_are_read_so(pipeline: TextPipeline) -> None:
    spec = pipeline.spec.model_copy(update={"plain_action": True})
    plain = TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)
    prompt = "The waiter takes a bow"
    (as_written,), (read,) = pipeline.explain([prompt]), plain.explain([prompt])
    assert (as_written.graph.text, as_written.rewrite_reason) == (prompt, None)
    assert read.graph.text.startswith("a person bows, the waiter")
    assert read.rewrite_reason == "the model knows the action by the plain words that are put first"
    assert plain.features([prompt])[0].graph.text == read.graph.text
    assert feature_key(prompt, plain.spec) != feature_key(prompt, pipeline.spec)


def test_a_manifest_without_it_is_that_of_earlier_releases() -> None:
    assert "plain_action" not in TextSpec().model_dump()
    assert TextSpec(plain_action=True).model_dump()["plain_action"] is True
