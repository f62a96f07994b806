"""A broken bundle is left out with its reason and hides no other, whatever is wrong with it."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.api.models.schemas import ModelsView
from marey.bundles import Bundle, BundleWriter, TextSpec, choose_bundle, scan_bundles
from marey.core.errors import InvalidBundle, MareyError
from marey.core.settings import Settings
from marey.jobs.generators import list_generators

GOOD, BAD = "a-good", "b-broken"


def write(path: Path) -> Bundle:
    with BundleWriter(path) as writer:
        writer.add_part("masked", {"w": np.zeros((4, 4), np.float32)})
        return writer.finish(
            name=path.name, version="1", kind="generator", model="hgm3", config="tiny", licence="MIT", fps=20.0,
            parameters={"min_frames": 16, "max_frames": 196},
            text=TextSpec(encoder_sha256="0" * 64, labeller_sha256="1" * 64),
        )  # fmt: skip


@pytest.fixture
def config(tmp_path: Path) -> Settings:
    models = tmp_path / "secret-server-path" / "models"
    write(models / GOOD)
    write(models / BAD)
    return Settings(models=models, home=tmp_path / "home")


def edit(**changes: Any) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        file = path / "manifest.json"
        file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))

    return change


def as_folder(name: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        (path / name).unlink()
        (path / name).mkdir()

    return change


def as_link(name: str) -> Callable[[Path], None]:
    def change(path: Path) -> None:
        (path / name).unlink()
        (path / name).symlink_to(name)

    return change


def as_pipe(path: Path) -> None:
    (path / "manifest.json").unlink()
    os.mkfifo(path / "manifest.json")


def loop(path: Path) -> None:
    for file in path.iterdir():
        file.unlink()
    path.rmdir()
    path.symlink_to(path.name)


def dangling(path: Path) -> None:
    loop(path)
    path.unlink()
    path.symlink_to("nowhere")


def written(content: bytes) -> Callable[[Path], None]:
    return lambda path: (path / "manifest.json").write_bytes(content) and None


BROKEN: dict[str, tuple[Callable[[Path], None], str]] = {
    "no JSON": (written(b"{"), "manifest.json: is not JSON"),
    "empty": (written(b""), "manifest.json: is not JSON"),
    "not UTF-8": (written(b'"\xff"'), "manifest.json: is not UTF-8"),
    "a list": (written(b"[]"), "file: is not an object"),
    "deep": (written(b"[" * 100_000 + b"]" * 100_000), "nested more than 64 levels"),
    "deep parameters": (
        edit(parameters=json.loads('{"a":' * 80 + "1" + "}" * 80)),
        "nested more than 64 levels",
    ),
    "a number of a million digits": (written(b"1" * 1_000_000), "a number of too many digits"),
    "infinite": (edit(metrics={"x": float("inf")}), "not finite"),
    "1e999": (written(b'{"fps": 1e999}'), "not finite"),
    "a surrogate": (written(b'{"licence": "\\ud800"}'), "lone surrogate"),
    "huge": (written(b" " * (5 * 2**20)), "is over 4,194,304 bytes"),
    "wrong types": (edit(parts="masked"), "parts: is not an object"),
    "parts that are no files": (edit(parts={"masked": ["other.safetensors"]}), "without a hash: other.safetensors"),
    "unknown fields": (edit(surprise=1), "surprise: is not a known field"),
    "another format": (edit(format=3), "format: is not known; known: 1 or 2"),
    "a missing shard": (lambda path: (path / "masked.safetensors").unlink(), "masked.safetensors: the manifest names"),
    "a truncated shard": (lambda path: os.truncate(path / "masked.safetensors", 3), "truncated"),
    "a shard that is a folder": (as_folder("masked.safetensors"), "masked.safetensors: the manifest names"),
    "a shard that is a loop": (as_link("masked.safetensors"), "masked.safetensors: the manifest names"),
    "a manifest that is a folder": (as_folder("manifest.json"), "manifest.json: is a folder"),
    "a manifest that is a loop": (as_link("manifest.json"), "manifest.json: cannot be read"),
    "a manifest that is a pipe": (as_pipe, "manifest.json: is not a regular file"),
    "a folder that is a loop": (loop, "manifest.json: cannot be read"),
    "a folder that leads nowhere": (dangling, "not a model bundle"),
    "no lengths": (edit(model="of-a-studio", parameters={}), "no number as 'min_frames'"),
    "lengths beyond its model's": (edit(parameters={"max_frames": 197}), "makes those of 0.8 to 9.8"),
    "lengths that are texts": (edit(parameters={"min_frames": "1", "max_frames": []}), "no number as 'min_frames'"),
    "lengths that are none": (edit(parameters={"min_frames": 9, "max_frames": 1}), "invalid range of lengths"),
    "lengths of 400 digits": (edit(parameters={"min_frames": 10**400, "max_frames": 10**401}), "no number as 'min_"),
    "settings that are a number": (
        edit(parameters={"min_frames": 16, "max_frames": 196, "inference": 5}),
        "no object as 'inference'",
    ),
    "a file of 4,000 digits": (
        edit(files={"masked.safetensors": {"sha256": "0" * 64, "bytes": 10**4000}}),
        "masked.safetensors: has",
    ),
    "no text": (edit(text=None), "not a text-to-motion generator"),
    "a labeller that is not here": (
        edit(text={"encoder_sha256": "0" * 64, "labeller": "nobody"}),
        "no model bundle is named 'nobody'",
    ),
}


@pytest.mark.parametrize("kind", BROKEN)
def test_a_broken_bundle_is_told_and_hides_no_other(
    config: Settings, kind: str, caplog: pytest.LogCaptureFixture
) -> None:
    spoil, reason = BROKEN[kind]
    spoil(config.models / BAD)
    made = list_generators(config)
    assert [generator.bundle.manifest.name for generator in made.found] == [GOOD]
    assert [broken.name for broken in made.broken] == [BAD]
    assert reason in made.broken[0].reason
    assert "secret-server-path" not in made.broken[0].reason
    assert len(made.broken[0].reason) <= 500
    assert BAD in caplog.text
    assert choose_bundle("hgm3", config=config).manifest.name == GOOD


def test_a_folder_whose_name_is_no_unicode_can_be_told(config: Settings, caplog: pytest.LogCaptureFixture) -> None:
    name = os.fsdecode(b"b-\xff")
    (config.models / BAD).rename(config.models / name)
    (config.models / name / "manifest.json").write_bytes(b"{}")
    (broken,) = list_generators(config).broken
    assert broken.name == "b-\\udcff"
    assert b"b-" in ModelsView.of(list_generators(config)).model_dump_json().encode()
    assert "b-\\udcff" in caplog.text.encode().decode()


def test_a_reason_is_logged_once(config: Settings, caplog: pytest.LogCaptureFixture) -> None:
    (config.models / BAD / "manifest.json").write_text("{")
    for _ in range(3):
        list_generators(config)
    assert caplog.text.count("is left out") == 1


def test_an_unreadable_bundle_is_told(config: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    """Root reads everything, so the refusal of the system is put in its place."""
    real = os.open

    def refuse(path: Any, *arguments: Any, **options: Any) -> int:
        if BAD in str(path):
            raise PermissionError(13, "Permission denied", str(path))
        return real(path, *arguments, **options)

    monkeypatch.setattr(os, "open", refuse)
    found = scan_bundles(config=config)
    assert [broken.reason for broken in found.broken] == ["manifest.json: cannot be read: Permission denied"]


def test_what_is_no_bundle_is_no_broken_one(config: Settings) -> None:
    (config.models / "minilm").mkdir()
    (config.models / "notes.txt").write_text("x")
    (config.models / ".hidden").mkdir()
    (config.models / ".hidden" / "manifest.json").write_text("{")
    assert scan_bundles(config=config).broken == ()


def test_a_broken_bundle_that_is_asked_for_is_an_error(config: Settings) -> None:
    (config.models / BAD / "manifest.json").write_text("{")
    with pytest.raises(InvalidBundle, match="is not JSON"):
        choose_bundle(BAD, config=config)


@pytest.mark.parametrize("name", ["a\x00b", "", ".", "..", "x" * 5000, "a/../b", "~unknown/x", "/" + "x" * 5000])
def test_any_name_is_found_or_an_error(config: Settings, name: str) -> None:
    with pytest.raises(MareyError):
        choose_bundle(name, config=config)
