"""Rewriting by rules, and the guard that refuses a change of meaning."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from marey.text.guard import changed_meaning
from marey.text.loading import load_rewriter
from marey.text.pipeline import TextPipeline
from marey.text.rewriters import PromptRewriter, Rewrite, RulesRewriter, expand_units
from marey.text.roles import Frame
from marey.text.spelling import Speller
from marey.text.words import lemma, one_slip, third_person
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def pipeline() -> TextPipeline:
    return shared_pipeline("rules")


@pytest.mark.parametrize(
    ("prompt", "expected"),
    [
        ("walk 2m forward", "a person walks 2 meters forward"),
        ("I walk forward and wave my left hand", "a person walks forward and waves their left hand"),
        ("a person walked forward", "a person walks forward"),
        ("a person wlaks forwrd", "a person walks forward"),
        ("a person turns 90° to the left", "a person turns 90 degrees to the left"),
        ("a person is pushed backwards", "a person is pushed backwards"),
        ("a person walks forward", "a person walks forward"),
    ],
)
def test_a_prompt_becomes_a_caption(pipeline: TextPipeline, prompt: str, expected: str) -> None:
    assert pipeline.rewrite(prompt) == Rewrite(expected)


def test_raw_and_rewritten_prompt_are_both_kept(pipeline: TextPipeline) -> None:
    (features,) = pipeline.features(["walk forward"])
    assert (features.prompt, features.rewritten) == ("walk forward", "a person walks forward")
    assert features.graph.text == features.rewritten


class Says:
    """A rewriter that says what it is told."""

    name = "rules"

    def __init__(self, text: str) -> None:
        self.text = text

    def rewrite(self, prompt: str) -> Rewrite:
        return Rewrite(self.text, 7.0)

    def prefetch(self, prompts: Sequence[str]) -> None:
        pass


@pytest.mark.parametrize(
    ("rewrite", "what"),
    [
        ("a person waves his right hand two times", "side"),
        ("a person waves his left hand three times", "count"),
        ("a person raises his left hand two times", "verbs"),
        ("a person waves his left hand two times and walks", "verbs"),
        ("a person waves his left hand up two times", "direction"),
        ("a person waves his left hand", "count"),
    ],
)
def test_a_rewrite_that_changes_the_meaning_is_refused(pipeline: TextPipeline, rewrite: str, what: str) -> None:
    prompt = "a person waves his left hand two times"
    rewriter: PromptRewriter = Says(rewrite)
    guarded = TextPipeline(
        TextSpec(rewriter="rules"), rewriter=rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder
    )
    made = guarded.rewrite(prompt)
    assert (made.text, made.seconds) == (prompt, None)
    assert what in str(made.refused)


def test_a_rewrite_that_says_the_same_is_kept(pipeline: TextPipeline) -> None:
    rewriter: PromptRewriter = Says("someone waves their left hand twice")
    guarded = TextPipeline(
        TextSpec(rewriter="rules"), rewriter=rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder
    )
    assert guarded.rewrite("a person waves his left hand two times") == rewriter.rewrite("")


@pytest.mark.parametrize(
    ("rewrite", "lost"),
    [
        ("The person lifts the left arm beside the head and swings the forearm from side to side two times.", None),
        ("The person lifts the right arm and swings the forearm two times.", "a side"),
        ("The person lifts the left arm and swings the forearm.", "a count"),
    ],
)
def test_a_description_may_say_more_but_loses_nothing(pipeline: TextPipeline, rewrite: str, lost: str | None) -> None:
    described = TextPipeline(
        TextSpec(rewriter="rules", wording="description"),
        rewriter=Says(rewrite), labeller=pipeline.labeller, encoder=pipeline.encoder,
    )  # fmt: skip
    (features,) = described.features(["wave the left hand two times"])
    if lost is None:
        assert (features.rewritten, features.seconds) == (rewrite, 7.0)
    else:
        assert (features.rewritten, features.seconds) == (features.prompt, None)
        assert lost in str(features.not_rewritten)
    assert TextFeatures.from_blob(features.to_blob()).seconds == features.seconds


@pytest.mark.parametrize(
    ("prompt", "rewrite", "refused"),
    [
        ("a man jabs twice", "a person punches two times", None),
        ("she strolls to the left", "A person walks to the left.", None),
        ("a person waves", "Someone waves.", None),
        ("he moonwalks then waves", "a person walks then waves", None),
        ("a man jabs twice", "a person punches", "a count"),
        ("a man jabs twice", "a person kicks two times", "verbs"),  # the vocabulary knows a jab as a punch
        ("she strolls to the left", "a person walks to the right", "a side"),
        ("she strolls forward", "a person walks backward", "a direction"),
        ("a person waves", "a person walks", "verbs"),
        ("he strolls", "a person ambles", "verbs"),
        ("he strolls", "a person walks and waves", "verbs"),
        # a phrase such as "heave self up" says nothing of its verb in other ones
        ("a docker heaves a barrel", "a docker throws a barrel", None),
        ("a docker heaves himself up onto the wall", "a docker throws himself up onto the wall", "verbs"),
        ("a knight swings a sword", "a knight kicks", "verbs"),
        # the name of the action brings a direction
        ("a clerk flumps onto a stool", "a clerk sits down on a stool", None),
        ("a clerk flumps onto a stool", "a clerk sits up on a stool", "a direction"),
        ("a nurse strolls", "a nurse walks backward", "a direction"),
        ("a nurse walks and flumps onto a stool", "a nurse walks backward and sits on a stool", "a direction"),
        # no verb was found, or a noun names the action
        ("a backflip", "a person flips", None),
        ("a backflip", "a person kicks", "verbs"),
        ("a person", "a person walks and waves", "verbs"),
    ],
)
def test_an_alignment_brings_other_verbs_into_the_vocabulary_and_keeps_the_rest(
    pipeline: TextPipeline, prompt: str, rewrite: str, refused: str | None
) -> None:
    aligned = TextPipeline(
        TextSpec(rewriter="tca"), rewriter=Says(rewrite), labeller=pipeline.labeller, encoder=pipeline.encoder
    )
    made = aligned.rewrite(prompt)
    assert made.text == (prompt if refused else rewrite), made.refused
    assert (refused or "") in (made.refused or "")
    assert (made.refused is None) == (refused is None)


def test_the_guard_compares_verbs_by_their_lemma() -> None:
    before = build_graph("a person walked", [Frame(2)], max_actions=4, max_specifics=8)
    after = build_graph("a person walks", [Frame(2)], max_actions=4, max_specifics=8)
    assert changed_meaning(before, after) is None


@pytest.mark.parametrize(
    ("form", "base"),
    [
        ("walks", "walk"), ("walking", "walk"), ("walked", "walk"), ("waves", "wave"), ("waving", "wave"),
        ("running", "run"), ("ran", "run"), ("jumped", "jump"), ("raises", "raise"), ("raised", "raise"),
        ("punches", "punch"), ("carries", "carry"), ("carried", "carry"), ("hopping", "hop"), ("crossing", "cross"),
        ("dances", "dance"), ("is", "be"), ("goes", "go"), ("sits", "sit"), ("sitting", "sit"), ("kneeling", "kneel"),
        ("turned", "turn"), ("bowing", "bow"), ("Kicks,", "kick"), ("slashes", "slash"), ("spinning", "spin"),
    ],
)  # fmt: skip
def test_verb_forms_have_their_base(form: str, base: str) -> None:
    assert lemma(form) == base


@pytest.mark.parametrize(
    ("base", "third"),
    [("walk", "walks"), ("punch", "punches"), ("carry", "carries"), ("go", "goes"), ("have", "has"), ("be", "is")],
)
def test_third_person(base: str, third: str) -> None:
    assert third_person(base) == third


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2m", "2 meters"), ("1 m.", "1 meter"), ("90° left", "90 degrees left"), ("3 sec", "3 seconds"),
        ("1.5m,", "1.5 meters,"), ("2x", "2 times"), ("5 in place", "5 in place"), ("10 cm", "10 centimeters"),
        ("m m", "m m"),
    ],
)  # fmt: skip
def test_units_are_written_out(text: str, expected: str) -> None:
    assert " ".join(expand_units(text.split())) == expected


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("wlaks", "walks"), ("fowards", "forwards"), ("Jmps,", "jumps,"), ("persn", "person"), ("wade", "wade"),
     ("zzzz", "zzzz"), ("walk", "walk"), ("backwrds.", "backwards.")],
)  # fmt: skip
def test_only_unknown_words_one_slip_from_one_motion_word_are_corrected(wrong: str, right: str) -> None:
    assert Speller.load().correct(wrong) == right


@given(st.text("abcd", min_size=1, max_size=5), st.text("abcd", min_size=1, max_size=5))
def test_one_slip_is_one_edit(a: str, b: str) -> None:
    letters = "abcd"
    edits = {a[:i] + a[i + 1 :] for i in range(len(a))}
    edits |= {a[:i] + c + a[i + 1 :] for i in range(len(a)) for c in letters}
    edits |= {a[:i] + c + a[i:] for i in range(len(a) + 1) for c in letters}
    edits |= {a[:i] + a[i + 1] + a[i] + a[i + 2 :] for i in range(len(a) - 1)}
    assert one_slip(a, b) == (b in edits and a != b)


def test_an_unknown_rewriter_is_refused(pipeline: TextPipeline) -> None:
    with pytest.raises(InvalidBundle, match="none, rules"):
        load_rewriter("poet", pipeline.labeller)
    assert isinstance(load_rewriter("rules", pipeline.labeller), RulesRewriter)
