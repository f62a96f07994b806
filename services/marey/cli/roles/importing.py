"""Import of published weights, for `marey models import`."""

from __future__ import annotations

from pathlib import Path

from marey.core.extras import extra


def import_weights(
    kind: str, folder: Path, output: Path, *, text_encoder: Path | None, licence: str | None, overwrite: bool
) -> str:
    """Import published weights, and return the exact reference of their bundle; see `run_import` for errors."""
    with extra("worker"):
        from marey.importing import run_import
    made = run_import(kind, folder, output, text_encoder=text_encoder, licence=licence, overwrite=overwrite)
    return made.reference
