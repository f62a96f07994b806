"""The captions that an evaluator's bundle carries, and which evaluator is meant."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from marey.bundles import Bundle, choose_evaluator
from marey.bundles.reference import reference_prompts
from marey.core.errors import InvalidBundle, NotFound
from marey.core.settings import Settings
from marey.items.evaluation_prompts import EvaluationPrompt
from tests.support.evaluations import CLIPS, JUDGE, write_evaluator, write_generator


def test_each_clip_gives_a_caption_its_length_and_what_it_shows(tmp_path: Path) -> None:
    write_evaluator(tmp_path)
    assert reference_prompts(Bundle.open(tmp_path / JUDGE), "test") == (
        EvaluationPrompt("walk", 3.0, "walk"),
        EvaluationPrompt("walk and wave", 9.8, "walk then wave left"),
        EvaluationPrompt("walk as a guide", 0.6, None),  # a guide's gesture is no action that is judged
    )


@pytest.mark.parametrize(
    "clips",
    [
        [],
        CLIPS[:1],
        [{**CLIPS[0], "captions": []}, CLIPS[1]],
        [{**CLIPS[0], "captions": [""]}, CLIPS[1]],
        [{**CLIPS[0], "frames": "many"}, CLIPS[1]],
        [{"captions": ["a person walks"]}, CLIPS[1]],
    ],
)
def test_captions_that_cannot_be_used_are_a_broken_bundle(tmp_path: Path, clips: list[dict[str, Any]]) -> None:
    write_evaluator(tmp_path, clips=clips)
    with pytest.raises(InvalidBundle):
        reference_prompts(Bundle.open(tmp_path / JUDGE), "test")


def test_a_bundle_without_captions_says_so(tmp_path: Path) -> None:
    write_evaluator(tmp_path)
    with pytest.raises(InvalidBundle, match="no captions of the split 'blind'"):
        reference_prompts(Bundle.open(tmp_path / JUDGE), "blind")
    write_generator(tmp_path)
    with pytest.raises(InvalidBundle, match="carries no captions of real clips"):
        reference_prompts(Bundle.open(tmp_path / "toy-starter"), "test")


def test_captions_without_motions_are_refused_with_the_counts_of_both(tmp_path: Path) -> None:
    write_evaluator(tmp_path, motions=2)
    message = "captions of 3 clips of the split 'test' and embeddings of 2 motions"
    with pytest.raises(InvalidBundle, match=message):
        reference_prompts(Bundle.open(tmp_path / JUDGE), "test")
    write_evaluator(tmp_path, motions=3)
    assert len(reference_prompts(Bundle.open(tmp_path / JUDGE), "test")) == 3


def test_a_clip_without_caption_is_named(tmp_path: Path) -> None:
    write_evaluator(tmp_path, clips=[CLIPS[1], {**CLIPS[0], "captions": []}])
    with pytest.raises(InvalidBundle, match="the captions of judge cannot be read: clip c1 has none"):
        reference_prompts(Bundle.open(tmp_path / JUDGE), "test")


def test_of_several_evaluators_one_that_measures_what_the_generator_makes_is_meant(tmp_path: Path) -> None:
    config = Settings(home=tmp_path, models=tmp_path / "models")
    write_generator(tmp_path / "models")
    write_evaluator(tmp_path / "models", "judge-a", layout="kit-251")
    write_evaluator(tmp_path / "models", "judge-b")
    generator = Bundle.open(tmp_path / "models" / "toy-starter")
    assert choose_evaluator(None, generator=generator, config=config).manifest.name == "judge-b"
    assert choose_evaluator("judge-a", generator=generator, config=config).manifest.name == "judge-a"


def test_the_evaluator_that_is_here_is_meant_unless_one_is_named(tmp_path: Path) -> None:
    config = Settings(home=tmp_path, models=tmp_path / "models")
    with pytest.raises(NotFound, match="no evaluator bundle"):
        choose_evaluator(None, config=config)
    write_generator(tmp_path / "models")
    write_evaluator(tmp_path / "models", "judge-b", weight=1.0)
    write_evaluator(tmp_path / "models", "judge-a")
    assert choose_evaluator(None, config=config).manifest.name == "judge-a"
    exact = choose_evaluator("judge-b", config=config).reference
    assert choose_evaluator(exact, config=config).reference == exact
    with pytest.raises(InvalidBundle, match="is a generator"):
        choose_evaluator("toy-starter", config=config)
    with pytest.raises(InvalidBundle, match=r"the weights of .* not 000000000000"):
        choose_evaluator("judge-b@000000000000", config=config)
