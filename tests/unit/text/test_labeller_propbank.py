"""Reading PropBank: roles of one repository, words of another. All sentences here are made up."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidFile
from marey.labeller.adapter import AdaptedMiniLM, token_batch
from marey.labeller.fit import FitConfig, encode, fit, roles_of, tag_set
from marey.labeller.pack import pack
from marey.labeller.pools import SentencePool, frequent_roles, propbank_batches, with_roles
from marey.labeller.propbank import SKELETONS, WORDS, Token, agree, glue, joined, read_propbank, spans
from marey.labeller.recipe import Recipe
from marey.labeller.sentences import Example
from marey.labeller.weights import Weights
from marey.text.encoders import find_encoder
from marey.text.light import LightLabeller, WordStates
from marey.text.light_network import LightConfig
from marey.text.minilm import MiniLM
from marey.text.roles import Argument, Frame

WAVING = [
    ("Anna", "NNP", "-", "(ARG0*)", ""),
    (",", ",", "-", "*", ""),
    ("the", "DT", "-", "*", ""),
    ("tall", "JJ", "-", "*", ""),
    ("girl", "NN", "-", "*", ""),
    (",", ",", "-", "*", ""),
    ("took", "VBD", "take.01", "(V*)", ""),
    ("a", "DT", "-", "(ARGM-PRR*", ""),
    ("step", "NN", "step.01", "*)", ""),
    (".", ".", "-", "*", ""),
]
EXAMPLE = Example(
    ("Anna,", "the", "tall", "girl,", "took", "a", "step."),
    (Frame(4, (Argument("ARG0", 0, 1), Argument("ARG1", 5, 7))),),
)


def skeleton() -> str:
    """The rows of `WAVING` as `gold_skel` has them; the noun's column is empty but for itself."""
    rows = []
    for index, (_, tag, roleset, role, _) in enumerate(WAVING):
        noun = "(V*)" if roleset == "step.01" else "*"
        rows.append(f"doc 0 {index} [WORD] {tag} (X*) {roleset.split('.')[0]} {roleset} {role} {noun}")
    return "\n".join(rows) + "\n"


def treebank(tags: list[str] | None = None) -> str:
    """`WAVING` in CoNLL-U, with a range and an empty node that are no tokens."""
    rows = ["# text = whatever", "1-2\tAnna,\t_\t_\t_\t_\t_\t_\t_\t_"]
    for index, (text, tag, *_) in enumerate(WAVING):
        glued = index + 1 < len(WAVING) and WAVING[index + 1][0] in ",."
        tag = tags[index] if tags else tag
        rows.append(f"{index + 1}\t{text}\t_\t_\t{tag}\t_\t0\t_\t_\t{'SpaceAfter=No' if glued else '_'}")
    return "\n".join([*rows, "10.1\tgone\t_\t_\tNN\t_\t_\t_\t_\t_"]) + "\n"


@pytest.fixture
def checkouts(tmp_path: Path) -> tuple[Path, Path]:
    roles, words = tmp_path / "roles" / SKELETONS / "email" / "00", tmp_path / "words" / WORDS / "email"
    roles.mkdir(parents=True)
    words.mkdir(parents=True)
    (roles / "one.xml.gold_skel").write_text(skeleton() + "\n" + skeleton())
    (roles / "alone.xml.gold_skel").write_text(skeleton())
    (words / "one.xml.conllu").write_text(treebank(["UH"] * len(WAVING)) + "\n" + treebank())
    return tmp_path / "roles", tmp_path / "words"


def test_sentences_are_joined_where_their_tags_agree(checkouts: tuple[Path, Path]) -> None:
    assert read_propbank(*checkouts) == [EXAMPLE]  # the first sentence has other tags; "step" is a noun


def test_folders_without_a_common_sentence_are_refused(checkouts: tuple[Path, Path], tmp_path: Path) -> None:
    with pytest.raises(InvalidFile, match="no sentence in common"):
        read_propbank(checkouts[0], tmp_path)


def test_columns_are_read_as_spans() -> None:
    assert list(spans(["(ARG0*", "*)", "(V*)", "*", "(ARGM-LOC*)"])) == [
        ("ARG0", 0, 2),
        ("V", 2, 3),
        ("ARGM-LOC", 4, 5),
    ]


def test_punctuation_joins_the_word_it_touches() -> None:
    tokens = [Token("(", "", True), Token("do", "", True), Token("n't", "", True), Token(")", "", False)]
    assert glue([*tokens, Token("-", "", False)]) == ([0, 0, 1, 1, 2], ["(do", "n't)", "-"])


