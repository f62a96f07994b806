"""Tables of ablations: no row is trained and decoded as another one is."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import pytest

from marey.registry import get_model, model_names

MODULES = sorted({each.run.partition(":")[0] for name in model_names() for each in get_model(name).ablations})
TABLES = {
    f"{module} {name}": table
    for module in MODULES
    for name, table in vars(import_module(module)).items()
    if name.isupper() and isinstance(table, Mapping) and len(table) > 1 and " " in "".join(map(str, table))
}
"""Variants by the name of their row, which is a phrase."""


def test_ablations_have_tables() -> None:
    assert len(TABLES) > len(MODULES)


@pytest.mark.parametrize("table", TABLES.values(), ids=list(TABLES))
def test_rows_differ(table: Mapping[str, Any]) -> None:
    rows = list(table.values())
    assert not [(a, b) for i, a in enumerate(rows) for b in rows[i + 1 :] if a == b]
