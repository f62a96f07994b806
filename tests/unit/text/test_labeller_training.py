"""Training the role labeller: annotated sentences, augmentation, scores, and a fit of seconds."""

from __future__ import annotations

import json
import random
import re
from dataclasses import replace as replace_fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput
from marey.labeller.card import card
from marey.labeller.data import Augmenter, read_labels, replace, typo
from marey.labeller.fit import FitConfig, roles_of, tag_set
from marey.labeller.pack import pack
from marey.labeller.pools import SentencePool
from marey.labeller.recipe import HELD_OUT, KIT, Recipe, evaluate
from marey.labeller.score import Scores
from marey.labeller.sentences import TEST, TRAIN, Example, read_sentences
from marey.labeller.train import main
from marey.text.encoders import find_encoder
from marey.text.light import LightLabeller
from marey.text.light_network import LightConfig
from marey.text.roles import Argument, Frame

WALK = Example(
    ("A", "person", "slowly", "walks", "forward."),
    (Frame(3, (Argument("ARG0", 0, 2), Argument("ARGM-MNR", 2, 3), Argument("ARGM-DIR", 4, 5))),),
)
WAVE = Example(
    ("someone", "waves", "his", "left", "hand"),
    (Frame(1, (Argument("ARG0", 0, 1), Argument("ARG1", 2, 5))),),
)


def phrases(example: Example) -> set[tuple[str, str, str]]:
    """Verb, role and phrase of every argument."""
    return {
        (example.words[f.predicate], a.role, " ".join(example.words[a.start : a.stop]))
        for f in example.frames
        for a in f.arguments
    }


def check(example: Example) -> None:
    assert all(word and not any(c.isspace() for c in word) for word in example.words)
    for frame in example.frames:
        covered = [i for a in frame.arguments for i in a.words]
        assert len(covered) == len(set(covered))
        assert frame.predicate not in covered
        assert all(0 <= i < len(example.words) for i in [frame.predicate, *covered])


@given(st.integers(0, 2**32))
def test_every_variant_is_well_formed(seed: int) -> None:
    check(Augmenter([WALK, WAVE], random.Random(seed)).variant(random.Random(seed).choice([WALK, WAVE])))


@pytest.mark.parametrize("file", [TRAIN, TEST])
def test_every_annotated_sentence_is_well_formed(file: Path) -> None:
    examples = read_sentences(file)
    assert len(examples) == {TRAIN: 501, TEST: 71}[file]
    for example in examples:
        check(example)
        assert len(example.words) <= 30
        predicates = [frame.predicate for frame in example.frames]
        assert predicates == sorted(set(predicates))


def test_no_sentence_is_trained_on_and_scored() -> None:
    trained, scored = (
        {re.sub(r"[^a-z0-9 ]", "", " ".join(example.words).lower()) for example in read_sentences(file)}
        for file in (TRAIN, TEST)
    )
    assert not trained & scored
    assert len(trained) == 501  # none twice


