"""Prompts for measuring the reader of actions, beside those of single actions in `marey.referee`."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any


def sequence_prompts() -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return prompts of several actions, with these in their order."""
    return tuple((each["text"], tuple(each["actions"])) for each in _table()["sequence"])


def outside_prompts() -> tuple[str, ...]:
    """Return prompts for what no action of the vocabulary covers."""
    return tuple(_table()["outside"])


@cache
def _table() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("reader_prompts.toml").read_text("utf-8"))