def test_a_sentence_whose_arguments_would_share_a_word_is_left_out() -> None:
    tokens = [Token("up", "RB", True), Token("/", ",", True), Token("down", "RB", False), Token("go", "VB", False)]
    rows = [["", "", "", "", token.tag, "", "-", "-"] for token in tokens]
    rows[3][7] = "go.01"
    for row, cell in zip(rows, ["(ARGM-DIR*)", "*", "(ARG4*)", "(V*)"], strict=True):
        row.append(cell)
    assert joined(tokens, rows) is None


def test_sentences_differ_when_more_than_a_tenth_of_their_tags_do() -> None:
    assert agree(["NN"] * 10, ["NN"] * 9 + ["JJ"])
    assert not agree(["NN"] * 9, ["NN"] * 8 + ["JJ"])
    assert not agree(["NN"] * 9, ["NN"] * 10)


def test_rare_roles_are_left_out() -> None:
    assert frequent_roles([EXAMPLE] * 3, 3) == {"ARG0", "ARG1"}
    assert with_roles([EXAMPLE], {"ARG0"})[0].frames == (Frame(4, (Argument("ARG0", 0, 1),)),)


def test_what_is_trained_reads_like_minilm_with_its_updates() -> None:
    bundle = find_encoder("minilm")
    words = WordStates(bundle, (0, 3, 6))
    batch = token_batch([encode(Example(w, ()), words, ["O"]).tokens for w in (EXAMPLE.words, ("a", *EXAMPLE.words))])
    adapted = AdaptedMiniLM(bundle, 2).eval()
    torch.manual_seed(0)
    for up in adapted.up.values():
        torch.nn.init.normal_(up, std=0.05)
    states = adapted(batch, (0, 3, 6))[0, : len(EXAMPLE.words)]
    ids, weights = words.tokens(EXAMPLE.words)
    hidden = MiniLM(bundle, updates=adapted.updates()).states(ids)
    exact = torch.stack([torch.as_tensor(weights) @ hidden[layer] for layer in (0, 3, 6)], 1)
    assert torch.cosine_similarity(states, exact, dim=-1).min() > 0.99  # bfloat16
    assert torch.cosine_similarity(states[:, 1:], words(EXAMPLE.words)[:, 1:], dim=-1).max() < 0.98


def test_smoothing_brings_int8_closer_to_minilm() -> None:
    bundle = find_encoder("minilm")
    words = WordStates(bundle, (6,))
    seen = token_batch([encode(Example(EXAMPLE.words, ()), words, ["O"]).tokens])
    smooth = AdaptedMiniLM(bundle, 1).updates([seen])
    ids = words.tokens(("a", "woman", "waves", "at", "the", "old", "man"))[0]
    exact = MiniLM(bundle).states(ids)[6]
    plain, smoothed = (MiniLM(bundle, int8=True, updates=each).states(ids)[6] for each in (None, smooth))
    near = torch.nn.functional.cosine_similarity
    assert near(smoothed, exact).mean() > near(plain, exact).mean()


@pytest.mark.slow
def test_the_first_training_is_kept_and_shipped_whole(tmp_path: Path) -> None:
    minilm = find_encoder("minilm")
    network = LightConfig(tag_set(roles_of([EXAMPLE])), layers=(3, 6), width=48, heads=4, trunk=1, body=1)
    config = FitConfig(steps=40, batch=4, learning_rate=4e-3, rank=2, average=0.5)
    losses: list[float] = []
    words = WordStates(minilm, network.layers)
    batches = propbank_batches([EXAMPLE] * 4, [], words, network.tags, 4, 0)
    first = fit(batches, minilm, network, config, 0, progress=lambda _, loss: losses.append(loss))
    assert losses[-1] < 0.3 * losses[0]
    assert first.updates["encoder.layer.3.output.dense.up"].abs().max() > 0

    first.save(tmp_path / "first.safetensors")
    again = Weights.load(tmp_path / "first.safetensors")
    assert again.network == network
    said = first.labeller(minilm).label([EXAMPLE.words])
    assert said == again.labeller(minilm).label([EXAMPLE.words]) == [EXAMPLE.frames]

    pool = SentencePool(variants=0)
    recipe = Recipe(minilm, network, FitConfig(steps=2, batch=4), pool, 0, [EXAMPLE], again)
    (tmp_path / "own.txt").write_text("")
    bundle = pack(tmp_path / "tiny", recipe.make([EXAMPLE]), [tmp_path / "own.txt"], recipe, None)
    assert LightLabeller.load(Bundle.open(bundle.path)).label([EXAMPLE.words]) == [EXAMPLE.frames]
    assert bundle.manifest.licence == "CC-BY-SA-4.0"
    assert bundle.manifest.commercial
    assert any("propbank" in source.name for source in bundle.manifest.data)


def test_another_file_holds_no_weights(tmp_path: Path) -> None:
    file = tmp_path / "first.safetensors"
    file.write_bytes(b"nothing of the kind")
    with pytest.raises(InvalidFile):
        Weights.load(file)
