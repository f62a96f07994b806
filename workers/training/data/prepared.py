"""Reader of prepared folders: memory-mapped, checked before use."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from shared.errors import InvalidFile, NotFound
from shared.hashing import sha256_of
from shared.motion.features import FeatureLayout, layout
from workers.training.data import manifest as names
from workers.training.data.manifest import Clip, Manifest
from workers.training.data.pack import SPLITS, join


@dataclass(frozen=True)
class PreparedData:
    """A prepared folder, open.

    Attributes:
        path: the folder.
        manifest: sources with their terms, layout, counts, hashes.
        clips: all clips, in the order of the arrays.
        all_features: (F, D) float32, memory-mapped, clips end to end, not normalized.
        mean, std: (D,) float32 of the training split; std is one number for each group of the layout.
    """

    path: Path
    manifest: Manifest
    clips: tuple[Clip, ...]
    all_features: NDArray[np.float32]
    mean: NDArray[np.float32]
    std: NDArray[np.float32]
    _local: NDArray[np.float16]
    _roots: NDArray[np.float32]

    @classmethod
    def open(cls, path: Path | str, *, verify: bool = True) -> PreparedData:
        """Open a folder that `marey data prepare` has written.

        Args:
            path: the folder.
            verify: compare each file with its sha256 (about a second per gigabyte); sizes are always compared.

        Raises:
            NotFound: no such folder, or no manifest in it.
            InvalidFile: another format, a missing, changed or truncated file, or clips that do not fit the arrays.
        """
        path = Path(path)
        manifest = read_manifest(path)
        for name, entry in manifest.files.items():
            _check_file(path / name, entry.sha256 if verify else None, entry.bytes)
        clips = tuple(_read_clips(path / names.CLIPS))
        features = _open_array(path / names.FEATURES, np.float32)
        local = _open_array(path / names.JOINTS, np.float16)
        roots = _open_array(path / names.ROOTS, np.float32)
        with np.load(path / names.STATISTICS, allow_pickle=False) as file:
            mean, std = file["mean"], file["std"]
        if (
            features.shape != (manifest.frames, manifest.dim)
            or mean.shape != std.shape
            or mean.shape != (manifest.dim,)
        ):
            raise InvalidFile(f"features have shape {features.shape}", where=str(path))
        last = clips[-1]
        if len(clips) != manifest.clips or last.start + last.length != manifest.frames:
            raise InvalidFile("clips do not fit the arrays", where=str(path / names.CLIPS))
        if len(local) != manifest.frames + manifest.clips or len(roots) != len(local):
            raise InvalidFile("joints do not fit the clips", where=str(path))
        return cls(path, manifest, clips, features, mean, std, local, roots)

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which names every file's."""
        return hashlib.sha256(self.manifest.model_dump_json().encode()).hexdigest()

    @property
    def layout(self) -> FeatureLayout:
        """Layout of the features."""
        return layout(self.manifest.layout)

    @property
    def caption_counts(self) -> list[int]:
        """Captions of each whole clip."""
        return [len(clip.captions) for clip in self.clips]

    @cached_property
    def _by_split(self) -> dict[str, tuple[Clip, ...]]:
        return {split: tuple(clip for clip in self.clips if clip.split == split) for split in SPLITS}

    def split(self, name: str) -> tuple[Clip, ...]:
        """Clips of `train`, `val`, `test` or `compositional`.

        Raises:
            NotFound: no such split.
        """
        if name not in self._by_split:
            raise NotFound(f"no split {name!r}", where=str(self.path), hint=f"There are {', '.join(SPLITS)}.")
        return self._by_split[name]

    def features(self, clip: Clip) -> NDArray[np.float32]:
        """(length, D) of a clip, not normalized; a view of the mapped file."""
        return self.all_features[clip.start : clip.start + clip.length]

    def joints(self, clip: Clip) -> NDArray[np.float32]:
        """(length + 1, 22, 3) metres of a clip, in the place that features are encoded in."""
        rows = slice(clip.joints_start, clip.joints_start + clip.length + 1)
        return join(self._local[rows], self._roots[rows])

    def normalize(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Zero mean, unit deviation of each group."""
        return (features - self.mean) / self.std


def read_manifest(path: Path) -> Manifest:
    """The manifest of a folder.

    Raises:
        NotFound: no such folder or manifest.
        InvalidFile: broken, or of another format.
    """
    file = path / names.MANIFEST
    if not file.is_file():
        raise NotFound("no prepared data here", where=str(path), hint="Make it with `marey data prepare`.")
    try:
        manifest = Manifest.model_validate_json(file.read_bytes())
    except ValidationError as error:
        raise InvalidFile(f"not a manifest: {error.errors()[0]['msg']}", where=str(file)) from error
    if manifest.format != names.FORMAT:
        raise InvalidFile(f"format {manifest.format!r}", where=str(file), hint=f"This version reads {names.FORMAT}.")
    missing = [name for name in names.FILES if name not in manifest.files]
    if missing:
        raise InvalidFile(f"names no {missing[0]}", where=str(file))
    if any(Path(name).name != name for name in manifest.files):
        raise InvalidFile("names files outside its folder", where=str(file))
    return manifest


def _check_file(path: Path, sha256: str | None, size: int) -> None:
    hint = "Prepare the data again."
    if not path.is_file():
        raise InvalidFile("is missing", where=str(path), hint=hint)
    if path.stat().st_size != size:
        raise InvalidFile(f"has {path.stat().st_size:,} bytes, not {size:,}: truncated?", where=str(path), hint=hint)
    if sha256 is not None and sha256_of(path) != sha256:
        raise InvalidFile("has been changed since it was written", where=str(path), hint=hint)


def _open_array(path: Path, dtype: type[np.generic]) -> NDArray:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise InvalidFile(f"not an array: {error}", where=str(path)) from error
    if array.dtype != dtype:
        raise InvalidFile(f"holds {array.dtype}, not {np.dtype(dtype)}", where=str(path))
    return array


def _read_clips(path: Path) -> Iterable[Clip]:
    with path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, start=1):
            try:
                yield Clip.model_validate(json.loads(line))
            except (ValueError, ValidationError) as error:
                raise InvalidFile(f"not a clip: {error}", where=f"{path}:{number}") from error
