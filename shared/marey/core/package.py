"""The installed package of this code."""

from __future__ import annotations

from functools import cache


@cache
def own_version() -> str:
    """Return the version of Marey: the metadata is read once in a process, at the first call."""
    from importlib.metadata import version  # 15 to 100 ms, which most commands need not spend

    return version("marey")
