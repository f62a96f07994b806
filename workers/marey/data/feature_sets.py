"""Data sets that are published as features of one layout, with their own splits: each becomes a prepared folder by
itself, since sets of different layouts cannot be combined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Protocol

from marey.data.manifest import Manifest
from marey.data.snapmogen import TERMS as SNAPMOGEN
from marey.data.snapmogen import prepare_snapmogen
from marey.data.t2m_folder import CMP_SET, HUMANML3D_SET, KIT_SET, prepare_t2m


class PrepareFeatures(Protocol):
    """Function that writes a prepared folder from a published one."""

    def __call__(self, path: Path, out: Path, *, progress: Callable[[int, int], None] | None = None) -> Manifest: ...


FEATURE_SETS: Mapping[str, PrepareFeatures] = {
    SNAPMOGEN.name: prepare_snapmogen,
    **{kind.terms.name: partial(prepare_t2m, kind) for kind in (HUMANML3D_SET, KIT_SET, CMP_SET)},
}
"""By the name of the source."""
