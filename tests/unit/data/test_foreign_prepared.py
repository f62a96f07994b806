"""A prepared folder that another program wrote: whatever is wrong with it is told with the file's name."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidFile, NotFound
from marey.core.hashing import sha256_of
from marey.data import manifest as names
from marey.data.prepared import PreparedData
from marey.training.texts import CaptionTexts
from tests.support.prepared import write_prepared


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = write_prepared(tmp_path_factory.mktemp("prepared") / "data", clips=6)
    return {file.name: file.read_bytes() for file in folder.iterdir()}


@pytest.fixture
def folder(whole: dict[str, bytes], tmp_path: Path) -> Path:
    for name, content in whole.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def replace(folder: Path, name: str, content: bytes) -> None:
    """Write a file with a matching hash."""
    (folder / name).write_bytes(content)
    manifest = json.loads((folder / names.MANIFEST).read_text())
    manifest["files"][name] = {"sha256": sha256_of(folder / name), "bytes": len(content)}
    (folder / names.MANIFEST).write_text(json.dumps(manifest))


def npy(array: np.ndarray[Any, Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def changed(change: Callable[[np.ndarray[Any, Any]], np.ndarray[Any, Any]]) -> Callable[[bytes], bytes]:
    return lambda content: npy(change(np.load(io.BytesIO(content))))


def with_nan(array: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    array = array.copy()
    array[-1, -1] = np.nan
    return array


CHANGES: dict[str, Callable[[bytes], bytes]] = {
    "nothing": lambda _: b"",
    "text": lambda _: b"{}",
    "an npz file": lambda _: npz(x=np.zeros(3)),
    "objects": lambda _: npy(np.array([None], object)),
    "truncated": lambda content: content[:-8],
    "another kind": changed(lambda array: array.astype(np.float64)),
    "another shape": changed(lambda array: array[:-1]),
    "flat": changed(lambda array: array.reshape(-1)),
    "not a number": changed(with_nan),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("name", [names.FEATURES, names.JOINTS, names.ROOTS])
def test_an_array_that_is_none_is_told(folder: Path, name: str, change: str) -> None:
    replace(folder, name, CHANGES[change]((folder / name).read_bytes()))
    with pytest.raises(InvalidFile, match=name):
        PreparedData.open(folder)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        npz(mean=np.zeros(263, np.float32)),
        npz(mean=np.zeros(263, np.float32), std=np.zeros(263, np.float32)),
        npz(mean=np.zeros(3, np.float32), std=np.ones(3, np.float32)),
        npz(mean=np.full(263, np.nan, np.float32), std=np.ones(263, np.float32)),
        npz(mean=np.array(["x"] * 263), std=np.ones(263, np.float32)),
    ],
)
def test_statistics_that_are_none_are_told(folder: Path, content: bytes) -> None:
    replace(folder, names.STATISTICS, content)
    with pytest.raises(InvalidFile, match=names.STATISTICS):
        PreparedData.open(folder)


@pytest.mark.parametrize(
    "change",
    [
        lambda lines: [],
        lambda lines: lines[:-1],
        lambda lines: [b"[" * 100_000, *lines[1:]],
        lambda lines: [b"\xff", *lines[1:]],
        lambda lines: [b" " * (2**20 + 1), *lines[1:]],
        lambda lines: [edited(lines[0], start=1), *lines[1:]],
        lambda lines: [edited(lines[0], length=-1), *lines[1:]],
        lambda lines: [edited(lines[0], joints_start=7), *lines[1:]],
        lambda lines: [edited(lines[0], split="other"), *lines[1:]],
        lambda lines: [edited(lines[0], seams=[-3]), *lines[1:]],
        lambda lines: [edited(lines[0], captions="x"), *lines[1:]],
    ],
)
def test_clips_that_do_not_fit_are_told(folder: Path, change: Callable[[list[bytes]], list[bytes]]) -> None:
    lines = (folder / names.CLIPS).read_bytes().splitlines()
    replace(folder, names.CLIPS, b"\n".join(change(lines)) + b"\n")
    with pytest.raises(InvalidFile, match=names.CLIPS):
        PreparedData.open(folder)


def edited(line: bytes, **changes: Any) -> bytes:
    return json.dumps({**json.loads(line), **changes}).encode()


@pytest.mark.parametrize(
    "content", [b"[" * 100_000, b"{}", b"[]", b"\xff", b'{"frames": NaN}', b'{"format": "marey-prepared-1"}']
)
def test_a_manifest_that_is_none_is_told(folder: Path, content: bytes) -> None:
    (folder / names.MANIFEST).write_bytes(content)
    with pytest.raises(InvalidFile, match=names.MANIFEST):
        PreparedData.open(folder)


def test_a_file_that_is_a_folder_is_told(folder: Path) -> None:
    (folder / names.JOINTS).unlink()
    (folder / names.JOINTS).mkdir()
    with pytest.raises(InvalidFile, match=names.JOINTS):
        PreparedData.open(folder)


@pytest.mark.parametrize(
    "changes",
    [
        {"strings": np.zeros((1, 3), np.float16)},
        {"strings": np.full((9, 384), np.nan, np.float16)},
        {"caption_start": np.array([], np.int64)},
        {"caption_start": np.array([5], np.int64)},
        {"node_start": np.array([0, -1], np.int64)},
        {"node_string": np.full(4, 10**6, np.int32)},
        {"node_level": np.array([9], np.int8)},
        {"edges": np.zeros((2, 2), np.int16)},
        {"edges": np.full((7, 3), 99, np.int16)},
        {"spec": np.array("[" * 100_000)},
        {"spec": np.array("{}x")},
        {"spec": np.zeros(2)},
        {"clips_sha256": np.array("other")},
    ],
)
def test_text_features_that_are_none_are_told(folder: Path, changes: dict[str, Any]) -> None:
    data = PreparedData.open(folder)
    CaptionTexts.load(data)
    with np.load(folder / names.TEXTS) as file:
        arrays = dict(file)
    (folder / names.TEXTS).write_bytes(npz(**arrays | changes))
    with pytest.raises(InvalidFile, match=names.TEXTS):
        CaptionTexts.load(data)


def test_a_folder_that_is_missing_is_told_from_one_without_data(tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="no prepared data in this folder"):
        PreparedData.open(tmp_path)
    with pytest.raises(NotFound, match=r"none: there is no such folder\n  `marey data prepare`"):
        PreparedData.open(tmp_path / "none")
