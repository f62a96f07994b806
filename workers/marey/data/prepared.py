"""Reader of prepared folders: memory-mapped and checked before use."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from marey.core.arrays import check_array, map_npy, read_npz
from marey.core.documents import parse_json, read_json
from marey.core.errors import InvalidFile, NotFound
from marey.core.hashing import sha256_of
from marey.core.validation import first_problem
from marey.data import manifest as names
from marey.data.manifest import Clip, Manifest
from marey.data.pack import SPLITS, join
from marey.motion.features import FeatureLayout, layout

HINT = "Prepare the data again."
MAX_LINE = 2**20
"""Largest size of a clip's line in bytes, a hundred times the typical size."""


@dataclass(frozen=True)
class PreparedData:
    """An open prepared folder.

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
        """Open a folder written by `marey data prepare`.

        Args:
            path: the folder.
            verify: compare each file with its sha256, and look for numbers that are not finite (about two seconds
                per gigabyte); sizes, types and shapes are always checked.

        Raises:
            NotFound: the folder or its manifest does not exist, or the layout is unknown.
            InvalidFile: another format, a missing, changed or truncated file, or clips that do not fit the arrays.
        """
        path = Path(path)
        manifest = read_manifest(path)
        for name, entry in manifest.files.items():
            _check_file(path / name, entry.sha256 if verify else None, entry.bytes)
        clips = tuple(_read_clips(path / names.CLIPS))
        rows = manifest.frames + manifest.clips
        features = _map(path / names.FEATURES, "float32", (manifest.frames, manifest.dim), finite=verify)
        below_root = len(layout(manifest.layout).skeleton) - 1
        local = _map(path / names.JOINTS, "float16", (rows, below_root, 3), finite=verify)
        roots = _map(path / names.ROOTS, "float32", (rows, 3), finite=verify)
        mean, std = _statistics(path / names.STATISTICS, manifest.dim)
        _check_clips(clips, manifest, path / names.CLIPS)
        return cls(path, manifest, clips, features, mean, std, local, roots)

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which has the hash of every file; fields absent from the manifest do not change it."""
        return hashlib.sha256(self.manifest.model_dump_json(exclude_unset=True).encode()).hexdigest()

    @property
    def layout(self) -> FeatureLayout:
        """Layout of the features."""
        return layout(self.manifest.layout)

    @property
    def caption_counts(self) -> list[tuple[int, ...]]:
        """Number of captions by each author, for each clip."""
        return [clip.authors or (len(clip.captions),) for clip in self.clips]

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
        """(length + 1, J, 3) metres of a clip, in the canonical frame of its features."""
        rows = slice(clip.joints_start, clip.joints_start + clip.length + 1)
        return join(self._local[rows], self._roots[rows])

    def normalize(self, features: NDArray[np.float32]) -> NDArray[np.float32]:
        """Normalize features to zero mean and unit deviation per group."""
        return (features - self.mean) / self.std


def read_manifest(path: Path) -> Manifest:
    """Read the manifest of a folder.

    Raises:
        NotFound: the folder or its manifest does not exist.
        InvalidFile: it is broken or has another format.
    """
    file = path / names.MANIFEST
    try:
        document = read_json(file)
    except NotFound:
        message = "no prepared data in this folder" if path.is_dir() else "there is no such folder"
        raise NotFound(message, where=str(path), hint="`marey data prepare` makes prepared data.") from None
    try:
        manifest = Manifest.model_validate(document)
    except ValidationError as error:
        raise InvalidFile(f"not a manifest: {first_problem(error)}", where=str(file)) from error
    if manifest.format != names.FORMAT:
        raise InvalidFile(f"format {manifest.format!r}", where=str(file), hint=f"This version reads {names.FORMAT}.")
    missing = [name for name in names.FILES if name not in manifest.files]
    if missing:
        raise InvalidFile(f"does not list {missing[0]}", where=str(file))
    if any(Path(name).name != name or name == names.MANIFEST for name in manifest.files):
        raise InvalidFile("names files outside its folder", where=str(file))
    if min(manifest.frames, manifest.clips, manifest.dim) < 1 or not 0 < manifest.fps < math.inf:
        raise InvalidFile("holds no clips", where=str(file))
    return manifest


def _check_file(path: Path, sha256: str | None, size: int) -> None:
    hint = HINT
    try:
        if not path.is_file():
            raise InvalidFile("is missing", where=str(path), hint=hint)
        found = path.stat().st_size
        if found != size:
            raise InvalidFile(f"has {found:,} bytes, not {size:,}: truncated?", where=str(path), hint=hint)
        if sha256 is not None and sha256_of(path) != sha256:
            raise InvalidFile("has been changed since it was written", where=str(path), hint=hint)
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=str(path), hint=hint) from None


def _map(path: Path, kind: str, shape: tuple[int, ...], *, finite: bool) -> NDArray:
    return check_array(map_npy(path, hint=HINT), path.name, str(path), kinds=kind, shape=shape, finite=finite)


def _statistics(path: Path, width: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean and deviation (D,) of the training split."""
    arrays = read_npz(path, ("mean", "std"), hint=HINT)
    for name, values in arrays.items():
        check_array(values, name, str(path), kinds="float32", shape=(width,))
    if (arrays["std"] <= 0).any():
        raise InvalidFile("`std` holds a deviation that is not positive", where=str(path), hint=HINT)
    return arrays["mean"], arrays["std"]


def _read_clips(path: Path) -> Iterable[Clip]:
    try:
        with path.open("rb") as file:
            for number, line in enumerate(iter(lambda: file.readline(MAX_LINE + 1), b""), start=1):
                where = f"{path}:{number}"
                if len(line) > MAX_LINE:
                    raise InvalidFile(f"is over {MAX_LINE:,} bytes", where=where)
                try:
                    yield Clip.model_validate(parse_json(line, where))
                except ValidationError as error:
                    raise InvalidFile(f"not a clip: {first_problem(error)}", where=where) from error
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=str(path), hint=HINT) from None


def _check_clips(clips: tuple[Clip, ...], manifest: Manifest, path: Path) -> None:
    """Check that clips fill the arrays one after the other, and that seams lie within their clips."""
    if len(clips) != manifest.clips:
        raise InvalidFile(f"holds {len(clips)} clips, the manifest says {manifest.clips}", where=str(path))
    frame, row = 0, 0
    for number, clip in enumerate(clips, start=1):
        if (clip.start, clip.joints_start) != (frame, row) or clip.length < 1 or clip.split not in SPLITS:
            raise InvalidFile("clips do not fit the arrays", where=f"{path}:{number}")
        if clip.authors and sum(clip.authors) != len(clip.captions):
            raise InvalidFile("captions and their authors differ in number", where=f"{path}:{number}")
        if not all(0 <= seam <= clip.length for seam in clip.seams):
            raise InvalidFile("seams do not lie within the clip", where=f"{path}:{number}")
        frame, row = frame + clip.length, row + clip.length + 1
    if frame != manifest.frames:
        raise InvalidFile("clips do not fit the arrays", where=str(path))
