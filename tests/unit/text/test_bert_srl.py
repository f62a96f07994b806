"""The AllenNLP adapter on a tiny random BERT saved in the archive's layout."""

from __future__ import annotations

import itertools
import json
import pickle
import tarfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import Conflict, InvalidFile, InvalidInput, NotFound
from marey.importing import ImportRequest, run_import
from marey.importing.allennlp import import_allennlp
from marey.text.bert_srl import BertLabeller
from marey.text.roles import Frame
from marey.text.wordpiece import WordPieces

if TYPE_CHECKING:
    from transformers import BertModel

LABELS = ["O", "B-V", "B-ARG0", "I-ARG0", "B-ARGM-DIR", "I-ARGM-DIR"]
VOCABULARY = ["[PAD]", "[UNK]", "[CLS]", "[SEP]", "a", "person", "walk", "##s", "forward", "##.", "slowly"]
WORDS = ["A", "person", "walks", "forward."]


class Second:
    """Finds one predicate, the third word."""

    def predicates(self, words: object) -> list[int]:
        return [2]


@pytest.fixture
def bert(tmp_path: Path) -> Path:
    """The folder of a tiny BERT: its configuration and vocabulary."""
    from transformers import BertConfig  # two seconds, which only the process that runs these tests spends

    folder = tmp_path / "bert"
    folder.mkdir()
    config = BertConfig(
        vocab_size=len(VOCABULARY), hidden_size=32, num_hidden_layers=2, num_attention_heads=2, intermediate_size=64,
        max_position_embeddings=64,
    )  # fmt: skip
    (folder / "config.json").write_text(json.dumps(config.to_dict()))
    (folder / "vocab.txt").write_text("\n".join(VOCABULARY) + "\n")
    return folder


def import_bert_srl(archive: Path, bert: Path | None, output: Path) -> Bundle:
    return import_allennlp(ImportRequest("allennlp-srl", archive, output, "Apache-2.0", bert))


def bert_of(folder: Path) -> BertModel:
    """A BERT of random weights with the configuration of a folder."""
    from transformers import BertConfig, BertModel

    return BertModel(BertConfig(**json.loads((folder / "config.json").read_text())))


@pytest.fixture
def archive(bert: Path, tmp_path: Path) -> Path:
    """An unpacked archive: config.json, weights.th, vocabulary/labels.txt."""
    folder = tmp_path / "archive"
    (folder / "vocabulary").mkdir(parents=True)
    torch.manual_seed(1)
    model = bert_of(bert)
    weights = {f"bert_model.{name}": value for name, value in model.state_dict().items()}
    weights["bert_model.embeddings.position_ids"] = torch.arange(64)[None]  # old checkpoints carry this buffer
    weights["tag_projection_layer.weight"] = torch.randn(len(LABELS), 32)
    weights["tag_projection_layer.bias"] = torch.randn(len(LABELS))
    torch.save(weights, folder / "weights.th")
    (folder / "vocabulary" / "labels.txt").write_text("\n".join(LABELS) + "\n")
    reader = {"type": "srl", "bert_model_name": "bert-base-uncased"}
    (folder / "config.json").write_text(json.dumps({"dataset_reader": reader, "model": {"type": "srl_bert"}}))
    return folder


def tarred(folder: Path) -> Path:
    path = folder.with_suffix(".tar.gz")
    with tarfile.open(path, "w:gz") as tar:
        for name in ("config.json", "weights.th", "vocabulary"):
            tar.add(folder / name, name)
    return path


def reference_frame(archive: Path, bert: Path) -> Frame:
    """Result of the archive's own forward pass for WORDS, written out by hand: probabilities, best legal path by
    force."""
    weights = torch.load(archive / "weights.th", weights_only=True)
    model = bert_of(bert).eval()
    model.load_state_dict(
        {
            k.removeprefix("bert_model."): v
            for k, v in weights.items()
            if k.startswith("bert_model.") and "_ids" not in k
        }
    )
    ids = [VOCABULARY.index(t) for t in ("[CLS]", "a", "person", "walk", "##s", "forward", "##.", "[SEP]")]
    marks = torch.tensor([[0, 0, 0, 1, 1, 0, 0, 0]])
    with torch.inference_mode():
        hidden = model(input_ids=torch.tensor([ids]), token_type_ids=marks).last_hidden_state[0]
        logits = hidden @ weights["tag_projection_layer.weight"].T + weights["tag_projection_layer.bias"]
        probabilities = logits.softmax(-1)

    tags = ["O", *LABELS]
    allowed = np.array([[not b.startswith("I-") or a[1:] == b[1:] for b in LABELS] for a in tags])
    paths = np.indices((len(LABELS),) * len(ids), dtype=np.int8).reshape(len(ids), -1)
    legal = allowed[0][paths[0]]
    for before, after in itertools.pairwise(paths):
        legal &= allowed[1 + before, after]
    scores = sum(row[tag] for row, tag in zip(probabilities.double().numpy(), paths, strict=True))
    best = paths[:, np.where(legal, scores, -1.0).argmax()]
    from marey.text.roles import spans_to_arguments

    tags = [LABELS[best[i]] for i in (1, 2, 3, 5)]
    return Frame(2, tuple(a for a in spans_to_arguments(tags) if 2 not in a.words))


