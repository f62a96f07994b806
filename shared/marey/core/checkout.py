"""The source checkout that the code runs from, if any."""

from __future__ import annotations

from pathlib import Path


def checkout() -> Path | None:
    """The root of the checkout; None where the code is an installed wheel."""
    portion = Path(__file__).resolve().parents[2]
    root = portion.parent
    return root if portion.name == "shared" and (root / "pyproject.toml").is_file() else None
