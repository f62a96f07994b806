"""Files of a finished item. Standard library only: `marey generate` writes them without a database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ExportedFile:
    """One file of a motion or report, in memory: it goes to the asset store under its sha256."""

    format: str
    """`npz`, `bvh`, …: name in the URL `motions/{id}/files/{format}`; or `html`, `json`, `md`, in
    `evaluations/{id}/report/{format}`."""
    content: bytes
    media_type: str = "application/octet-stream"


@dataclass(frozen=True)
class Export:
    """Result of a finished item: its files and the columns of its motion row."""

    files: tuple[ExportedFile, ...]
    frames: int
    """Poses in the exported clip, at `fps`."""
    fps: float
    licence: str
    """SPDX name or short text of the licence of the weights."""
    manifest: Mapping[str, Any]
    """The JSON of the npz's `manifest`: prompt, rewritten prompt, graph, bundle, weights, seed, settings, licence."""
