"""Prompts that a bundle performs well while it streams, as `python -m marey.models.mogo.examples` measured them.

Standard library only: the API offers them on its page `/live`.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import resources
from typing import Any

NAME = "examples.json"


def prompts_of(reference: str) -> list[str]:
    """The prompts of an exact bundle, the best first; none where it was not measured."""
    return [row["prompt"] for row in measured().get(reference, [])]


@cache
def measured() -> dict[str, list[dict[str, Any]]]:
    """The measurements of every bundle, by its exact reference."""
    return json.loads((resources.files(__package__ or "") / NAME).read_text(encoding="utf-8"))
