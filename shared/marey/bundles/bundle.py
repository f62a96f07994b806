"""Loading a bundle, verified."""

from __future__ import annotations

import hashlib
import json
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.bundles.manifest import DESCRIPTIVE, MANIFEST_NAME, BundleFile, BundleManifest, parse_manifest
from marey.core.arrays import parse_safetensors
from marey.core.documents import parse_json, read_bytes
from marey.core.errors import InvalidBundle, NotFound
from marey.core.hashing import sha256_of

MAX_MANIFEST_BYTES = 4 * 2**20
STATISTICS = "statistics"
HINT = "Fetch or import the bundle again."

Tensors = dict[str, NDArray[np.generic]]


class Bundle:
    """A verified bundle on disk. Open one with `Bundle.open` or `find_bundle`."""

    def __init__(self, path: Path, manifest: BundleManifest) -> None:
        self.path = path
        self.manifest = manifest

    @classmethod
    def open(cls, path: Path, *, verify: bool = True) -> Bundle:
        """Read the manifest and check every file's size and hash.

        Args:
            path: the bundle's folder.
            verify: check hashes too; sizes are always checked, and hashes again when a file is loaded.

        Raises:
            InvalidBundle: a file is missing, truncated, changed or foreign.
        """
        bundle = cls(path, read_manifest(path))
        for name, entry in bundle.manifest.files.items():
            file = path / name
            try:
                if not file.is_file():
                    raise _broken(file, "the manifest names this file, but it is not there")
                _check_size(file, file.stat().st_size, entry)
                if verify and sha256_of(file) != entry.sha256:
                    raise _changed(file)
            except OSError as error:
                raise _broken(file, f"cannot be read: {error.strerror}") from error
        return bundle

    @cached_property
    def weights_sha256(self) -> str:
        """Hash of everything that determines the generated motion: equal hashes mean equal motions.

        Format 1 covers the files alone. Format 2 covers the whole manifest as written, except for descriptive fields
        (`DESCRIPTIVE`): a field that a later version adds does not change the hash.
        """
        if self.manifest.format == 1:
            lines = "\n".join(f"{name} {entry.sha256}" for name, entry in sorted(self.manifest.files.items()))
            return hashlib.sha256(lines.encode()).hexdigest()
        document = self.manifest.model_dump(mode="json", exclude=DESCRIPTIVE, exclude_unset=True)
        text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def reference(self) -> str:
        """The exact bundle, as stored with every item: `name@first 12 of the hash`."""
        return f"{self.manifest.name}@{self.weights_sha256[:12]}"

    def tensors(self, part: str, *, dtype: type[np.floating] | None = np.float32) -> Tensors:
        """Return the tensors of one part, from all of its shards, whose hashes are checked.

        Args:
            part: `tokenizer`, `masked`, …
            dtype: floating tensors are cast to this; None leaves them as stored (fp16).

        Raises:
            InvalidBundle: unknown part, or a shard is changed, not safetensors, or holds numbers that are not finite.
        """
        shards = self.manifest.parts.get(part)
        if shards is None:
            known = ", ".join(sorted(self.manifest.parts))
            raise InvalidBundle(f"has no part {part!r}", where=str(self.path), hint=f"Its parts are: {known}.")
        tensors: Tensors = {}
        for shard in shards:
            tensors.update(self._load_shard(shard))
        if dtype is not None:
            tensors = {
                name: value.astype(dtype) if np.issubdtype(value.dtype, np.floating) else value
                for name, value in tensors.items()
            }
        return tensors

    def statistics(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return mean and standard deviation (D,) that normalised the features in training.

        Raises:
            InvalidBundle: as `tensors`, or the tensors have other names or shapes.
        """
        tensors = self.tensors(STATISTICS)
        mean, std = tensors.get("mean"), tensors.get("std")
        if mean is None or std is None or mean.ndim != 1 or mean.shape != std.shape:
            raise InvalidBundle("has no mean and deviation of one length", where=f"{self.path}: {STATISTICS}")
        return mean.astype(np.float32), std.astype(np.float32)

    def read_json(self, name: str) -> Any:
        """Read a file of `BundleWriter.add_json`.

        Raises:
            InvalidBundle: no such file, changed, or not JSON.
        """
        return parse_json(self.read_file(name), str(self.path / name), error=InvalidBundle, hint=HINT)

    def read_file(self, name: str) -> bytes:
        """Read a file that the manifest names; its hash is checked.

        Raises:
            InvalidBundle: the manifest does not name it, or it is missing or changed.
        """
        entry = self.manifest.files.get(name)
        if entry is None:
            raise InvalidBundle(f"has no file {name!r}", where=str(self.path))
        file = self.path / name
        try:
            data = read_bytes(file, limit=entry.bytes, error=InvalidBundle, hint=HINT)
        except NotFound as error:
            raise _broken(file, "the manifest names this file, but it is not there") from error
        _check_size(file, len(data), entry)
        if hashlib.sha256(data).hexdigest() != entry.sha256:
            raise _changed(file)
        return data

    def _load_shard(self, name: str) -> Tensors:
        file = self.path / name
        tensors: Tensors = parse_safetensors(self.read_file(name), str(file), error=InvalidBundle, hint=HINT)
        for tensor, value in tensors.items():
            if value.dtype.kind == "f" and not np.isfinite(value).all():
                raise _broken(file, f"its tensor {tensor!r} holds numbers that are not finite")
        return tensors


def read_manifest(path: Path) -> BundleManifest:
    """Read the manifest of a bundle's folder.

    Raises:
        InvalidBundle: it is missing, or this version cannot read it.
    """
    file = path / MANIFEST_NAME
    try:
        data = read_bytes(file, limit=MAX_MANIFEST_BYTES, error=InvalidBundle, hint=HINT)
    except NotFound as error:
        raise _broken(path, f"has no {MANIFEST_NAME}: not a model bundle") from error
    return parse_manifest(data, str(file), hint=HINT)


def _check_size(file: Path, size: int, entry: BundleFile) -> None:
    if size != entry.bytes:
        raise _broken(file, f"has {size} bytes, the manifest says {entry.bytes}: truncated?")


def _changed(file: Path) -> InvalidBundle:
    return _broken(file, "its sha256 differs from the manifest's: the file was changed or damaged")


def _broken(file: Path, message: str) -> InvalidBundle:
    return InvalidBundle(message, where=str(file), hint=HINT)
