"""Bundles: what is written is read back, and whatever was tampered with is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from marey.bundles import Bundle, BundleWriter, find_bundle, list_bundles
from marey.core.errors import Conflict, InvalidBundle, InvalidInput, NotFound, Refused
from marey.core.settings import Settings


def write(path: Path, *, licence: str = "MIT", max_shard_bytes: int = 2**20, overwrite: bool = False) -> Bundle:
    generator = np.random.default_rng(0)
    tensors = {f"layer{i}": generator.standard_normal((16, 32)).astype(np.float32) for i in range(6)}
    with BundleWriter(path, max_shard_bytes=max_shard_bytes, overwrite=overwrite) as writer:
        writer.add_part("masked", {**tensors, "ids": np.arange(4)})
        writer.add_statistics(np.zeros(3, np.float32), np.ones(3, np.float32))
        return writer.finish(
            name=path.name, version="1", kind="generator", model="hgm3", config="tiny", parameters={}, licence=licence
        )


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    return Settings(models=tmp_path / "models", home=tmp_path / "home")


def test_a_bundle_is_read_back_in_half_precision_and_with_its_integers(tmp_path: Path) -> None:
    write(tmp_path / "b")
    tensors = Bundle.open(tmp_path / "b").tensors("masked")
    expected = np.random.default_rng(0).standard_normal((16, 32)).astype(np.float16)
    np.testing.assert_array_equal(tensors["layer0"], expected.astype(np.float32))
    np.testing.assert_array_equal(tensors["ids"], np.arange(4))


def test_large_parts_are_cut_into_shards_under_the_limit_and_joined_on_loading(tmp_path: Path) -> None:
    bundle = write(tmp_path / "b", max_shard_bytes=2500)
    shards = bundle.manifest.parts["masked"]
    assert len(shards) > 1
    assert set(Bundle.open(tmp_path / "b").tensors("masked")) == {f"layer{i}" for i in range(6)} | {"ids"}


def test_a_changed_byte_is_refused_and_names_the_file(tmp_path: Path) -> None:
    write(tmp_path / "b")
    file = tmp_path / "b" / "masked.safetensors"
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    with pytest.raises(InvalidBundle, match=r"masked\.safetensors: its sha256 differs"):
        Bundle.open(tmp_path / "b")


def test_truncated_weights_are_refused_even_without_hashing(tmp_path: Path) -> None:
    write(tmp_path / "b")
    file = tmp_path / "b" / "masked.safetensors"
    file.write_bytes(file.read_bytes()[:-10])
    with pytest.raises(InvalidBundle, match="truncated"):
        Bundle.open(tmp_path / "b", verify=False)


@pytest.mark.parametrize("name", ["../evil.safetensors", "/etc/passwd", "a/b.safetensors", "weights.pkl"])
def test_a_manifest_that_names_foreign_files_is_refused(tmp_path: Path, name: str) -> None:
    write(tmp_path / "b")
    path = tmp_path / "b" / "manifest.json"
    manifest = json.loads(path.read_text())
    manifest["files"][name] = {"sha256": "0" * 64, "bytes": 1}
    path.write_text(json.dumps(manifest))
    with pytest.raises(InvalidBundle, match="not a manifest this version reads"):
        Bundle.open(tmp_path / "b")


def test_a_folder_without_manifest_is_not_a_bundle(tmp_path: Path) -> None:
    with pytest.raises(InvalidBundle, match="not a model bundle"):
        Bundle.open(tmp_path)


def test_an_unknown_name_lists_the_known_ones(config: Settings) -> None:
    write(config.models / "known")
    with pytest.raises(NotFound, match="Known here: known"):
        find_bundle("unknown", config=config)


def test_an_exact_reference_finds_only_these_weights(config: Settings) -> None:
    bundle = write(config.models / "b")
    assert find_bundle(bundle.reference, config=config).weights_sha256 == bundle.weights_sha256
    with pytest.raises(InvalidBundle, match="was replaced"):
        find_bundle("b@000000000000", config=config)


def test_non_commercial_weights_are_refused_where_commercial_terms_are_required(config: Settings) -> None:
    write(config.models / "nc", licence="CC-BY-NC-4.0")
    assert find_bundle("nc", config=config).manifest.licence == "CC-BY-NC-4.0"
    with pytest.raises(Refused, match="does not allow commercial use"):
        find_bundle("nc", config=config.model_copy(update={"require_licence": "commercial"}))


def test_a_bundle_is_replaced_only_when_asked_and_nothing_half_written_stays(tmp_path: Path) -> None:
    write(tmp_path / "b")
    with pytest.raises(Conflict):
        write(tmp_path / "b")
    write(tmp_path / "b", licence="CC0-1.0", overwrite=True)
    assert Bundle.open(tmp_path / "b").manifest.licence == "CC0-1.0"
    with pytest.raises(InvalidInput, match="not finite"), BundleWriter(tmp_path / "c") as writer:
        writer.add_part("masked", {"w": np.array([1e9], np.float32)})
    assert [p.name for p in tmp_path.iterdir()] == ["b"]


def test_bundles_are_listed_by_kind(config: Settings) -> None:
    write(config.models / "one")
    write(config.home / "models" / "two")
    assert [b.manifest.name for b in list_bundles(config=config, kind="generator")] == ["one", "two"]
    assert list(list_bundles(config=config, kind="labeller")) == []


def test_json_beside_the_weights_is_read_back_hashed_and_part_of_the_reference(tmp_path: Path) -> None:
    references = []
    for name, word in (("one", "wave"), ("two", "bow")):
        with BundleWriter(tmp_path / name) as writer:
            writer.add_part("motion", {"w": np.zeros(2, np.float32)})
            writer.add_json("words.json", [word, "é"])
            writer.finish(
                name="b", version="1", kind="evaluator", model="t2m", config="tiny", parameters={}, licence="MIT"
            )
        bundle = Bundle.open(tmp_path / name)
        assert bundle.read_json("words.json") == [word, "é"]
        references.append(bundle.reference)
    assert references[0] != references[1]
    (tmp_path / "one" / "words.json").write_text("[]", encoding="utf-8")
    with pytest.raises(InvalidBundle, match=r"words\.json: has 2 bytes"):
        Bundle.open(tmp_path / "one")


def test_json_that_is_not_there_or_would_be_the_manifest_is_refused(tmp_path: Path) -> None:
    bundle = write(tmp_path / "b")
    with pytest.raises(InvalidBundle, match=r"has no file 'reference\.json'"):
        bundle.read_json("reference.json")
    with pytest.raises(InvalidInput, match="manifest"), BundleWriter(tmp_path / "c") as writer:
        writer.add_json("manifest.json", {})
