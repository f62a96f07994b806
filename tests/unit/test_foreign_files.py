"""Whatever bytes a file holds that this process did not write: it is read, or the error is one of ours."""

from __future__ import annotations

import contextlib
import io
import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from marey.bundles.manifest import parse_manifest
from marey.client.server_address import read_server
from marey.core.arrays import check_array, map_npy, parse_npz, parse_safetensors, read_npy
from marey.core.documents import MAX_DEPTH, parse_json, read_bytes, read_json
from marey.core.errors import InvalidFile, MareyError, NotFound, TooLarge
from marey.data.pack import JointsPack
from marey.data.prepared import read_manifest
from marey.measures.scores import read_scores
from marey.motion.clip import parse_npz as parse_clip
from marey.streams.recording import StreamRecording
from marey.text.features import TextFeatures
from marey.training.parts import load_part


def npy(array: np.ndarray[Any, Any]) -> bytes:
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=True)
    return buffer.getvalue()


def npz(**arrays: Any) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


DEEP = b"[" * 200_000
NPY = npy(np.arange(6, dtype=np.float32).reshape(2, 3))
ARRAYS: dict[str, bytes] = {
    "nothing": b"",
    "text": b"hello",
    "an npz file": npz(x=np.zeros(3)),
    "a zip": b"PK\x05\x06" + b"\0" * 18,
    "objects": npy(np.array([{}, 1], object)),
    "truncated": NPY[:-4],
    "half a header": NPY[:40],
    "a header that is code": NPY.replace(b"{'descr'", b"__import"),
    "a shape without end": NPY.replace(b"(2, 3)", b"(9**9)"),
    "a negative shape": NPY.replace(b"(2, 3)", b"(-2,3)"),
    "version 9": b"\x93NUMPY\x09\x00" + NPY[8:],
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_what_is_no_array_is_an_error_of_ours(tmp_path: Path, kind: str) -> None:
    file = tmp_path / "joints.npy"
    file.write_bytes(ARRAYS[kind])
    for read in (map_npy, read_npy):
        with pytest.raises(InvalidFile) as refused:
            read(file)
        assert refused.value.where == str(file)
    with pytest.raises(MareyError):
        parse_npz(ARRAYS[kind], "x", ("joints",))


def test_arrays_are_checked_by_kind_shape_and_finite_numbers() -> None:
    whole = np.ones((2, 3), np.float32)
    assert check_array(whole, "x", "file", kinds="f", shape=(None, 3)) is whole
    check_array(whole, "x", "file", kinds="float32", shape=(2, 3))
    for array, options in (
        (whole.astype(int), {"kinds": "f", "shape": (2, 3)}),
        (whole, {"kinds": "float16", "shape": (2, 3)}),
        (whole, {"kinds": "f", "shape": (2,)}),
        (whole, {"kinds": "f", "shape": (2, 4)}),
        (whole * np.nan, {"kinds": "f", "shape": (2, 3)}),
        (whole * np.inf, {"kinds": "f", "shape": (2, 3)}),
    ):
        with pytest.raises(InvalidFile, match="`x`"):
            check_array(array, "x", "file", **options)
    large = np.zeros((3000, 2000), np.float16)
    large[-1, -1] = np.nan
    with pytest.raises(InvalidFile, match="NaN"):
        check_array(large, "x", "file", kinds="f", shape=(None, None))


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_an_npz_file_packed_by_another_method_is_not_unpacked(method: int) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(npz(x=np.zeros(3)))) as made, zipfile.ZipFile(file, "w", method) as packed:
        packed.writestr("x.npy", made.read("x.npy"))
    with pytest.raises(InvalidFile, match="a method that numpy does not use"):
        parse_npz(file.getvalue(), "x", ("x",))


