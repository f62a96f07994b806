"""Coverage of a bundle's hash: the files alone in format 1, all that changes behaviour in format 2."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import save

from marey.bundles import Bundle, BundleWriter, DataSource, TextSpec
from marey.bundles.manifest import DESCRIPTIVE, BundleManifest, parse_manifest
from marey.core.errors import InvalidBundle, MareyError
from marey.text.keys import PIPELINE_VERSION, feature_key
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import ActionLists
from tests.support.marey import REPOSITORY
from tests.support.models import GENERATORS

SHIPPED = {
    "evaluator-starter": "54df3f67fce4",
    "minilm-l6": "71b2f824e524",
    "srl-light": "2728a1a195b0",
    "srl-open": "fb336c22b109",
}
"""Those of models are recorded with the models (`tests/contracts`)."""
MANIFESTS = sorted(REPOSITORY.glob("models/*/manifest.json"))


def write(path: Path, **fields: Any) -> Bundle:
    with BundleWriter(path, overwrite=True) as writer:
        writer.add_part("masked", {"w": np.arange(8, dtype=np.float32)})
        writer.add_part("length", {"w": np.ones(2, np.float32)})
        return writer.finish(**{
            "name": "b", "version": "1", "kind": "generator", "model": "hgm3", "config": "tiny", "licence": "MIT",
            "fps": 20, "parameters": {"inference": {"guidance": 4.0}}, "text": TextSpec(), **fields,
        })  # fmt: skip


CHANGES: dict[str, tuple[str, Any]] = {
    "kind": ("kind", "evaluator"),
    "model": ("model", "stroller"),
    "config": ("config", "paper"),
    "a parameter": ("parameters", {"inference": {"guidance": 5.0}}),
    "random": ("random", True),
    "skeleton": ("skeleton", "kit"),
    "offsets": ("offsets", ((0.0, 1.0, 0.0),)),
    "layout": ("layout", "kit-251"),
    "fps": ("fps", 30),
    "text": ("text", TextSpec(in_order=True)),
    "data": ("data", (DataSource(name="d", licence="MIT", credit="c"),)),
    "licence": ("licence", "CC-BY-NC-4.0"),
}
DESCRIBING: dict[str, Any] = {
    "name": "c",
    "version": "2",
    "metrics": {"fid": 1.0},
    "training": {"commit": "0"},
    "actions": ActionLists(("walk",)),
}


@pytest.mark.parametrize("change", CHANGES)
def test_format_2_hashes_what_changes_behaviour(tmp_path: Path, change: str) -> None:
    before = write(tmp_path / "b").weights_sha256
    name, value = CHANGES[change]
    assert write(tmp_path / "b", **{name: value}).weights_sha256 != before


@pytest.mark.parametrize("name", sorted(DESCRIBING))
def test_format_2_leaves_out_what_describes(tmp_path: Path, name: str) -> None:
    before = write(tmp_path / "b").weights_sha256
    assert write(tmp_path / "b", **{name: DESCRIBING[name]}).weights_sha256 == before


def test_every_field_of_a_manifest_is_hashed_or_said_to_describe() -> None:
    """A new field has to be thought of here."""
    covered = {name for name, _ in CHANGES.values()} | {"format", "files", "parts"}
    assert covered | set(DESCRIBING) == set(BundleManifest.model_fields)
    assert set(DESCRIBING) == set(DESCRIPTIVE)


def test_format_2_hashes_the_order_of_shards(tmp_path: Path) -> None:
    before = write(tmp_path / "b")
    edit(tmp_path / "b", lambda m: m["parts"].update(masked=m["parts"]["length"], length=m["parts"]["masked"]))
    assert Bundle.open(tmp_path / "b").weights_sha256 != before.weights_sha256


def test_format_2_of_a_file_is_that_of_its_writer_and_a_later_field_leaves_it(tmp_path: Path) -> None:
    made = write(tmp_path / "b")
    assert made.manifest.format == 2
    assert Bundle.open(tmp_path / "b").weights_sha256 == made.weights_sha256
    edit(tmp_path / "b", lambda m: m.pop("layout"))  # as a version without this field would have written it
    assert Bundle.open(tmp_path / "b").weights_sha256 != made.weights_sha256


def test_format_1_hashes_the_files_alone_as_it_always_did(tmp_path: Path) -> None:
    bundle = write(tmp_path / "b", format=1)
    lines = "\n".join(f"{name} {bundle.manifest.files[name].sha256}" for name in sorted(bundle.manifest.files))
    assert bundle.weights_sha256 == hashlib.sha256(lines.encode()).hexdigest()
    for name, value in CHANGES.values():
        assert write(tmp_path / "b", format=1, **{name: value}).weights_sha256 == bundle.weights_sha256


@pytest.mark.parametrize("name", sorted(SHIPPED))
def test_shipped_bundles_keep_their_references(name: str) -> None:
    bundle = Bundle.open(REPOSITORY / "models" / name, verify=False)
    assert bundle.reference == f"{name}@{SHIPPED[name]}"


def test_shipped_bundles_are_of_the_second_format() -> None:
    """In the first, a bundle that reads prompts through another encoder would keep its hash."""
    found = {path.parent.name: json.loads(path.read_text())["format"] for path in MANIFESTS}
    assert found == dict.fromkeys(found, 2)
    assert {*SHIPPED, *GENERATORS} <= set(found)


@pytest.mark.parametrize("name", GENERATORS)
def test_shipped_bundles_list_actions_of_the_vocabulary_once_each(name: str) -> None:
    lists = Bundle.open(REPOSITORY / "models" / name, verify=False).manifest.actions
    assert lists is not None
    listed = [*lists.known, *lists.tried]
    assert set(listed) <= set(load_vocabulary().actions)
    assert len(set(listed)) == len(listed)


def test_text_keys_of_shipped_bundles_stay() -> None:
    spec = Bundle.open(REPOSITORY / "models" / "hgm3-starter", verify=False).manifest.text
    assert spec is not None
    assert PIPELINE_VERSION == 6, "a new version gives new keys on purpose: write the new key here"
    key = feature_key("a person walks forward", spec)
    assert key == "7e92eba0ffa7cef0d1b593881d2060f7e5e6e3468053c45d0a8bdc226be85da6"


def edit(path: Path, change: Callable[[dict[str, Any]], object]) -> None:
    file = path / "manifest.json"
    document = json.loads(file.read_text())
    change(document)
    file.write_text(json.dumps(document))


@pytest.mark.parametrize("form", [1, 2])
def test_a_part_whose_shard_has_no_hash_is_refused(tmp_path: Path, form: int) -> None:
    write(tmp_path / "b", format=form)
    other = tmp_path / "b" / "other.safetensors"
    other.write_bytes((tmp_path / "b" / "masked.safetensors").read_bytes())
    edit(tmp_path / "b", lambda m: m["parts"]["masked"].append(other.name))
    with pytest.raises(InvalidBundle, match=r"without a hash: other\.safetensors"):
        Bundle.open(tmp_path / "b")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda m: m["parts"].update(empty=[]), "'empty' has no shards"),
        (lambda m: m["parts"].update(twice=m["parts"]["masked"]), "listed twice"),
        (lambda m: m["files"].update({"Masked.safetensors": m["files"]["masked.safetensors"]}), "in case alone"),
        (lambda m: m["files"].update({"README.md": m["files"]["masked.safetensors"]}), "cannot be a file"),
        (lambda m: m["files"].update({"manifest.json": m["files"]["masked.safetensors"]}), "cannot be a file"),
        (lambda m: (m["files"].update({"a.json": m["files"]["masked.safetensors"]}), m["parts"].update(x=["a.json"])),
         "are safetensors"),
        (lambda m: m["parts"].update(x=["../masked.safetensors"]), r"cannot be used: allowed are letters"),
    ],
)  # fmt: skip
def test_format_2_leaves_no_room_for_two_readings(
    tmp_path: Path, change: Callable[[dict[str, Any]], object], reason: str
) -> None:
    write(tmp_path / "b")
    edit(tmp_path / "b", change)
    with pytest.raises(InvalidBundle, match=reason):
        Bundle.open(tmp_path / "b", verify=False)


def test_a_file_that_changed_since_the_bundle_was_opened_is_not_loaded(tmp_path: Path) -> None:
    bundle = write(tmp_path / "b")
    file = tmp_path / "b" / "masked.safetensors"
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content)
    with pytest.raises(InvalidBundle, match="sha256 differs"):
        bundle.tensors("masked")


def test_weights_that_are_not_finite_are_refused(tmp_path: Path) -> None:
    bundle = write(tmp_path / "b")
    content = save({"w": np.array([np.nan], np.float16)})
    (bundle.path / "masked.safetensors").write_bytes(content)
    entry = {"sha256": hashlib.sha256(content).hexdigest(), "bytes": len(content)}
    edit(bundle.path, lambda m: m["files"].update({"masked.safetensors": entry}))
    with pytest.raises(InvalidBundle, match="not finite"):
        Bundle.open(bundle.path).tensors("masked")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
NAMES = st.sampled_from(sorted(BundleManifest.model_fields))


@given(st.binary() | st.dictionaries(NAMES | st.text(), JSON).map(lambda d: json.dumps(d).encode()))
def test_any_bytes_are_a_manifest_or_an_error(data: bytes) -> None:
    try:
        parse_manifest(data, "manifest.json")
    except MareyError:
        return
