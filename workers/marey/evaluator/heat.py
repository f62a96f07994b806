"""The heat map of a report: prompt checks by what was expected and by style."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from marey.evaluator.report import HeatCell
from marey.items.expected import JOIN


def heat_of(rows: Iterable[tuple[str | None, str, bool | None]]) -> tuple[HeatCell, ...]:
    """Cells of motions, each with what was expected of it, its style, and whether it obeys; what has no check is in
    none. Sequences stand together by how many acts they have: each alone would be a line of one motion."""
    cells: dict[tuple[str, str], list[bool]] = defaultdict(list)
    for expected, style, obeyed in rows:
        if expected is not None and obeyed is not None:
            acts = expected.split(f" {JOIN} ")
            cells[acts[0] if len(acts) == 1 else f"{len(acts)} acts in order", style].append(obeyed)
    return tuple(HeatCell(act, style, len(found), sum(found)) for (act, style), found in sorted(cells.items()))


def style_of(label: str) -> str:
    """Of a real clip's label."""
    return label.rpartition(", ")[2]
