"""Parts of a prompt that ask for a movement, and that nothing of its reading covers."""

from __future__ import annotations

import pytest

from marey.text.features import TextFeatures
from marey.text.meaning import MeaningJudge
from marey.text.pipeline import TextPipeline
from marey.vocabulary.scope import ActionLists, every_action, match_scope
from tests.support.texts import shared_pipeline


@pytest.fixture(scope="module")
def reading() -> TextPipeline:
    pipeline = shared_pipeline()
    spec = pipeline.spec.model_copy(update={"plain_action": True, "movements": True})
    return TextPipeline(spec, rewriter=pipeline.rewriter, labeller=pipeline.labeller, encoder=pipeline.encoder)


@pytest.mark.parametrize(
    ("prompt", "parts"),
    [
        ("the farmer crouches, milks the cow, then runs off", ["milks the cow"]),
        ("He kneels, shears a sheep, then walks off", ["shears a sheep"]),
        ("old man shuffles forward, coughs, and winds his watch", ["winds his watch"]),
        ("a pirate climbs the ladder, then hoists the sail", ["hoists the sail"]),
    ],
)
def test_clauses_that_no_movement_shows_are_left_out(reading: TextPipeline, prompt: str, parts: list[str]) -> None:
    assert reading.left_out([prompt]) == [tuple(parts)]


@pytest.mark.parametrize(
    "prompt",
    [
        "walks to the door, stops, then looks back over his left shoulder",
        "the ranger draws his bow, aims low and releases",
        "stretches her arms overhead, yawns, then does five jumping jacks",
        "Lifts a heavy crate, staggers backwards under its weight and drops it",
        "He jumps over the fence as the dog barks",
        "he knows he is late, so he runs",
        "a spy sneaks forward, feeling tired, in the rain at night",
        "the archer nocks an arrow, draws, looses, and lowers the bow",
        "takes a bullet in the right shoulder, jerks back but stays standing",
        "she kneels to pick up a coin, then stands up",
        "cheer: both fists pumped in the air",
        "a boy runs and slides to a stop",
    ],
)
def test_settings_aims_and_what_others_do_are_not(reading: TextPipeline, prompt: str) -> None:
    assert reading.left_out([prompt]) == [()]


def test_prompts_read_by_their_words_alone_leave_out_nothing() -> None:
    assert shared_pipeline().left_out(["he bows, then unlaces his boots"]) == [()]


def test_features_keep_them(reading: TextPipeline) -> None:
    (features,) = reading.features(["he bows, then unlaces his boots"])
    assert features.left_out == ("unlaces his boots",)
    assert TextFeatures.from_blob(features.to_blob()).left_out == features.left_out


def test_the_scope_names_them_as_unknown(reading: TextPipeline) -> None:
    prompt, lists = "he bows, then unlaces his boots", every_action()
    by_words = match_scope(prompt, lists)
    assert (by_words.verdict, by_words.left) == ("known", "part")
    scope = MeaningJudge.of(reading).judge(prompt, lists)
    assert (scope.by, scope.verdict, scope.left) == ("encoder", "unknown", None)
    assert [each.text for each in scope.actions if each.verdict == "unknown"] == ["unlaces his boots"]
    assert MeaningJudge.of(reading).judge("he bows, then walks off", ActionLists(("bow", "walk"))).verdict == "known"
