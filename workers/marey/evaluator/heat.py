"""Heat map of a report: prompt checks by expected action and by style."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from marey.evaluator.report import HeatCell
from marey.items.expected import JOIN


def heat_of(rows: Iterable[tuple[str | None, str, bool | None]]) -> tuple[HeatCell, ...]:
    """Return the heat map's cells of motions, each with its expected actions, style and verdict; motions without a
    check are skipped. Sequences are grouped by their number of actions."""
    cells: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for expected, style, obeyed in rows:
        if expected is not None and obeyed is not None:
            acts = expected.split(f" {JOIN} ")
            cells[acts[0] if len(acts) == 1 else f"{len(acts)} actions in order", style].append(obeyed)
    return tuple(HeatCell(act, style, len(found), sum(found)) for (act, style), found in sorted(cells.items()))


def style_of(label: str) -> str:
    """Return the style in a real clip's label."""
    return label.rpartition(", ")[2]
