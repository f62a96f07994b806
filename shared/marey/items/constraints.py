"""Constraints of a motion: a path, poses and targets that it keeps to. Standard library only."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, cast

from marey.core.errors import InvalidInput


def read_constraints(value: object) -> list[dict[str, Any]]:
    """Return the constraints of an item.

    Raises:
        InvalidInput: not a list of objects.
    """
    if not isinstance(value, list | tuple) or not all(
        isinstance(each, Mapping) for each in cast("list[object]", value)
    ):
        raise InvalidInput('is not a list of objects: write [{"type": "root_path", …}]')
    return [dict(each) for each in cast("Sequence[Mapping[str, Any]]", value)]
