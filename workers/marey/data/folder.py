"""Writer of prepared folders, of any feature layout."""

from __future__ import annotations

import errno
import shutil
from collections import Counter
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import Conflict, InvalidInput
from marey.core.hashing import sha256_of
from marey.data import manifest as names
from marey.data.manifest import Clip, FileEntry, Manifest
from marey.data.pack import SPLITS, split_root
from marey.motion.features import FeatureLayout

Float32 = NDArray[np.float32]
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
LEAST_STD = 1e-4
"""Smallest deviation of a number: a constant one must not be divided by zero."""


class PreparedWriter:
    """Write a prepared folder beside its final path and move it there once complete.

    Args:
        out: a folder that is empty or does not exist.
        layout: of the features.

    Raises:
        Conflict: the folder is not empty.
    """

    def __init__(self, out: Path, layout: FeatureLayout) -> None:
        if out.exists() and any(out.iterdir()):
            raise Conflict("the folder is not empty", where=str(out), hint="Name another one, or remove it first.")
        self.out = out
        self.layout = layout
        self.work = out.with_name(out.name + ".part")
        shutil.rmtree(self.work, ignore_errors=True)
        self.work.mkdir(parents=True)
        self.clips: list[Clip] = []
        self.frames = 0
        self._features = (self.work / "features.raw").open("wb")
        self._local = (self.work / "joints.raw").open("wb")
        self._roots = (self.work / "roots.raw").open("wb")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _place: object) -> None:
        """Remove an unfinished folder.

        Raises:
            InvalidInput: it cannot be written: the disk is full, or files may not be so large.
        """
        for file in (self._features, self._local, self._roots):
            with suppress(OSError):  # what is left of a full disk's buffer is written again
                file.close()
        shutil.rmtree(self.work, ignore_errors=True)
        if isinstance(error, OSError) and error.errno in FULL:
            raise InvalidInput(f"cannot be written: {error.strerror}", where=str(self.out)) from error

    def place(self, features: NDArray[np.floating]) -> dict[str, Any]:
        """Return the fields of a `Clip` that say where these features (T, D) come to lie as the next clip."""
        return {
            "start": self.frames,
            "length": len(features),
            "joints_start": self.frames + len(self.clips),
        }

    def append(self, features: NDArray[np.floating], joints: NDArray[np.floating], clip: Clip) -> None:
        """Append a clip with its features (T, D) and joints (T + 1, J, 3), metres."""
        local, root = split_root(joints)
        self._features.write(np.ascontiguousarray(features, "<f4").tobytes())
        self._local.write(np.ascontiguousarray(local, "<f2").tobytes())
        self._roots.write(np.ascontiguousarray(root, "<f4").tobytes())
        self.clips.append(clip)
        self.frames += len(features)

    def check_split(self) -> None:
        """Check that there is something to train on; raise InvalidInput otherwise."""
        if not any(clip.split == "train" for clip in self.clips):
            raise InvalidInput("no training clip is left", where=str(self.out))

    def close_arrays(self) -> Float32:
        """Write the arrays, and return the mapped features (F, D)."""
        rows, joints = self.frames + len(self.clips), len(self.layout.skeleton) - 1
        for file, name, shape, dtype in (
            (self._features, names.FEATURES, (self.frames, self.layout.dim), "<f4"),
            (self._local, names.JOINTS, (rows, joints, 3), "<f2"),
            (self._roots, names.ROOTS, (rows, 3), "<f4"),
        ):
            file.close()
            _raw_to_npy(Path(file.name), self.work / name, shape, dtype)
        return np.load(self.work / names.FEATURES, mmap_mode="r")

    def contents(self) -> dict[str, Any]:
        """Return the fields of a `Manifest` that follow from layout and clips; hashes of files are added later."""
        kinds = Counter(_kind(clip) for clip in self.clips)
        lengths: dict[str, Counter[str]] = {split: Counter() for split in SPLITS}
        for clip in self.clips:
            whole = int(clip.measured.seconds)
            lengths[clip.split][f"{whole}-{whole + 1}"] += 1
        return {
            "format": names.FORMAT,
            "layout": self.layout.name,
            "fps": self.layout.fps,
            "skeleton": self.layout.skeleton.name,
            "dim": self.layout.dim,
            "frames": self.frames,
            "clips": len(self.clips),
            "splits": {split: sum(clip.split == split for clip in self.clips) for split in SPLITS},
            "lengths": {split: dict(sorted(counts.items())) for split, counts in lengths.items()},
            "kinds": dict(sorted(kinds.items())),
            "captions": len({text for clip in self.clips for text in clip.captions}),
            "files": {},
        }

    def complete(self, statistics: tuple[Float32, Float32], manifest: Manifest) -> Manifest:
        """Write clips, statistics and manifest, and move the complete folder to its final path.

        Args:
            statistics: mean and deviation (D,).
            manifest: without the hashes of files.
        """
        with (self.work / names.CLIPS).open("w", encoding="utf-8") as lines:
            lines.writelines(clip.model_dump_json() + "\n" for clip in self.clips)
        mean, std = statistics
        np.savez(self.work / names.STATISTICS, mean=mean, std=std)
        files = {
            name: FileEntry(sha256=sha256_of(self.work / name), bytes=(self.work / name).stat().st_size)
            for name in names.FILES
        }
        manifest = manifest.model_copy(update={"files": files})
        (self.work / names.MANIFEST).write_text(manifest.model_dump_json(indent=1) + "\n", encoding="utf-8")
        if self.out.exists():
            self.out.rmdir()
        self.work.rename(self.out)
        return manifest


def _kind(clip: Clip) -> str:
    if clip.spliced:
        return "spliced" if len(clip.acts) > 1 else "looped"
    if clip.made:
        return "made"
    if clip.speed != 1:
        return "retimed"
    if clip.cropped:
        return "cropped"
    return "mirrored" if clip.mirrored else "captured"


def _raw_to_npy(raw: Path, path: Path, shape: tuple[int, ...], dtype: str) -> None:
    header = {"descr": dtype, "fortran_order": False, "shape": shape}
    with path.open("wb") as out, raw.open("rb") as data:
        np.lib.format.write_array_header_1_0(out, header)
        shutil.copyfileobj(data, out)
    raw.unlink()
