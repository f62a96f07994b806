"""Items of files of prompts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from marey.client.rows import read_file, right_items
from marey.items.item import Item


def items_of(path: str | Path, **options: Any) -> list[Item]:
    """All items of a file; see `read_file`."""
    return list(right_items(read_file(str(path), **options)))
