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
from marey.core.errors import InvalidBundle, InvalidFile
from marey.text.bert_srl import BertLabeller
from marey.text.convert import convert_encoder, import_bert_srl, main
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
    with pytest.raises(InvalidFile, match="safely"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")
    assert not (tmp_path / "srl-bert").exists()


def test_an_archive_without_labels_is_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    (archive / "vocabulary" / "labels.txt").unlink()
    with pytest.raises(InvalidFile, match=r"labels\.txt"):
        import_bert_srl(archive, bert, tmp_path / "srl-bert")


def test_labels_that_do_not_fit_the_weights_are_refused(archive: Path, bert: Path, tmp_path: Path) -> None:
    (archive / "vocabulary" / "labels.txt").write_text("O\nB-V\n")
    bundle = import_bert_srl(archive, bert, tmp_path / "srl-bert")
    with pytest.raises(InvalidBundle, match="do not fit"):
        BertLabeller(bundle, Second())


def test_the_command_imports_and_names_a_broken_file(
    archive: Path, bert: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / "srl-bert"
    assert main(["bert-srl", str(archive), "--bert", str(bert), "-o", str(output)]) == 0
    assert (output / "manifest.json").is_file()
    (tmp_path / "junk.tar.gz").write_bytes(b"junk")
    assert main(["bert-srl", str(tmp_path / "junk.tar.gz"), "--bert", str(bert), "-o", str(output)]) == 2
    assert "junk.tar.gz" in capsys.readouterr().err


def test_pickled_encoder_weights_become_safetensors(tmp_path: Path) -> None:
    from safetensors.torch import load_file

    torch.save({"weight": torch.arange(6.0).view(2, 3)}, tmp_path / "pytorch_model.bin")
    assert torch.equal(load_file(convert_encoder(tmp_path))["weight"], torch.arange(6.0).view(2, 3))


def test_pieces_are_those_of_allennlp_s_reader() -> None:
    pieces = WordPieces(VOCABULARY, lowercase=True)
    ids, starts, owners = pieces.encode([*WORDS, "zzz"])
    assert [VOCABULARY[i] for i in ids] == ["[CLS]", "a", "person", "walk", "##s", "forward", "##.", "[UNK]", "[SEP]"]
    assert starts == [1, 2, 3, 5, 7]
    assert owners == [-1, 0, 1, 2, 2, 3, 3, 4, -1]
