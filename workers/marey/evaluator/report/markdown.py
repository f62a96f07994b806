"""The report as GitHub Markdown: for pull requests, pages of results, mail."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from marey.evaluator.report.model import Report
from marey.evaluator.report.parts import Exhibit, HeatCell
from marey.evaluator.report.shots import shots_of
from marey.evaluator.report.tables import Cell, Heat, Line, Table, heat_of, in_percent, tables_of, trended, weakest_of
from marey.evaluator.report.words import (
    CHANGES,
    LEGEND,
    day,
    headline,
    intervals_of,
    moment,
    number,
    plain,
    score_of,
    speed_of,
)
from marey.viz.paper import one_line

ROWS_OF_TREND = 8  # the page has all
# Characters that could start emphasis, code, a link, a picture, HTML, a column, a formula, an issue or a mention.
_SPECIAL = re.compile(r"([\\`*_\[\]<>&|~$#@])|(?<=\w)(:)(?=//)|(?<=\bwww)(\.)|^([-+=]|\d+[.)](?=\s|$))", re.IGNORECASE)


def to_markdown(report: Report) -> bytes:
    """Encode the file. Equal reports give equal bytes."""
    head = headline(report)
    blocks = [
        f"# {_text(report.title)}",
        _facts(report),
        "\n".join(
            [f"> **{head.word}.** {_text(head.sentence)}", *(f">\n> {_text(sentence)}" for sentence in head.more)]
        ),
        "## Numbers",
        *(block for table in tables_of(report) for block in _table(table, report.source.name)),
        _text(f"{LEGEND} {intervals_of(report.repeats)}"),
        _text(CHANGES) if report.changes else "",
        _text(report.comparability),
        *_heat(heat_of(report)),
        *_shots(report),
        *_exhibits("Worst clips", report.worst, report.ranked_by),
        *_exhibits("Best clips", report.best, report.ranked_by),
        *_trend(report),
        *_repeat(report),
        *_notes(report.notes),
    ]
    return ("\n\n".join(block for block in blocks if block) + "\n").encode()


def _text(value: str) -> str:
    """Escape any text as one line: nothing in it is Markdown or HTML."""
    return _SPECIAL.sub(lambda found: "\\" + found[0] if not found[4] else _item(found[4]), one_line(value))


def _item(begin: str) -> str:
    """Escape the beginning of a list: `1\\.`, `\\-`."""
    return f"{begin[:-1]}\\{begin[-1]}"


def _code(value: str) -> str:
    """Format any text as code; not every renderer can escape a backtick or a table's bar between backticks."""
    line = one_line(value)
    if not line:
        return ""
    return f"<code>{_text(line)}</code>" if re.search(r"[`|\\]", line) else f"`{line}`"


def _rows(head: Sequence[str], rows: Iterable[Sequence[str]], *, left: int = 1) -> str:
    align = ["---"] * left + ["---:"] * (len(head) - left)
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, align, *rows])


def _facts(report: Report) -> str:
    failed = f", {report.failed} failed and are not counted" if report.failed else ""
    facts = [
        f"Evaluation {_text(report.evaluation)}, {moment(report.created)}",
        f"{_code(report.generator.name)} (weights {_text(report.licence)})",
        f"{report.prompts} prompts, {report.motions} motions{failed}",
        f"on {_text(report.source.name)}",
    ]
    return " · ".join(facts)


def _table(table: Table, source: str) -> list[str]:
    arrows = {"higher": " ↑", "lower": " ↓", "": ""}
    units = [f" ({_text(m.unit)})" if m.unit else "" for m in table.metrics]
    head = ["", *(f"{_text(m.name)}{u}{arrows[m.better]}" for m, u in zip(table.metrics, units, strict=True))]
    notes = "\n".join(f"- [{mark}] {_text(text)}" for mark, text in table.footnotes)
    return [
        f"Measured by **{_text(table.measured_by)}** on **{_text(source)}**.",
        _rows(head, [_line(line) for line in table.lines]),
        notes,
    ]