def test_annotations_are_read_by_the_words_they_name(tmp_path: Path) -> None:
    file = tmp_path / "sentences.txt"
    file.write_text(
        "# two sentences\n"
        "He waves, then he waves again.\n"
        "> waves ARG0 He\n"
        "> waves ARGM-TMP then; ARG0 he; ARGM-TMP again\n"
        "\n"
        "he sees that he walks\n"
        "> walks ARG0 he@1\n"
    )
    first, second = read_sentences(file)
    again = (Argument("ARGM-TMP", 2, 3), Argument("ARG0", 3, 4), Argument("ARGM-TMP", 5, 6))
    assert first == Example(
        ("He", "waves,", "then", "he", "waves", "again."), (Frame(1, (Argument("ARG0", 0, 1),)), Frame(4, again))
    )
    assert second.frames == (Frame(4, (Argument("ARG0", 0, 1),)),)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("> jumps ARG0 A man", "no word 'jumps'"),
        ("> walks ARG0 A woman", "no phrase 'A woman'"),
        ("> walks ARG0 A man@2", "list index"),
        ("> walks SUBJECT A man", "'SUBJECT' is not a role"),
        ("> walks ARG0 A man; ARG1 man", "share a word"),
        ("> walks ARG1 walks", "share a word"),
    ],
)
def test_a_wrong_annotation_is_refused_with_its_line(line: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "sentences.txt"
    file.write_text(f"A man walks.\n{line}\n")
    with pytest.raises(InvalidFile, match=message) as refused:
        read_sentences(file)
    assert refused.value.where == f"{file}, line 2"


def test_an_annotation_without_a_sentence_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "sentences.txt"
    file.write_text("> walks ARG0 A man\n")
    with pytest.raises(InvalidFile):
        read_sentences(file)


def test_joined_clauses_share_the_subject() -> None:
    made = Augmenter([WAVE], random.Random(3)).coordinate(WALK)
    assert ("waves", "ARG0", "A person") in phrases(made)
    assert ("waves", "ARG1", "his left hand") in phrases(made)
    assert ("walks", "ARGM-DIR") in {p[:2] for p in phrases(made)}


def test_appended_sentences_share_nothing() -> None:
    made = Augmenter([WAVE], random.Random(3)).append_sentence(WALK)
    assert " ".join(made.words) == "A person slowly walks forward. someone waves his left hand"
    assert phrases(made) == phrases(WALK) | phrases(WAVE)


def test_a_longer_phrase_moves_what_follows() -> None:
    made = replace(WALK, 0, 2, ["the", "very", "old", "man"])
    assert made is not None
    assert phrases(made) == {
        ("walks", "ARG0", "the very old man"),
        ("walks", "ARGM-MNR", "slowly"),
        ("walks", "ARGM-DIR", "forward."),
    }


@pytest.mark.parametrize(("start", "stop"), [(1, 3), (3, 4), (2, 4)])
def test_a_replacement_that_cuts_an_argument_or_a_predicate_is_not_made(start: int, stop: int) -> None:
    assert replace(WALK, start, stop, ["x"]) is None


@given(st.text("abcdefgh", min_size=1, max_size=9), st.integers(0, 99))
def test_a_typo_is_small(word: str, seed: int) -> None:
    slipped = typo(word, random.Random(seed))
    assert abs(len(slipped) - len(word)) <= 1
    assert slipped


def test_labels_lose_auxiliaries_without_arguments_only(tmp_path: Path) -> None:
    entry = {
        "words": ["he", "is", "walking"],
        "predicates": [{"word": 1, "text": "is"}, {"word": 2, "text": "walking"}],
        "arguments": [{"predicate": 1, "role": "ARG0", "words": [0], "text": "he"}],
    }
    file = tmp_path / "labels.json"
    file.write_text(json.dumps([entry]))
    assert read_labels(file) == [Example(("he", "is", "walking"), (Frame(2, (Argument("ARG0", 0, 1),)),))]
    entry["arguments"] = [{"predicate": 0, "role": "ARG1", "words": [0], "text": "he"}]
    file.write_text(json.dumps([entry]))
    assert [f.predicate for f in read_labels(file)[0].frames] == [1, 2]
    file.write_text("[{}]")
    with pytest.raises(InvalidFile):
        read_labels(file)


def test_scores_count_exact_span_and_role() -> None:
    scores = Scores()
    said = [Frame(3, (Argument("ARG0", 0, 2), Argument("ARGM-TMP", 2, 3), Argument("ARGM-DIR", 3, 5)))]
    scores.add(said, WALK.frames)
    assert scores.predicates.f1 == 1
    assert scores.arguments.f1 == pytest.approx(1 / 3)
    assert scores.spans.f1 == pytest.approx(2 / 3)
    assert scores.by_role["ARG0"].f1 == 1
    assert scores.by_role["ARGM-TMP"].f1 == 0


NOTHING = SentencePool(variants=0, propbank=0)


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    network = LightConfig(tag_set(roles_of([WALK, WAVE])), layers=(0, 3), width=48, heads=4, trunk=1, body=1)
    config = FitConfig(steps=40, batch=4, learning_rate=4e-3, rank=2)
    return Recipe(find_encoder("minilm"), network, config, NOTHING, 0)


@pytest.mark.parametrize(("given", "missing"), [("--propbank", "--words"), ("--words", "--propbank")])
def test_half_of_propbank_is_refused(
    given: str, missing: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([given, str(tmp_path), "-o", str(tmp_path / "bundle")]) == InvalidInput.exit_code
    assert f"{missing}: is missing" in capsys.readouterr().err
    assert not (tmp_path / "bundle").exists()


def test_a_small_head_learns_two_sentences_and_survives_its_bundle(
    recipe: Recipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.labeller.fit.SMOOTHING_SENTENCES", 8)  # there are two
    weights = recipe.make([WALK, WAVE])
    labeller = weights.labeller(recipe.minilm)
    assert labeller.label([WALK.words, WAVE.words]) == [WALK.frames, WAVE.frames]

    result = evaluate(labeller, {HELD_OUT: [WALK, WAVE], KIT: [WALK]})
    assert result.metrics()["kit_argument_f1"] == result.metrics()["held_out_argument_f1_given_predicates"] == 1
    assert result.sentences == {HELD_OUT: 2, KIT: 1}
    assert "| KIT captions, distinct, against a parser's labels | 1 | 1.000 |" in card(result)

    bundle = pack(tmp_path / "srl-tiny", weights, [TEST], recipe, result)
    again = LightLabeller.load(Bundle.open(bundle.path))
    assert again.label([WALK.words, WAVE.words]) == [WALK.frames, WAVE.frames]
    assert again.sha256 == bundle.weights_sha256
    assert bundle.manifest.licence == "MIT"


@pytest.mark.slow
def test_training_is_repeatable(recipe: Recipe) -> None:
    gold = [WALK, WAVE]
    short = replace_fields(
        recipe,
        config=FitConfig(steps=3, batch=4, rank=2),
        pool=SentencePool(variants=1),
    )
    one, two = short.make(gold), short.make(gold)
    for mine, theirs in ((one.head, two.head), (one.updates, two.updates)):
        assert all((mine[name] == theirs[name]).all() for name in mine)