def test_an_imported_archive_labels_as_the_archive_does(archive: Path, bert: Path, tmp_path: Path) -> None:
    bundle = import_bert_srl(tarred(archive), bert, tmp_path / "srl-bert")
    labeller = BertLabeller(Bundle.open(bundle.path), Second())
    assert labeller.label([WORDS]) == [(reference_frame(archive, bert),)]


def test_a_folder_imports_like_its_tar(archive: Path, bert: Path, tmp_path: Path) -> None:
    one = import_bert_srl(archive, bert, tmp_path / "one")
    two = import_bert_srl(tarred(archive), bert, tmp_path / "two")
    assert one.weights_sha256 == two.weights_sha256


def test_text_past_bert_s_positions_has_no_role(archive: Path, bert: Path, tmp_path: Path) -> None:
    bundle = import_bert_srl(archive, bert, tmp_path / "srl-bert")
    (frames,) = BertLabeller(bundle, Second()).label([[*WORDS, *["slowly"] * 100]])
    assert all(a.stop <= 64 for f in frames for a in f.arguments)


def test_pickle_that_is_no_tensors_is_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    (archive / "weights.th").write_bytes(pickle.dumps({"a": Path("x")}, protocol=2))
    with pytest.raises(InvalidFile, match=r"holds code or objects of Python|cannot be read"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    assert not (tmp_path / "srl-bert").exists()


def test_an_archive_without_labels_is_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    (archive / "vocabulary" / "labels.txt").unlink()
    with pytest.raises(NotFound, match=r"labels\.txt"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")


def test_labels_that_do_not_fit_the_weights_are_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    (archive / "vocabulary" / "labels.txt").write_text("O\nB-V\n")
    with pytest.raises(InvalidFile, match=r"tag_projection_layer\.weight has shape \(6, 32\), not \(2, 32\)"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    assert not (tmp_path / "srl-bert").exists()


def test_weights_of_another_bert_or_with_foreign_tensors_are_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    weights = torch.load(archive / "weights.th", weights_only=True)
    torch.save({**weights, "crf.transitions": torch.ones(2)}, archive / "weights.th")
    with pytest.raises(InvalidFile, match=r"does not know: crf\.transitions"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    weights["bert_model.embeddings.word_embeddings.weight"][0, 0] = torch.nan
    torch.save(weights, archive / "weights.th")
    with pytest.raises(InvalidFile, match="NaN"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    (bert / "vocab.txt").write_text("a\nb\n")
    with pytest.raises(InvalidFile, match=r"vocab\.txt: has 2 lines, and its config\.json names 11"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    with pytest.raises(InvalidInput, match="only names its BERT"):
        import_bert_srl(archive, None, tmp_path / "srl-bert")


def test_the_kind_imports_once_and_names_a_broken_archive(archive: Path, bert: Path, tmp_path: Path) -> None:
    output = tmp_path / "srl-bert"
    made = run_import("allennlp-srl", archive, output, text_encoder=bert)
    assert made.manifest.licence == "Apache-2.0"
    with pytest.raises(Conflict, match="already exists"):
        run_import("allennlp-srl", archive, output, text_encoder=bert)
    (tmp_path / "junk.tar.gz").write_bytes(b"junk")
    with pytest.raises(InvalidFile, match=r"junk\.tar\.gz: is not a readable archive"):
        run_import("allennlp-srl", tmp_path / "junk.tar.gz", output, text_encoder=bert, overwrite=True)
    assert Bundle.open(output).weights_sha256 == made.weights_sha256


def test_pieces_are_those_of_allennlp_s_reader() -> None:
    pieces = WordPieces(VOCABULARY, lowercase=True)
    ids, starts, owners = pieces.encode([*WORDS, "zzz"])
    assert [VOCABULARY[i] for i in ids] == ["[CLS]", "a", "person", "walk", "##s", "forward", "##.", "[UNK]", "[SEP]"]
    assert starts == [1, 2, 3, 5, 7]
    assert owners == [-1, 0, 1, 2, 2, 3, 3, 4, -1]
