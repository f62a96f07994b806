"""Findings of `marey doctor`: the type that every check returns, and the checks that several share."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from typing import Literal

from marey.core.errors import MareyError

SMALLEST_FREE, LITTLE_FREE = 2 * 2**30, 10 * 2**30
"""Bytes: Postgres stops at a full disk, and 1,000 motions take 200 MB."""
State = Literal["ok", "warn", "bad"]


@dataclass(frozen=True)
class Finding:
    """One finding. `warn`: it works, or only some commands need it; `bad`: it has to be repaired."""

    name: str
    state: State
    message: str
    hint: str | None = None
    """The advice to the user; None where none is needed."""


def broken(name: str, error: MareyError) -> Finding:
    """Return the finding of a check that ended with an expected error."""
    return Finding(name, "bad", f"{error.where}: {error.message}" if error.where else error.message, error.hint)


def free_space(name: str, folder: os.PathLike[str]) -> Finding:
    """Check the free space of a folder's disk."""
    free = shutil.disk_usage(folder).free
    state = "bad" if free < SMALLEST_FREE else "warn" if free < LITTLE_FREE else "ok"
    hint = None if state == "ok" else "Make room: `marey admin gc` removes what nothing refers to."
    return Finding(name, state, f"{os.fspath(folder)}, {free / 2**30:.1f} GiB free", hint)