def _line(line: Line) -> list[str]:
    label = _text(line.label)
    if line.of == "changes":
        return [f"↳ {label}<br>{_text(line.note)}", *(_cell(cell, line.of) for cell in line.cells)]
    label = f"**{label}**" if line.judged else label
    return [f"{label}<br>{_text(line.note)}" if line.note else label, *(_cell(cell, line.of) for cell in line.cells)]


def _cell(cell: Cell, of: str) -> str:
    if cell.kind == "blank":
        return "–"
    marks = "".join(f" [{mark}]" for mark in cell.marks)
    if of == "changes":
        return f"{cell.text} **{cell.detail}**<br>{cell.interval}"
    interval = f" {cell.interval}" if cell.interval else ""
    return f"{cell.text}{interval}{marks}" + (f"<br>{_text(cell.detail)}" if cell.detail else "")


def _heat(heat: Heat) -> list[str]:
    if not heat.cells:
        return []
    rows = [
        [_text(act), *(_place(heat.cell(act, style)) for style in heat.styles), _place(heat.total(act=act))]
        for act in heat.acts
    ]
    rows.append(["**all**", *(_place(heat.total(style=style)) for style in heat.styles), _place(heat.total())])
    head = ["passed of tried", *(_text(style) for style in heat.styles), "**all**"]
    return ["## Prompt checks by action and style", _text(weakest_of(heat)), _rows(head, rows)]


def _shots(report: Report) -> list[str]:
    blocks: list[str] = []
    for section in shots_of(report.timelines, report.constraints):
        tables = (
            _rows(
                [_text(name) for name in each.head],
                [[_text(cell) for cell in row] for row in each.rows],
                left=each.left,
            )
            for each in section.tables
        )
        blocks += [f"## {section.title}", _text(section.sentence), *tables]
    return blocks


def _place(cell: HeatCell | None) -> str:
    return f"{cell.passed}/{cell.trials} ({in_percent(cell)})" if cell and cell.trials else "–"


def _exhibits(title: str, exhibits: Sequence[Exhibit], ranked_by: str) -> list[str]:
    if not exhibits:
        return []
    rows = [
        [f"“{_text(e.prompt)}”", "passed" if e.passed else "**failed**", _text(e.reason), str(e.seed), score_of(e)]
        for e in exhibits
    ]
    ranked = f"Ranked by {_text(ranked_by)}." if ranked_by else ""
    return [f"## {title}", ranked, _rows(["prompt", "check", "reason", "seed", "score"], rows, left=3)]


def _trend(report: Report) -> list[str]:
    runs, metrics = trended(report)
    if not metrics:
        return []
    rows = [
        [
            f"{day(run.finished)}, {_text(run.evaluation)}",
            _code(run.bundle),
            *(number(run.values[m.key], m) if m.key in run.values else "–" for m in metrics),
        ]
        for run in reversed(runs[-ROWS_OF_TREND:])
    ]
    return ["## Trends", _rows(["run", "bundle", *(_text(m.name) for m in metrics)], rows, left=2)]


def _repeat(report: Report) -> list[str]:
    given = [("generator", report.generator), ("evaluator", report.evaluator), ("data", report.source)]
    rows = [[label, f"{_code(each.name)} {_code(each.sha256)}"] for label, each in given if each]
    rows += [[_text(name), _code(plain(value))] for name, value in report.settings.items()]
    rows += [[_text(name), _code(version)] for name, version in report.software.items()]
    if report.speed:
        rows.insert(0, ["speed", _text(speed_of(report))])
    command = f"    {one_line(report.command)}" if report.command else ""
    return ["## How to repeat it", command, _rows(["what", "value"], rows, left=2)]


def _notes(notes: Sequence[str]) -> list[str]:
    return ["## Notes", "\n".join(f"- {_text(note)}" for note in notes)] if notes else []
