"""The action that a prompt asks for, said first in plain words."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from marey.bundles import TextSpec
from marey.selector.matching import wanted_of
from marey.text.action_reader import action_reader
from marey.text.keys import feature_key
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.pipeline import TextPipeline
from marey.text.plain_action import ALONE, MOST_WORDS, only_action, with_plain_action
from marey.vocabulary.bearings import DRAWN_AS
from marey.vocabulary.entries import Action, load_vocabulary
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def pipeline() -> TextPipeline:
    return shared_pipeline()


def plain_pipeline(pipeline: TextPipeline, **more: bool) -> TextPipeline:
    spec = pipeline.spec.model_copy(update={"plain_action": True, **more})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


@pytest.mark.parametrize(
    ("prompt", "action", "read"),
    [
        ("The waiter takes a bow.", "bow", "a person bows, the waiter takes a bow."),
        ("jog", "run", "a person runs, jog"),
        ("a drunk staggers home across the alley", "walk", "a person walks forward"),
        ("swagger walk, cocky gangster attitude", "walk", "a person walks forward"),
        ("walk away for 4 seconds", "walk", "a person walks forward, walk away"),
        ("back-pedals at a jog", "walk-backward", "a person walks backward"),
        ("NPC kicks twice", "kick", "a person kicks, NPC kicks twice"),
        ("A goblin hunkers low", "crouch", "a person crouches, a goblin hunkers low"),
        ("I bow", "bow", "a person bows, I bow"),
        ("A person bows twice", "bow", "A person bows twice"),  # plain as it is
        ("she bows and then waves", None, "she bows and then waves"),
        ("bows deeply", "bow", "a person bows deeply"),
        ("walks fast", "walk", "a person walks forward, a person walks quickly"),
        ("runs fast", "run", "a person runs fast"),
        ("Slowly takes a bow", "bow", "a person bows, a person slowly takes a bow"),
        ("arms up", "raise-arm", "a person raises an arm, arms up"),
        ("guards the door", "block", "a person blocks an attack, a person guards the door"),
        ("guards walk to the door", "walk", "a person walks forward, guards walk to the door"),
    ],
)
def test_it_comes_before_the_prompt(prompt: str, action: str | None, read: str) -> None:
    assert with_plain_action(prompt, action) == read


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("The waiter takes a bow.", "bow"),
        ("A yogi stands on one leg", "balance"),
        ("he walks and turns a corner", "turn"),
        ("He walks slowly, no running", "walk"),
        ("she bows and then waves", None),  # several
        ("the dog barks", None),  # none
        ("qwe rty", None),
        ("he doesn't run", None),  # not to be done
        ("walk " + "very " * MOST_WORDS + "slowly", None),  # long
    ],
)
def test_words_alone_name_the_action_for_encoders_without_a_reader(prompt: str, action: str | None) -> None:
    assert only_action(prompt) == action


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("bows deeply", "a person bows deeply"),
        ("falls backward and dies", "a person dies, a person falls backward and dies"),
        ("kicks with the right leg", "a person kicks with the right leg"),
        ("a man falls backward and dies", "a person dies, a man falls backward and dies"),
    ],
)
def test_an_action_is_said_once(prompt: str, read: str, pipeline: TextPipeline) -> None:
    """A model that reads "a person bows, and then a person bows deeply" bows twice."""
    plain = plain_pipeline(pipeline, in_order=True)
    (features,), (parsed,) = plain.features([prompt]), plain.explain([prompt])
    assert features.rewritten == read == parsed.graph.text
    assert features.actions == ()
    assert ("subject" in (parsed.rewrite_reason or "")) == read.startswith(f"a person {prompt}")


@pytest.mark.parametrize("action", load_vocabulary().actions.values(), ids=lambda action: action.id)
def test_the_action_of_the_plain_words_is_told_from_them(action: Action) -> None:
    read = with_plain_action("do it like this", action.id, surely=True)
    assert load_vocabulary().said_first(action.plain_words) == action.id
    if action.id in {*ALONE, *DRAWN_AS}:
        assert read == action.plain_words
        assert [each.action for step in wanted_of([read]) or () for each in step] == [action.id]
    else:
        assert load_vocabulary().said_first(read) == action.id


def test_a_bundle_says_whether_its_prompts_are_read_so(pipeline: TextPipeline) -> None:
    plain = plain_pipeline(pipeline)
    prompt = "The waiter takes a bow"
    (as_written,), (read,) = pipeline.explain([prompt]), plain.explain([prompt])
    assert (as_written.graph.text, as_written.rewrite_reason) == (prompt, None)
    assert read.graph.text.startswith("a person bows, the waiter")
    assert read.rewrite_reason == "the model knows the action by these plain words"
    assert plain.features([prompt])[0].graph.text == read.graph.text
    assert feature_key(prompt, plain.spec) != feature_key(prompt, pipeline.spec)


def test_a_manifest_without_it_is_that_of_earlier_releases() -> None:
    assert "plain_action" not in TextSpec().model_dump()
    assert TextSpec(plain_action=True).model_dump()["plain_action"] is True


def test_where_the_reader_knows_another_encoder_the_words_decide(
    pipeline: TextPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    prompts = ["The waiter takes a bow", "A young deer hunter hunkers low in the tall grass"]
    plain = plain_pipeline(pipeline)
    assert [each.graph.text[:18] for each in plain.explain(prompts)] == ["a person bows, the", "a person crouches,"]
    monkeypatch.setattr(action_reader(), "encoder_sha256", "0" * 64)
    by_words = plain_pipeline(pipeline)
    assert [each.graph.text[:18] for each in by_words.explain(prompts)] == ["a person bows, the", "A young deer hunte"]


def test_prompts_that_are_read_one_by_one_are_encoded_together(
    pipeline: TextPipeline, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[Sequence[str]] = []
    pooled = MiniLMEncoder.pooled
    monkeypatch.setattr(MiniLMEncoder, "pooled", lambda self, texts: asked.append(texts) or pooled(self, texts))
    watched = plain_pipeline(pipeline)
    prompts = ["The waiter takes a bow", "A goblin hunkers low"]
    watched.prefetch(prompts)
    assert asked == [prompts]
    for prompt in prompts:
        watched.features([prompt])
    assert not any(prompt in texts for texts in asked[1:] for prompt in prompts)


@pytest.mark.parametrize(
    ("prompt", "action", "read"),
    [
        ("he jogs in a zigzag", "run", "a person runs, he jogs"),
        ("a woman strolls off to the left", "turn", "a person walks forward, a woman strolls"),
        ("she circles the fountain", "turn", "a person walks forward"),
        ("a boy dribbles a ball while jogging ahead", "dribble", "a person runs"),
    ],
)
def test_ways_are_read_without_their_course(prompt: str, action: str, read: str) -> None:
    assert with_plain_action(prompt, action) == read
