"""Matrices of a bundle in 8 bits: half the size of 16 bits.

A matrix W, whose first axis counts outputs, is stored as `<name>weight` in int8 and `<name>scale` (rows,) in float32;
their product, row by row, is W to half of 1/127 of the largest number of each row.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.bundles.bundle import STATISTICS, Bundle, Tensors
from marey.bundles.writer import BundleWriter
from marey.core.errors import InvalidBundle, InvalidInput

LEAST = 4096
"""Numbers of a matrix that is worth it."""


def quantize(matrix: NDArray[np.floating]) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Return a matrix (rows, …) in 8 bits and the scales of its rows (rows,)."""
    rows = matrix.astype(np.float32).reshape(len(matrix), -1)
    scale = np.maximum(np.abs(rows).max(axis=1) / 127, np.finfo(np.float32).tiny).astype(np.float32)
    return np.rint(rows / scale[:, None]).clip(-127, 127).astype(np.int8).reshape(matrix.shape), scale


def scale_of(name: str) -> str:
    """Return the name of the scales of the matrix `name`."""
    return name.removesuffix("weight") + "scale"


def restore(stored: Mapping[str, NDArray[np.generic]], *, where: str | None = None) -> Tensors:
    """Return tensors with their matrices of 8 bits as float32; others stay as they are.

    Args:
        stored: tensors of a part.
        where: the part, for errors.

    Raises:
        InvalidBundle: a matrix has no scales, or they do not fit it.
    """
    matrices = {name for name, value in stored.items() if value.dtype == np.int8 and name.endswith("weight")}
    scales = {scale_of(name) for name in matrices}
    restored: Tensors = {name: value for name, value in stored.items() if name not in matrices | scales}
    for name in sorted(matrices):
        value, scale = stored[name], stored.get(scale_of(name))
        if scale is None or scale.shape != value.shape[:1]:
            raise InvalidBundle(f"the matrix {name!r} of 8 bits does not fit its scales", where=where)
        rows = scale.astype(np.float32).reshape(-1, *[1] * (value.ndim - 1))
        restored[name] = np.multiply(value, rows, dtype=np.float32)
    return restored


def write_eight_bit(bundle: Bundle, output: Path, *, overwrite: bool = False) -> Bundle:
    """Write a copy of a bundle whose matrices have 8 bits; it makes other motions than the original.

    Args:
        bundle: verified, of a model whose networks are filled by `marey.nn.bundling.fill`.
        output: the new folder; its last name is the copy's.
        overwrite: replace an existing folder.

    Raises:
        InvalidInput: its matrices have 8 bits already.
        Conflict: the folder exists.
    """
    fields = bundle.manifest.model_dump(exclude={"parts", "files", "name"}, exclude_unset=True)
    shards = {shard for part in bundle.manifest.parts.values() for shard in part}
    with BundleWriter(output, overwrite=overwrite) as writer:
        for part in bundle.manifest.parts:
            tensors = bundle.tensors(part, dtype=None)
            if any(value.dtype == np.int8 for value in tensors.values()):
                raise InvalidInput("has matrices of 8 bits already", where=str(bundle.path))
            writer.add_part(part, tensors if part == STATISTICS else _quantized(tensors), dtype=None)
        for name in sorted(bundle.manifest.files.keys() - shards):
            writer.add_json(name, bundle.read_json(name))
        card = bundle.path / "README.md"
        if card.is_file():
            writer.add_card(card.read_text(encoding="utf-8"))
        return writer.finish(name=output.name, **fields)


def _quantized(tensors: Tensors) -> Tensors:
    kept: Tensors = {}
    for name, value in tensors.items():
        if name.endswith("weight") and value.dtype.kind == "f" and value.ndim > 1 and value.size >= LEAST:
            kept[name], kept[scale_of(name)] = quantize(value.astype(np.float32))
        else:
            kept[name] = value
    return kept
