"""`python -m tests.chaos.figures FOLDER`: the reports of chaos runs as Markdown tables."""

from __future__ import annotations

import json
import statistics
import sys
from collections import defaultdict
from pathlib import Path
from typing import Any


def recovery_table(reports: list[dict[str, Any]]) -> list[str]:
    """Seconds until work went on, by fault: all samples, and those that no other fault fell into."""
    found: dict[tuple[str, str], list[dict[str, Any]]] = defaultdict(list)
    for report in reports:
        for sample in report["samples"]:
            found[sample["fault"], sample["until"]].append(sample)
    lines = ["| fault | until | alone: median | worst | N | all: median | worst | N |", "|---" * 8 + "|"]
    for (fault, until), samples in sorted(found.items()):
        alone = _figures([sample["seconds"] for sample in samples if sample["alone"]])
        lines.append(f"| {fault} | {until} | {alone} | {_figures([sample['seconds'] for sample in samples])} |")
    return lines


def bar_table(reports: list[dict[str, Any]]) -> list[str]:
    """Faults of silence against their bars: samples that no other fault fell into, and all."""
    found: dict[tuple[str, str, float], list[dict[str, Any]]] = defaultdict(list)
    for report in reports:
        for sample in report["samples"]:
            if sample.get("bar") is not None:
                found[sample["fault"], sample["until"], sample["bar"]].append(sample)
    lines = ["| fault | until | bar | alone: worst | above | N | all: worst | above | N |", "|---" * 9 + "|"]
    for (fault, until, bar), samples in sorted(found.items()):
        columns = [
            _against(bar, [sample["seconds"] for sample in some])
            for some in ([sample for sample in samples if sample["alone"]], samples)
        ]
        lines.append(f"| {fault} | {until} | {bar:g} s | {' | '.join(columns)} |")
    return lines


def _against(bar: float, seconds: list[float]) -> str:
    worst = f"{max(seconds):.1f} s" if seconds else ""
    return f"{worst} | {sum(each > bar for each in seconds)} | {len(seconds)}"


def run_table(reports: list[dict[str, Any]]) -> list[str]:
    """Events of the runs, one column per run."""
    rows = {
        "items accepted, jobs": lambda r: f"{r['items']:,}, {r['jobs']}",
        "succeeded": lambda r: f"{r['states'].get('succeeded', 0):,}",
        "failed, dead, cancelled": lambda r: ", ".join(
            str(r["states"].get(state, 0)) for state in ("failed", "dead", "cancelled")
        ),
        "transitions": lambda r: f"{r['transitions']:,}",
        "items of lost leases": lambda r: f"{r['items_of_lost_leases']:,}",
        "faults": lambda r: sum(r["faults"].values()),
        "submits asked again": lambda r: r["asked_again"],
        "submits refused for a quota": lambda r: sum(sum(by.values()) for by in r["refused"].values()),
        "operator's verbs": lambda r: sum(r["verbs"].values()),
        "webhook events, messages": lambda r: f"{r['webhook_events']}, {r['webhook_messages']}",
        "looks at the quotas": lambda r: f"{r['quota_looks']:,}",
        "processes that ended by themselves": lambda r: sum(r["ended_by_themselves"].values()),
        "bars missed, alone": lambda r: sum("another fault" not in line for line in r.get("bars_missed", [])),
        "minutes": lambda r: f"{r['seconds'] / 60:.0f}",
        "audit": lambda r: "nothing wrong" if not r["wrong"] else f"{len(r['wrong'])} wrong",
    }
    head = "| | " + " | ".join(f"seed {report['seed']}" for report in reports) + " |"
    lines = [head, "|---" * (len(reports) + 1) + "|"]
    return lines + [f"| {name} | " + " | ".join(str(tell(r)) for r in reports) + " |" for name, tell in rows.items()]


def _figures(seconds: list[float]) -> str:
    if not seconds:
        return " | | 0"
    return f"{statistics.median(seconds):.1f} s | {max(seconds):.1f} s | {len(seconds)}"


def main(folder: Path) -> None:
    """Print the tables, and which bars were missed."""
    reports = [json.loads(path.read_text()) for path in sorted(folder.glob("seed-*.json"))]
    print("\n".join([*run_table(reports), "", *recovery_table(reports), "", *bar_table(reports)]))
    for report in reports:
        for line in report.get("bars_missed", []):
            print(f"seed {report['seed']}: bar missed: {line}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
