"""A folder of published files: finding its parts, and reading them with an account of what was read."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.arrays import check_array, read_npy
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.hashing import sha256_of
from marey.importing.checkpoint import Account, Checkpoint
from marey.importing.fields import Fields, read_json_fields, read_options, read_yaml
from marey.importing.torch_files import load_array

Statistics = tuple[NDArray[np.float32], NDArray[np.float32]]
AGAIN = "Unpack the download as it is, and name the folder that holds this file."


class Download:
    """The folder that is imported. Files are read through it, and `finish` accounts for all of them."""

    def __init__(self, folder: Path, *, inside: Sequence[str] = ()) -> None:
        """Open a folder.

        Args:
            folder: as given by the user.
            inside: folders of the published layout that may lie in it, or that it may be: of `checkpoints/t2m` the user
                may name the folder that holds `checkpoints`, `checkpoints`, or `checkpoints/t2m`.

        Raises:
            NotFound: there is no such folder.
            InvalidInput: it is a file.
        """
        if not folder.is_dir():
            if folder.exists():
                raise InvalidInput("is a file, not the folder of the download", where=str(folder), hint=AGAIN)
            raise NotFound("there is no such folder", where=str(folder), hint="Name the folder of the download.")
        self.folder = folder
        self.root = next((folder / path for path in _tails(inside) if (folder / path).is_dir()), folder)
        self._accounts: dict[Path, Account] = {}
        self._checkpoints: dict[Path, Checkpoint] = {}

    def find(self, *patterns: str, what: str, within: Path | None = None) -> Path:
        """Return the only file or folder of the first pattern that has one.

        Args:
            patterns: relative to the published folder, with `*` for names that depend on a configuration; `..` reaches
                folders beside it.
            what: the part, for errors.
            within: a folder that was found before, which patterns are relative to; None = the published folder.

        Raises:
            NotFound: no pattern has one; lists where it was looked for.
            InvalidInput: a pattern has several.
        """
        base = within or self.root
        for pattern in patterns:
            found = sorted(_matches(base, pattern))
            if len(found) > 1:
                names = ", ".join(path.name for path in found[:5])
                raise InvalidInput(
                    f"has several of {what}: {names}",
                    where=str(base / pattern),
                    hint="Move those aside that are not to be imported.",
                )
            if found:
                return found[0]
        looked = " or ".join(patterns)
        raise NotFound(f"{what} is missing: there is no {looked}", where=str(base), hint=AGAIN)

    def has(self, *patterns: str) -> bool:
        """Return True if a pattern has a file or folder."""
        return any(True for pattern in patterns for _ in _matches(self.root, pattern))

    def checkpoint(self, file: Path) -> Checkpoint:
        """Open a checkpoint; `finish` refuses tensors of it that are neither taken nor ignored. See `Checkpoint`."""
        if file not in self._checkpoints:
            self._checkpoints[file] = Checkpoint.open(file, shown=self._shown(file))
        return self._checkpoints[file]

    def options(self, file: Path) -> Fields:
        """Read an `opt.txt`; see `read_options` for errors."""
        found = read_options(file)
        self.note(file)
        return found

    def yaml(self, file: Path) -> Fields:
        """Read a YAML file; see `read_yaml` for errors."""
        found = read_yaml(file)
        self.note(file)
        return found

    def json(self, file: Path) -> Fields:
        """Read a JSON file; see `read_json_fields` for errors."""
        found = read_json_fields(file)
        self.note(file)
        return found

    def statistics(self, folder: Path, width: int, *, ending: str = "npy") -> Statistics:
        """Read `mean` and `std`, each (width,), with the ending of numpy's files (`npy`) or of torch's (`pt`).

        Raises:
            NotFound: one is missing.
            InvalidFile: of another shape, not finite, or a deviation that is not above 0.
        """
        mean, std = (self.array(folder / f"{name}.{ending}", (width,)).astype(np.float32) for name in ("mean", "std"))
        if not (std > 0).all():
            where = str(folder / f"std.{ending}")
            raise InvalidFile("holds deviations that are not above 0", where=where, hint=AGAIN)
        return mean, std

    def array(self, file: Path, shape: tuple[int | None, ...]) -> NDArray[np.floating]:
        """Read an npy file of finite numbers, or a `.pt` file of one tensor of them; None = any length of this axis.

        Raises:
            NotFound: it is missing.
            InvalidFile: of another shape or kind, damaged, or pickled.
        """
        stored = load_array(file) if file.suffix == ".pt" else read_npy(file, hint=AGAIN)
        found = check_array(stored, "array", str(file), kinds="f", shape=shape, hint=AGAIN)
        self.note(file)
        return found

    def note(self, file: Path, *, used: Sequence[str] = ()) -> None:
        """Add a file that was read otherwise to the account."""
        self._accounts[file] = Account(self._shown(file), file.stat().st_size, sha256_of(file), tuple(used))

    def finish(self) -> tuple[Account, ...]:
        """Return the account of every file that was read, in order of reading.

        Raises:
            InvalidFile: a checkpoint holds tensors that were neither taken nor ignored; lists them.
        """
        checkpoints = (checkpoint.finish() for checkpoint in self._checkpoints.values())
        return (*checkpoints, *self._accounts.values())

    def _shown(self, file: Path) -> str:
        return file.relative_to(self.folder).as_posix() if file.is_relative_to(self.folder) else file.name


def _matches(base: Path, pattern: str) -> list[Path]:
    if "*" in pattern:
        return [*base.glob(pattern)]
    path = base / pattern
    return [path] if path.exists() else []


def _tails(inside: Sequence[str]) -> list[str]:
    """Each path and its ends: of `checkpoints/t2m` also `t2m`."""
    return ["/".join(parts[at:]) for path in inside for parts in [path.split("/")] for at in range(len(parts))]