def test_an_npz_file_that_unpacks_to_too_much_is_refused() -> None:
    with pytest.raises(TooLarge):
        parse_npz(npz(x=np.zeros(10_000)), "x", ("x",), limit=1000)


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (DEEP, "nested more than"),
        (b'{"a":' * 100_000, "nested more than"),
        (b"[" * (MAX_DEPTH + 1) + b"]" * (MAX_DEPTH + 1), "nested more than"),
        (b"{ \xff", r"^x: is not UTF-8 \(byte 0xff at position 2\)$"),
        (b"{", "not JSON"),
        (b"1" * 10_000, "a number of too many digits"),
        (b"NaN", "not finite"),
        (b"-1e999", "not finite"),
        (b'{"\\ud800": 1}', "surrogate"),
    ],
)
def test_what_is_no_json_is_told(data: bytes, reason: str) -> None:
    with pytest.raises(InvalidFile, match=reason):
        parse_json(data, "x")


def test_json_is_read_as_it_is() -> None:
    value = {"a": [1, 2.5, None, True, "é\u200d"], "b": {}}
    assert parse_json(json.dumps(value).encode(), "x") == value
    assert parse_json(b"\xef\xbb\xbf[]", "x") == []
    deepest = json.loads("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    assert parse_json(json.dumps(deepest), "x") == deepest


def test_a_key_that_an_object_gives_twice_is_refused_where_people_write_it() -> None:
    assert parse_json('{"a": 1, "a": 2}', "x") == {"a": 2}
    with pytest.raises(InvalidFile, match=r"^x: gives 'a' twice$"):
        parse_json('[{"a": 1, "a": 2}]', "x", unique=True)


def test_what_is_no_file_is_told(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "big").write_bytes(b" " * 101)
    for name in ("pipe", "loop", "big", "."):
        with pytest.raises(InvalidFile):
            read_bytes(tmp_path / name, limit=100)
    for name in ("nothing", "a\0b"):
        with pytest.raises(NotFound):
            read_json(tmp_path / name)


def in_folder(read: Callable[[Path], object], name: str) -> Callable[[Path, bytes], object]:
    def called(folder: Path, data: bytes) -> object:
        (folder / name).write_bytes(data)
        return read(folder)

    return called


READERS: dict[str, Callable[[Path, bytes], object]] = {
    "a bundle's manifest": lambda _, data: parse_manifest(data, "manifest.json"),
    "a clip": lambda _, data: parse_clip(data),
    "safetensors": lambda _, data: parse_safetensors(data, "x"),
    "text features": lambda _, data: TextFeatures.from_blob(data),
    "a recording": lambda _, data: StreamRecording.from_blob(data),
    "scores": lambda _, data: read_scores(data, "x"),
    "server.json": in_folder(read_server, "server.json"),
    "the manifest of prepared data": in_folder(read_manifest, "manifest.json"),
    "a trained part": in_folder(load_part, "part.json"),
    "a joints pack": in_folder(lambda folder: JointsPack.load(folder / "pack.npz"), "pack.npz"),
}
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
TENSORS = st.builds(
    lambda header, rest: len(header).to_bytes(8, "little") + header + rest,
    JSON.map(lambda value: json.dumps(value).encode()),
    st.binary(max_size=20),
)
PACKED = st.builds(
    lambda table, local: npz(table=np.array(table), local=local, root=np.zeros((2, 3), np.float32)),
    JSON.map(json.dumps) | st.just('{"format": "marey-joints-pack-1", "clips": [{}]}'),
    st.sampled_from([np.zeros((2, 21, 3), np.float16), np.zeros(0), np.array("x")]),
)


@pytest.mark.parametrize("kind", READERS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary() | JSON.map(lambda value: json.dumps(value).encode()) | TENSORS | PACKED | st.just(DEEP))
def test_any_bytes_are_read_or_an_error_of_ours(tmp_path: Path, kind: str, data: bytes) -> None:
    with contextlib.suppress(MareyError):
        READERS[kind](tmp_path, data)
