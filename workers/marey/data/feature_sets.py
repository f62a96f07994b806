"""Data sets that are published as features of one layout, with their own splits: each becomes a prepared folder by
itself, since sets of different layouts cannot be combined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Protocol

from marey.data.manifest import Manifest
from marey.data.snapmogen import TERMS as SNAPMOGEN
from marey.data.snapmogen import prepare_snapmogen


class PrepareFeatures(Protocol):
    """Function that writes a prepared folder from a published one."""

    def __call__(self, path: Path, out: Path, *, progress: Callable[[int, int], None] | None = None) -> Manifest: ...


FEATURE_SETS: Mapping[str, PrepareFeatures] = {SNAPMOGEN.name: prepare_snapmogen}
"""By the name of the source."""
