"""The page for operators and the dashboard name the metrics that there are."""

from __future__ import annotations

import json
import re
from pathlib import Path

from marey.core.metrics import PARTS

REPOSITORY = Path(__file__).resolve().parents[2]
NAME = re.compile(r"\bmarey_[a-z_]+\b")
HISTOGRAM = re.compile(r"_(bucket|sum|count)$")


def metric_names() -> set[str]:
    """Names of all metrics, as they stand in an exposition."""
    return {
        metric.name + ("_total" if metric.type == "counter" else "")
        for registry in PARTS.values()
        for metric in registry.collect()
        if metric.name.startswith("marey_")
    }


def test_every_metric_has_its_row_in_the_page_for_operators_and_no_other() -> None:
    lines = (REPOSITORY / "docs" / "how-to" / "operations.md").read_text().splitlines()
    rows = [line for line in lines if line.startswith("| `marey_")]
    documented = [name for row in rows for name in NAME.findall(row.split("|")[1])]
    assert sorted(documented) == sorted(metric_names())


def test_the_dashboard_asks_for_metrics_that_there_are() -> None:
    dashboard = json.loads((REPOSITORY / "deploy" / "grafana" / "marey.json").read_text())
    queries = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    asked = {HISTOGRAM.sub("", name) for query in queries for name in NAME.findall(query)}
    assert asked <= metric_names()
    assert len(asked) >= 15
