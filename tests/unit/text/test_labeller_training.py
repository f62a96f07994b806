"""Training the role labeller: gold, augmentation, grammar, scores, and a fit of seconds."""

from __future__ import annotations

import json
import random
from dataclasses import replace as replace_fields
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput
from marey.labeller.card import card
from marey.labeller.data import Augmenter, corrected, distinct, fold_of, group, read_gold, replace, typo
from marey.labeller.fit import FitConfig, roles_of, tag_set
from marey.labeller.grammar import Example, sentence
from marey.labeller.pack import pack
from marey.labeller.pools import CaptionPool, caption_batches
from marey.labeller.recipe import Recipe
from marey.labeller.score import Scores
from marey.labeller.train import cross_validate, main
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


@given(st.integers(0, 2**32))
def test_every_sentence_of_the_grammar_is_well_formed(seed: int) -> None:
    check(sentence(random.Random(seed)))


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


def test_captions_that_differ_in_case_and_stops_fall_into_one_fold() -> None:
    assert group(("A", "person", "walks.")) == group(("a", "Person", "walks"))
    assert fold_of(("A", "person", "walks."), 5) == fold_of(("a", "person", "walks"), 5)


def test_gold_loses_auxiliaries_without_arguments_only(tmp_path: Path) -> None:
    entry = {
        "words": ["he", "is", "walking"],
        "predicates": [{"word": 1, "text": "is"}, {"word": 2, "text": "walking"}],
        "arguments": [{"predicate": 1, "role": "ARG0", "words": [0], "text": "he"}],
    }
    file = tmp_path / "gold.json"
    file.write_text(json.dumps([entry]))
    assert read_gold(file) == [Example(("he", "is", "walking"), (Frame(2, (Argument("ARG0", 0, 1),)),))]
    entry["arguments"] = [{"predicate": 0, "role": "ARG1", "words": [0], "text": "he"}]
    file.write_text(json.dumps([entry]))
    assert [f.predicate for f in read_gold(file)[0].frames] == [1, 2]
    file.write_text("[{}]")
    with pytest.raises(InvalidFile):
        read_gold(file)


def test_gold_is_read_as_the_repository_has_it_too(tmp_path: Path) -> None:
    entry = {
        "caption": "he is walking",
        "tokens": ["he/PRON", "is/AUX", "walk/VERB"],
        "V": {"0": {"role": "V", "spans": [1]}, "1": {"role": "V", "spans": [2]}},
        "entities": {"0": {"role": "ARG0", "spans": [0]}},
        "relations": [[1, 0, "ARG0"]],
    }
    file = tmp_path / "new_test_data.json"
    file.write_text(json.dumps({"02346": [entry], "00355": []}))
    assert read_gold(file) == [Example(("he", "is", "walking"), (Frame(2, (Argument("ARG0", 0, 1),)),))]
    del entry["relations"]
    file.write_text(json.dumps({"02346": [entry]}))
    with pytest.raises(InvalidFile):
        read_gold(file)


def test_training_leaves_out_the_parser_s_known_mistakes() -> None:
    lost = Example(("A", "person", "waves."), ())
    left = Example(("turns", "left"), (Frame(0, ()), Frame(1, ())))
    assert corrected([WALK, lost, left]) == [WALK, Example(("turns", "left"), (Frame(0, ()),))]


def test_scores_count_exact_span_and_role() -> None:
    scores = Scores()
    said = [Frame(3, (Argument("ARG0", 0, 2), Argument("ARGM-TMP", 2, 3), Argument("ARGM-DIR", 3, 5)))]
    scores.add(said, WALK.frames)
    assert scores.predicates.f1 == 1
    assert scores.arguments.f1 == pytest.approx(1 / 3)
    assert scores.spans.f1 == pytest.approx(2 / 3)
    assert scores.by_role["ARG0"].f1 == 1
    assert scores.by_role["ARGM-TMP"].f1 == 0


NOTHING = CaptionPool(variants=0, grammar=0, propbank=0)


@pytest.fixture(scope="module")
def recipe() -> Recipe:
    network = LightConfig(tag_set(roles_of([WALK, WAVE])), layers=(0, 3), width=48, heads=4, trunk=1, body=1)
    config = FitConfig(steps=40, batch=4, learning_rate=4e-3, rank=2)
    return Recipe(find_encoder("minilm"), network, config, NOTHING, 0)


@pytest.mark.parametrize(("given", "missing"), [("--propbank", "--words"), ("--words", "--propbank")])
def test_half_of_propbank_is_refused(
    given: str, missing: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    gold = tmp_path / "gold.json"
    gold.write_text("[]")
    assert main(["--gold", str(gold), given, str(tmp_path), "-o", str(tmp_path / "bundle")]) == InvalidInput.exit_code
    assert f"{missing}: is missing" in capsys.readouterr().err
    assert not (tmp_path / "bundle").exists()


def test_a_small_head_learns_two_sentences_and_survives_its_bundle(
    recipe: Recipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.labeller.fit.SMOOTHING_SENTENCES", 8)  # there are two
    weights = recipe.make([WALK, WAVE])
    labeller = weights.labeller(recipe.minilm)
    assert labeller.label([WALK.words, WAVE.words]) == [WALK.frames, WAVE.frames]

    gold = tmp_path / "gold.json"
    gold.write_text("[]")
    bundle = pack(tmp_path / "srl-tiny", weights, [gold], recipe, None)
    again = LightLabeller.load(Bundle.open(bundle.path))
    assert again.label([WALK.words, WAVE.words]) == [WALK.frames, WAVE.frames]
    assert again.sha256 == bundle.weights_sha256
    assert bundle.manifest.licence == "Apache-2.0"


@pytest.mark.slow
def test_training_is_repeatable(recipe: Recipe) -> None:
    gold = [WALK, WAVE]
    roles = tag_set(roles_of([*gold, *(sentence(random.Random(i)) for i in range(300))]))
    short = replace_fields(
        recipe,
        network=replace_fields(recipe.network, tags=roles),
        config=FitConfig(steps=3, batch=4, rank=2),
        pool=CaptionPool(variants=1, grammar=4),
    )
    one, two = short.make(gold), short.make(gold)
    for mine, theirs in ((one.head, two.head), (one.updates, two.updates)):
        assert all((mine[name] == theirs[name]).all() for name in mine)


@pytest.mark.slow
def test_cross_validation_never_scores_a_caption_it_trained_on(recipe: Recipe, monkeypatch: pytest.MonkeyPatch) -> None:
    gold = distinct([Example((*WAVE.words[:4], f"hand{i}"), WAVE.frames) for i in range(6)])
    trained: list[set[tuple[str, ...]]] = []

    def spy(examples: list[Example], *rest: object) -> object:
        trained.append({example.words for example in examples})
        return caption_batches(examples, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr("marey.labeller.recipe.caption_batches", spy)
    lost = Example(("Someone", "waves."), ())  # the parser found no verb
    short = replace_fields(recipe, config=FitConfig(steps=1, batch=8, rank=2))
    result = cross_validate([*gold[:3], gold[0]], [*gold[2:], lost], short, 2)
    everything = {example.words for example in gold}
    wanted = {name: getattr(result, name).predicates.wanted for name in ("occurring", "distinct", "parsed", "every")}
    assert wanted == {"occurring": 4, "distinct": 3, "parsed": 3, "every": 6}
    assert result.every.predicates.said >= result.every_parsed.predicates.said
    trained = [{words for words in each if words != lost.words} for each in trained]
    assert trained[0] | trained[1] == everything
    assert not trained[0] & trained[1]
    assert "2-fold" in card(result)
