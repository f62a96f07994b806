"""The body of a bundle: the skeleton of its training data, and the one that its motions have."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from marey.bundles.manifest import BundleManifest
from marey.core.errors import InvalidBundle
from marey.motion.body import NamedBody, standard_body
from marey.motion.body_files import read_body
from marey.motion.features import FeatureLayout, layout


def layout_of(manifest: BundleManifest) -> FeatureLayout:
    """Return the feature layout of a generator, with the skeleton of its training data.

    Raises:
        NotFound: an unknown layout.
        InvalidBundle: no layout, or offsets of another number of joints.
    """
    if manifest.layout is None:
        raise InvalidBundle("its manifest names no layout", where=manifest.name)
    known = layout(manifest.layout)
    if manifest.offsets is None:
        return known
    if len(manifest.offsets) != len(known.skeleton):
        raise InvalidBundle(
            f"its manifest has {len(manifest.offsets)} offsets; {known.name} has {len(known.skeleton)} joints",
            where=manifest.name,
        )
    return _with_offsets(manifest.layout, manifest.offsets)


def body_of(manifest: BundleManifest) -> NamedBody:
    """Return the body `standard` of a generator's bundle; see `layout_of` for errors."""
    return standard_body(layout_of(manifest).skeleton)


def read_body_for(manifest: BundleManifest, given: str, rig_map: Path | str | None = None) -> NamedBody:
    """Return the body `standard` of a generator's bundle, or that of a file; see `layout_of` and `read_body` for
    arguments and errors."""
    return read_body(given, layout_of(manifest).skeleton, rig_map)


@lru_cache(maxsize=16)
def _with_offsets(name: str, offsets: tuple[tuple[float, float, float], ...]) -> FeatureLayout:
    """Return a layout with other offsets; the layout itself where they are its own, so that fits are made once."""
    known = layout(name)
    given = np.array(offsets, np.float32)
    return known if np.array_equal(given, known.skeleton.offsets) else known.with_offsets(given)
