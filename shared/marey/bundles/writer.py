"""Writing a bundle: fp16 safetensors in shards, a manifest with a hash of each file, all or nothing."""

from __future__ import annotations

import hashlib
import json
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save as save_safetensors

from marey.bundles.bundle import STATISTICS, Bundle, Tensors
from marey.bundles.manifest import FORMAT, MANIFEST_NAME, BundleFile, BundleManifest, parse_manifest
from marey.core.errors import Conflict, InvalidInput
from marey.core.hashing import sha256_of

MAX_SHARD_BYTES = 15 * 2**20
"""Shard size below the limit at which hosts of git repositories refuse files or warn."""


class BundleWriter:
    """Collects parts in a temporary folder and moves it into place when the manifest is written.

    ```python
    with BundleWriter(Path("models/hgm3-starter")) as writer:
        writer.add_part("masked", tensors)
        writer.add_statistics(mean, std)
        bundle = writer.finish(name="hgm3-starter", kind="generator", …)
    ```
    """

    def __init__(self, path: Path, *, overwrite: bool = False, max_shard_bytes: int = MAX_SHARD_BYTES) -> None:
        if path.exists() and not overwrite:
            raise Conflict("already exists", where=str(path), hint="Allow overwriting, or choose another name.")
        self.path = path
        self.max_shard_bytes = max_shard_bytes
        self._parts: dict[str, tuple[str, ...]] = {}
        self._files: dict[str, BundleFile] = {}

    def __enter__(self) -> BundleWriter:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._folder = Path(tempfile.mkdtemp(prefix=f".{self.path.name}-", dir=self.path.parent))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        shutil.rmtree(self._folder, ignore_errors=True)

    def add_part(
        self, part: str, tensors: Mapping[str, NDArray[Any]], *, dtype: type[np.floating] | None = np.float16
    ) -> None:
        """Add one part's tensors; floating ones are stored as `dtype` (None = as they are).

        Raises:
            InvalidInput: a tensor is not finite, or overflows `dtype`.
        """
        converted: Tensors = {name: _convert(part, name, value, dtype) for name, value in tensors.items()}
        shards = list(_shards(converted, self.max_shard_bytes))
        names = [f"{part}.safetensors"]
        if len(shards) > 1:
            names = [f"{part}-{i + 1:05}-of-{len(shards):05}.safetensors" for i in range(len(shards))]
        for name, shard in zip(names, shards, strict=True):
            self._add_file(name, save_safetensors(shard))
        self._parts[part] = tuple(names)

    @property
    def folder(self) -> Path:
        """The temporary folder, for checks of what is written before it is moved into place."""
        return self._folder

    def copy_part(self, part: str, shards: Mapping[str, Path]) -> None:
        """Add one part by copies of safetensors files, each under the name given, byte by byte."""
        for name, source in shards.items():
            target = self._folder / name
            shutil.copyfile(source, target)
            self._files[name] = BundleFile(sha256=sha256_of(target), bytes=target.stat().st_size)
        self._parts[part] = tuple(shards)

    def add_statistics(self, mean: NDArray[np.float32], std: NDArray[np.float32]) -> None:
        """Add mean and standard deviation (D,), stored in float32."""
        self.add_part(STATISTICS, {"mean": mean, "std": std}, dtype=np.float32)

    def add_json(self, name: str, value: Any) -> None:
        """Add a JSON file, `reference.json` for instance; it is hashed like the weights."""
        if name == MANIFEST_NAME:
            raise InvalidInput("is the manifest's name", where=name)
        self._add_file(name, json.dumps(value, ensure_ascii=False).encode())

    def add_card(self, text: str) -> None:
        """Add the model card, `README.md`. It is not part of the weights and may be edited later."""
        (self._folder / "README.md").write_text(text, encoding="utf-8")

    def finish(self, **fields: Any) -> Bundle:
        """Write the manifest from `fields` (see `BundleManifest`) and move the bundle into place."""
        fields.setdefault("format", FORMAT)
        made = BundleManifest(parts=self._parts, files=self._files, **fields)
        text = made.model_dump_json(indent=1) + "\n"
        manifest = parse_manifest(text.encode(), str(self.path / MANIFEST_NAME))  # its hash is of what is read
        (self._folder / MANIFEST_NAME).write_text(text, encoding="utf-8")
        self._folder.chmod(0o755)  # mkdtemp makes it private
        if self.path.exists():
            old = self._folder.with_name(f"{self._folder.name}.old")
            self.path.rename(old)
            self._folder.rename(self.path)
            shutil.rmtree(old)
        else:
            self._folder.rename(self.path)
        return Bundle(self.path, manifest)

    def _add_file(self, name: str, content: bytes) -> None:
        (self._folder / name).write_bytes(content)
        self._files[name] = BundleFile(sha256=hashlib.sha256(content).hexdigest(), bytes=len(content))


def _convert(part: str, name: str, value: NDArray[Any], dtype: type[np.floating] | None) -> NDArray[Any]:
    if np.issubdtype(value.dtype, np.floating):
        with np.errstate(over="ignore"):
            value = value.astype(dtype) if dtype is not None else value
        if not np.isfinite(value).all():
            raise InvalidInput(f"holds values that are not finite as {value.dtype}", where=f"{part}: {name}")
    return np.ascontiguousarray(value)


def _shards(tensors: Tensors, limit: int) -> Iterator[Tensors]:
    """Cut `tensors` into groups of at most `limit` bytes, in order (a larger single tensor has a group of its own)."""
    shard: Tensors = {}
    size = 0
    for name, value in tensors.items():
        if shard and size + value.nbytes > limit:
            yield shard
            shard, size = {}, 0
        shard[name] = value
        size += value.nbytes
    yield shard
