"""Text encoders from folders as the models' hub has them: the right one, whole, and installed once."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors.torch import load_file, save_file

from marey.bundles import Bundle, TextSpec
from marey.core.errors import Conflict, InvalidFile, MareyError, NotFound
from marey.importing import ImportRequest, text_encoder_of
from marey.importing.encoder_files import write_encoder
from marey.text.encoders import find_weights, weights_sha256
from marey.text.loading import load_encoder
from marey.text.pipeline import TextPipeline
from tests.support.tiny_encoders import write_tiny_clip, write_tiny_distilbert, write_tiny_t5

TEXT = "a person walks and waves"
DISTILBERT = "distilbert-base-uncased"


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("hub")
    for name in ("clip-vit-b32", "t5-base", "t5-v1_1-base"):
        (root / name).mkdir()
    write_tiny_clip(root / "clip-vit-b32")
    for name in ("t5-base", "t5-v1_1-base"):
        write_tiny_t5(name, root / name)
    (root / DISTILBERT).mkdir()
    write_tiny_distilbert(root / DISTILBERT)
    return {path.name: path for path in root.iterdir()}


def pickled(folder: Path, target: Path) -> Path:
    """A copy with `pytorch_model.bin`, with tensors of towers that are not read."""
    shutil.copytree(folder, target)
    weights = load_file(target / "model.safetensors")
    (target / "model.safetensors").unlink()
    if "vocab_transform.weight" in weights:  # DistilBERT's head is a part of the published file
        torch.save(weights, target / "pytorch_model.bin")
        return target
    clip = "text_projection.weight" in weights
    more = {"vision_model.x": torch.ones(2)} if clip else {"decoder.block.0.x": torch.ones(2), "lm_head.weight": None}
    if clip:
        more["text_model.embeddings.position_ids"] = torch.arange(77)[None]
    else:
        more["lm_head.weight"] = weights["shared.weight"]
        more["encoder.embed_tokens.weight"] = weights["shared.weight"]
    torch.save({**weights, **more}, target / "pytorch_model.bin")
    return target


def change_weights(folder: Path, target: Path, change: Callable[[dict[str, torch.Tensor]], None]) -> Path:
    shutil.copytree(folder, target)
    weights = load_file(target / "model.safetensors")
    change(weights)
    save_file(weights, target / "model.safetensors", metadata={"format": "pt"})
    return target


@pytest.mark.parametrize("name", ["clip-vit-b32", "t5-base", "t5-v1_1-base", DISTILBERT])
def test_an_imported_encoder_is_the_published_one_and_a_bundle(
    folders: dict[str, Path], models: Path, name: str
) -> None:
    write_encoder(name, folders[name], models / name)
    bundle = Bundle.open(models / name)
    assert (bundle.manifest.kind, bundle.manifest.model) == ("encoder", name)
    assert find_weights(name) == models / name
    assert weights_sha256(models / name) == weights_sha256(folders[name])
    mine, theirs = load_encoder(name).encode(TEXT), load_encoder(name, folders[name]).encode(TEXT)
    np.testing.assert_array_equal(mine.tokens, theirs.tokens)
    with pytest.raises(Conflict):
        write_encoder(name, folders[name], models / name)


@pytest.mark.parametrize("name", ["clip-vit-b32", "t5-v1_1-base", DISTILBERT])
def test_pickled_weights_are_converted_without_the_other_towers(
    folders: dict[str, Path], models: Path, tmp_path: Path, name: str
) -> None:
    write_encoder(name, pickled(folders[name], tmp_path / "bin"), models / name)
    stored = Bundle.open(models / name).tensors("encoder")
    assert not [key for key in stored if key.startswith(("vision_model", "decoder", "lm_head", "vocab_"))]
    mine, theirs = load_encoder(name).encode(TEXT), load_encoder(name, folders[name]).encode(TEXT)
    np.testing.assert_allclose(mine.tokens, theirs.tokens, atol=1e-5)


def claim(folder: Path, target: Path, **fields: object) -> Path:
    """A copy whose configuration says something else."""
    shutil.copytree(folder, target)
    config = json.loads((target / "config.json").read_text(encoding="utf-8"))
    (target / "config.json").write_text(json.dumps({**config, **fields}), encoding="utf-8")
    return target


def keep_case(folder: Path, target: Path) -> Path:
    """A copy whose tokenizer tells upper case from lower case."""
    shutil.copytree(folder, target)
    content = json.loads((target / "tokenizer.json").read_text(encoding="utf-8"))
    content["normalizer"]["lowercase"] = False
    (target / "tokenizer.json").write_text(json.dumps(content), encoding="utf-8")
    return target


def narrow(weights: dict[str, torch.Tensor]) -> None:
    weights["shared.weight"] = weights["shared.weight"][:, :512].contiguous()


def poison(weights: dict[str, torch.Tensor]) -> None:
    weights["shared.weight"][5, 5] = torch.nan


def drop_layer(weights: dict[str, torch.Tensor]) -> None:
    for key in [key for key in weights if ".block.1." in key]:
        del weights[key]


def test_other_models_versions_and_widths_are_refused(folders: dict[str, Path], models: Path, tmp_path: Path) -> None:
    t5, old, clip = folders["t5-v1_1-base"], folders["t5-base"], folders["clip-vit-b32"]
    bert = folders[DISTILBERT]
    cases: list[tuple[str, Path, type[MareyError], str]] = [
        ("t5-v1_1-base", old, InvalidFile, "its feed-forward is 'relu', not 'gated-gelu'"),
        ("t5-base", t5, InvalidFile, "its feed-forward is 'gated-gelu'"),
        ("clip-vit-b32", t5, InvalidFile, "is not the text tower of CLIP"),
        ("t5-base", clip, InvalidFile, "is not T5 of width 768"),
        (
            "t5-v1_1-base", claim(old, tmp_path / "claimed", feed_forward_proj="gated-gelu"), InvalidFile,
            r"is not t5-v1_1-base: lacks encoder\.block\.0\.layer\.1\.DenseReluDense\.wi_0\.weight",
        ),
        ("t5-v1_1-base", claim(t5, tmp_path / "wide", d_model=1024), InvalidFile, "is not T5 of width 768"),
        ("t5-v1_1-base", change_weights(t5, tmp_path / "narrow", narrow), InvalidFile, "not 768 columns"),
        ("t5-v1_1-base", change_weights(t5, tmp_path / "nan", poison), InvalidFile, "shared.weight holds NaN"),
        ("t5-v1_1-base", change_weights(t5, tmp_path / "one", drop_layer), InvalidFile, "has 1 layers, and its"),
        ("t5-v1_1-base", tmp_path / "nowhere", NotFound, "no such folder"),
        (DISTILBERT, t5, InvalidFile, "is not DistilBERT of width 768"),
        ("t5-base", bert, InvalidFile, "is not T5 of width 768"),
        (DISTILBERT, claim(bert, tmp_path / "wider", dim=1024), InvalidFile, "is not DistilBERT of width 768"),
        (
            DISTILBERT, claim(bert, tmp_path / "tuned", architectures=["DistilBertForSequenceClassification"]),
            InvalidFile, "its weights are those of .*ForSequenceClassification",
        ),
        (DISTILBERT, keep_case(bert, tmp_path / "cased"), InvalidFile, "its tokenizer keeps upper case"),
        (DISTILBERT, claim(bert, tmp_path / "deep", n_layers=6), InvalidFile, "has 2 layers, and its config"),
    ]  # fmt: skip
    for name, folder, kind, said in cases:
        with pytest.raises(kind, match=said) as caught:
            write_encoder(name, folder, models / name)
        assert caught.value.where, said
        assert not models.exists() or not list(models.iterdir()), said


def test_the_hint_names_the_encoder_that_the_weights_are_of(
    folders: dict[str, Path], models: Path, tmp_path: Path
) -> None:
    claimed = claim(folders["t5-base"], tmp_path / "claimed", feed_forward_proj="gated-gelu")
    with pytest.raises(InvalidFile) as caught:
        write_encoder("t5-v1_1-base", claimed, models / "t5-v1_1-base")
    assert "google-t5/t5-base" in str(caught.value.hint)


@pytest.mark.parametrize("change", ["truncated", "no weights", "no tokenizer", "pickled code"])
def test_broken_and_incomplete_folders_are_refused_and_leave_nothing(
    folders: dict[str, Path], models: Path, tmp_path: Path, change: str
) -> None:
    broken = tmp_path / "broken"
    shutil.copytree(folders["t5-v1_1-base"], broken)
    weights = broken / "model.safetensors"
    if change == "truncated":
        weights.write_bytes(weights.read_bytes()[:5000])
    elif change == "no tokenizer":
        for file in broken.glob("tokenizer*"):
            file.unlink()
    else:
        weights.unlink()
    if change == "pickled code":
        torch.save(torch.nn.Linear(2, 2), broken / "pytorch_model.bin")
    said = {
        "truncated": "cannot be read",
        "no weights": r"there is no model\.safetensors or pytorch_model\.bin",
        "no tokenizer": r"there is no tokenizer\.json, spiece\.model or vocab\.json with merges\.txt",
        "pickled code": "holds code or objects of Python",
    }[change]
    with pytest.raises((InvalidFile, NotFound), match=said) as caught:
        write_encoder("t5-v1_1-base", broken, models / "t5-v1_1-base")
    assert caught.value.where
    assert caught.value.hint
    assert not models.exists() or not list(models.iterdir())


def test_vocabularies_in_their_first_formats_are_converted(
    folders: dict[str, Path], models: Path, tmp_path: Path
) -> None:
    t5, clip = tmp_path / "t5", tmp_path / "clip"
    shutil.copytree(folders["t5-v1_1-base"], t5)
    shutil.copytree(folders["clip-vit-b32"], clip)
    pieces = json.loads((t5 / "tokenizer.json").read_text(encoding="utf-8"))["model"]["vocab"]
    for folder in (t5, clip):
        (folder / "tokenizer.json").unlink()
    write_sentencepiece(t5 / "spiece.model", pieces)
    for name, folder in (("t5-v1_1-base", t5), ("clip-vit-b32", clip)):
        write_encoder(name, folder, models / name)
        mine, theirs = load_encoder(name).encode(TEXT), load_encoder(name, folders[name]).encode(TEXT)
        np.testing.assert_allclose(mine.tokens, theirs.tokens, atol=1e-6)


def write_sentencepiece(file: Path, pieces: list[list]) -> None:
    from transformers.utils import sentencepiece_model_pb2_new as format

    model = format.ModelProto()
    kinds = {"<unk>": 2, "<pad>": 3, "</s>": 3}
    for piece, score in pieces:
        model.pieces.add(piece=piece, score=score, type=kinds.get(piece, 1))
    model.trainer_spec.model_type = 1
    model.trainer_spec.unk_id, model.trainer_spec.eos_id, model.trainer_spec.pad_id = 2, 1, 0
    model.trainer_spec.bos_id = -1
    file.write_bytes(model.SerializeToString())


# -- the encoder that other weights were trained with ------------------------------------------------------------------


def request(models: Path, encoder: Path | None) -> ImportRequest:
    return ImportRequest("kind", models, models / "generator", "MIT", encoder)


def test_a_named_encoder_is_installed_beside_the_bundle(folders: dict[str, Path], models: Path) -> None:
    with text_encoder_of(request(models, folders["clip-vit-b32"]), "clip-vit-b32") as text:
        assert not (models / "clip-vit-b32").exists()
    assert isinstance(text, TextSpec)
    assert (text.encoder, text.width, text.labeller) == ("clip-vit-b32", 512, "none")
    assert sorted(path.name for path in models.iterdir()) == ["clip-vit-b32"]
    assert TextPipeline.load(text).spec.encoder_sha256 == text.encoder_sha256
    with text_encoder_of(request(models, None), "clip-vit-b32") as again:
        assert again == text
    with text_encoder_of(request(models, folders["clip-vit-b32"]), "clip-vit-b32") as again:
        assert again == text


def test_an_encoder_is_not_installed_where_the_import_fails(folders: dict[str, Path], models: Path) -> None:
    with pytest.raises(InvalidFile), text_encoder_of(request(models, folders["clip-vit-b32"]), "clip-vit-b32"):
        raise InvalidFile("the weights are broken")
    assert not list(models.iterdir())


def test_an_installed_encoder_is_not_replaced_by_another_one(
    folders: dict[str, Path], models: Path, tmp_path: Path
) -> None:
    def scale(weights: dict[str, torch.Tensor]) -> None:
        weights["text_projection.weight"] *= 2

    other = change_weights(folders["clip-vit-b32"], tmp_path / "other", scale)
    write_encoder("clip-vit-b32", folders["clip-vit-b32"], models / "clip-vit-b32")
    with (
        pytest.raises(Conflict, match="another version of clip-vit-b32 is installed"),
        text_encoder_of(request(models, other), "clip-vit-b32"),
    ):
        pass
    assert [path.name for path in models.iterdir()] == ["clip-vit-b32"]


def test_an_encoder_that_is_neither_named_nor_installed_is_asked_for(models: Path) -> None:
    with pytest.raises(NotFound) as caught, text_encoder_of(request(models, None), "clip-vit-b32"):
        pass
    assert "--text-encoder" in str(caught.value.hint)
    assert "openai/clip-vit-base-patch32" in str(caught.value.hint)
