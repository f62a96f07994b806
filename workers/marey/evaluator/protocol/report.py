"""The report of the protocol: a table for each evaluator, beside the papers' rows where they are of the same data."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

from marey.evaluator.metrics.intervals import repeated
from marey.evaluator.protocol.metrics import METRICS

PUBLISHED_BY = "t2m"
"""Kind of the evaluator behind the papers' rows."""
TITLES = {
    "r1": "R@1 ↑",
    "r2": "R@2 ↑",
    "r3": "R@3 ↑",
    "fid": "FID ↓",
    "mm_dist": "MM-Dist ↓",
    "clip_score": "CLIP score ↑",
    "diversity": "Diversity →",
    "mmodality": "MModality ↑",
}
REAL_NAME = "real motions"


@dataclass(frozen=True)
class TableRow:
    """A row: mean and half of the 95 % interval by metric; None = no interval is given.

    Attributes:
        name, source: what was measured, and who measured it.
        data: name of the data set.
        evaluator: exact bundle, or the kind that published it.
        values: by metric; metrics that were not measured are left out.
    """

    name: str
    source: str
    data: str
    evaluator: str
    values: Mapping[str, tuple[float, float | None]]


@lru_cache(maxsize=1)
def published_rows() -> tuple[TableRow, ...]:
    """Return the papers' rows."""
    text = files("marey.evaluator.protocol").joinpath("published.toml").read_text("utf-8")
    return tuple(
        TableRow(
            each["name"],
            each["source"],
            each["data"],
            PUBLISHED_BY,
            {name: (each[name][0], (each[name][1:] or [None])[0]) for name in METRICS if name in each},
        )
        for each in tomllib.loads(text)["row"]
    )


def measured_rows(found: Mapping[str, Any]) -> tuple[TableRow, ...]:
    """Return the rows of a run (`run_protocol`), evaluator by evaluator, with intervals over its repeats."""
    repeats: Sequence[Mapping[str, Any]] = found["repeats"]
    generator = found["generator"]
    made = f"{generator} with {_rewriter(found)}" if "rewriter" in found else generator
    names = {"real": REAL_NAME, "reconstructed": f"{generator}, tokenizer alone", "generated": made}
    rows: list[TableRow] = []
    for evaluator in found["evaluators"]:
        for kind in repeats[0][evaluator]:
            values = {name: [each[evaluator][kind][name] for each in repeats] for name in repeats[0][evaluator][kind]}
            intervals = {name: repeated(numbers) for name, numbers in values.items()}
            measured = {name: (each.mean, each.half_width) for name, each in intervals.items()}
            rows.append(TableRow(names[kind], "measured here", "+".join(found["data"]["names"]), evaluator, measured))
    return tuple(rows)


def document_of(found: Mapping[str, Any]) -> dict[str, Any]:
    """Return the report as JSON values: what was run, every repeat, and the rows."""
    rows = [{**vars(row), "values": {name: list(value) for name, value in row.values.items()}} for row in _rows(found)]
    return {**found, "rows": rows}


def markdown_of(found: Mapping[str, Any]) -> str:
    """Return the report as tables, one for each evaluator."""
    options = found["options"]
    repeats = len(found["repeats"])
    lines = [
        f"# {found['generator'] or 'Real motions'}, protocol of Guo et al. 2022",
        "",
        f"Split `{options['split']}` of {', '.join(found['data']['names'])} (features sha256 "
        f"`{found['data']['sha256'][:12]}`), {repeats} repeats, each generated anew, with 95 % intervals over the "
        f"repeats; retrieval in pools of {options['pool']} where the pair alone is a hit; MModality of "
        f"{options['prompts']} captions with {options['many']} motions each. Published sizes are 20 repeats, pools of "
        "32, and 30 motions of 96 captions.",
    ]
    if "rewriter" in found:
        captions, rewritten = (sum(each[name] for each in found["read"]) for name in ("captions", "rewritten"))
        lines += [
            "",
            f"{rewritten} of {captions} captions, counted in each repeat, were rewritten by {_rewriter(found)}; the "
            "others were read as written.",
        ]
    for evaluator in found["evaluators"]:
        rows = [row for row in _rows(found) if _beside(row, evaluator, found)]
        lines += ["", f"## By `{evaluator}`", "", *_table(rows)]
    if PUBLISHED_BY not in found["kinds"].values():
        lines += [
            "",
            "The papers' rows are by the T2M evaluator, which did not measure here: none compares with these.",
        ]
    return "\n".join(lines) + "\n"


def _rewriter(found: Mapping[str, Any]) -> str:
    rewriter = found["rewriter"]
    return f"{rewriter['name']} ({rewriter['model']})" if rewriter["model"] else rewriter["name"]


def _rows(found: Mapping[str, Any]) -> tuple[TableRow, ...]:
    names = found["data"]["names"]
    return (*measured_rows(found), *(row for row in published_rows() if names == [row.data]))


def _beside(row: TableRow, evaluator: str, found: Mapping[str, Any]) -> bool:
    """Return True for rows of an evaluator's table: papers' rows stand beside those of their own evaluator alone."""
    return evaluator == row.evaluator or found["kinds"][evaluator] == row.evaluator


def _table(rows: Sequence[TableRow]) -> list[str]:
    head = ["row", "from", *(TITLES[name] for name in METRICS)]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for row in rows:
        cells = [row.name, row.source, *(_shown(row.values.get(name)) for name in METRICS)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def _shown(value: tuple[float, float | None] | None) -> str:
    if value is None:
        return "-"
    mean, half = value
    return f"{mean:.3f}" if half is None else f"{mean:.3f} ± {half:.3f}"
