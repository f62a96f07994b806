"""The parts of the page that are text and tables, in the order in which a person reads them."""

from __future__ import annotations

import json

from marey.evaluator.report.markup import Markup, element, join
from marey.evaluator.report.model import Report
from marey.evaluator.report.parts import HeatCell, Metric
from marey.evaluator.report.tables import (
    Cell,
    Heat,
    Line,
    Table,
    heat_of,
    in_percent,
    share,
    tables_of,
    weakest_of,
)
from marey.evaluator.report.words import CHANGES, LEGEND, direction, headline, intervals_of, moment

ARROWS = {"higher": "↑", "lower": "↓", "": ""}
MOST_STYLES = 8
"""Columns of the heat map that have room to spare; more stand closer together, their names upright."""
RAMP = (0.2, 0.4, 0.6, 0.8, 0.95)
"""Shares passed at which a cell of the heat map gets paler; the last step begins where a bar of 95 % would be met."""


def section(title: str, *children: str, **attributes: str) -> Markup:
    """A part of the page; nothing at all when it has no content."""
    content = join(*children)
    return element("section", element("h2", title), content, **attributes) if content else Markup("")


def top(report: Report) -> Markup:
    """Which evaluation this is."""
    failed = f", {report.failed} failed and count nowhere" if report.failed else ""
    facts = [
        report.generator.name,
        f"{report.prompts} prompts, {report.motions} motions{failed}",
        f"on {report.source.name}",
        f"licence of the weights {report.licence}",
        moment(report.created),
    ]
    return element(
        "header",
        element("p", f"Marey · evaluation {report.evaluation}", class_="overline"),
        element("h1", report.title),
        element("ul", *(element("li", fact) for fact in facts), class_="facts"),
    )


def verdict(report: Report) -> Markup:
    """What changed: regressed or not, and why."""
    head = headline(report)
    others = [element("p", sentence) for sentence in head.more]
    sign = {"worse": "▼", "same": "✓", "unknown": "○"}[head.kind]
    return element(
        "section",
        element("h2", element("span", sign, class_="sign", aria_hidden="true"), head.word),
        element("p", head.sentence),
        *others,
        class_=f"verdict {head.kind}",
        id="verdict",
    )


def numbers(report: Report) -> Markup:
    """The tables, what ± is over, with what the numbers may be compared, and what the metrics are."""
    tables = [_table(number, table, report.source.name) for number, table in enumerate(tables_of(report), start=1)]
    told = [f"{LEGEND} {intervals_of(report.repeats)}", *([CHANGES] if report.changes else []), report.comparability]
    under = [element("p", sentence, class_="remark") for sentence in told]
    return section("Numbers", *tables, *under, _glossary(report.metrics), id="numbers")


def wide(label: str, *children: Markup) -> Markup:
    """What may be wider than the window: it scrolls by itself, with the keyboard too."""
    return element("div", *children, class_="wide", tabindex=0, role="region", aria_label=label)


def _table(number: int, table: Table, source: str) -> Markup:
    elsewhere = ", but where a column names other data" if any(m.measured_on for m in table.metrics) else ""
    by, on = element("b", table.measured_by), element("b", source)
    head = element("tr", element("td", ""), *(_column(metric) for metric in table.metrics))
    body = join(*(_line(line, number) for line in table.lines))
    notes = [element("li", text, id=_note(number, mark), value=mark) for mark, text in table.footnotes]
    return join(
        element("p", "Measured by ", by, " on ", on, elsewhere, class_="caption"),
        wide(
            f"Measured by {table.measured_by} on {source}",
            element("table", element("thead", head), element("tbody", body), class_="numbers"),
        ),
        element("ol", *notes, class_="notes") if notes else "",
    )


def _column(metric: Metric) -> Markup:
    way = direction(metric)
    arrow = element("span", ARROWS[metric.better], title=way, aria_label=way, role="img") if way else ""
    under = [f"on {metric.measured_on}" if metric.measured_on else "", metric.unit]
    small = [element("small", line) for line in under if line]
    return element("th", metric.label, Markup("&nbsp;") if way else "", arrow, *small, scope="col")


def _note(table: int, mark: int) -> str:
    """The id of a footnote: the same one may stand under several tables."""
    return f"note-{table}-{mark}"


def _line(line: Line, table: int) -> Markup:
    label = element("th", line.label, element("small", line.note) if line.note else "", scope="row")
    kind = "judged" if line.judged else line.of
    return element("tr", label, *(_cell(cell, line.of, table) for cell in line.cells), class_=kind)


def _cell(cell: Cell, of: str, table: int) -> Markup:
    if cell.kind == "blank":
        return element("td", element("span", "–", aria_label="does not apply", role="img"), class_="blank")
    marks = [element("sup", element("a", str(mark), href=f"#{_note(table, mark)}")) for mark in cell.marks]
    number = element("span", cell.text, class_="number")
    if of == "changes":
        parts = [number, element("span", cell.detail, class_="word"), element("small", cell.interval)]
    else:
        # In a narrow window the interval stands under its number: the marks stay with what ends the line.
        behind = [element("span", " ", cell.interval, *marks, class_="interval")] if cell.interval else marks
        parts = [number, *behind, element("small", cell.detail) if cell.detail else ""]
    return element("td", *parts, class_=cell.kind)


def _glossary(metrics: tuple[Metric, ...]) -> Markup:
    told = [metric for metric in metrics if metric.explanation]
    if not told:
        return Markup("")
    terms = [
        join(element("dt", m.name), element("dd", m.explanation, f" ({direction(m)})" if m.better else ""))
        for m in told
    ]
    return element("details", element("summary", "What the metrics mean"), element("dl", *terms, class_="glossary"))


def heat(report: Report) -> Markup:
    """Where it fails: prompt checks by action and style."""
    found = heat_of(report)
    if not found.cells:
        return Markup("")
    styles = [element("th", element("span", style), scope="col") for style in (*found.styles, "all")]
    head = element("tr", element("td", ""), *styles)
    rows = [_heat_row(found, act) for act in found.acts]
    sums = [_heat_cell(found.total(style=style), "sum") for style in found.styles]
    foot = element("tr", element("th", "all", scope="row"), *sums, _heat_cell(found.total(), "sum"))
    parts = (element("thead", head), element("tbody", *rows), element("tfoot", foot))
    told = "Motions that passed the check of their prompt, of those tried; the stronger the colour, the more failed."
    label, weakest = "Prompt checks by action and style", weakest_of(found)
    return section(
        label,
        element("p", weakest) if weakest else "",
        element("p", told, class_="caption"),
        wide(label, element("table", *parts, class_="heat" if len(found.styles) <= MOST_STYLES else "heat many")),
        id="heat",
    )


def _heat_row(found: Heat, act: str) -> Markup:
    cells = [_heat_cell(found.cell(act, style)) for style in found.styles]
    return element("tr", element("th", act, scope="row"), *cells, _heat_cell(found.total(act=act), "sum"))


def _heat_cell(cell: HeatCell | None, also: str = "") -> Markup:
    if cell is None or not cell.trials:
        return element("td", element("span", "–", aria_label="not tried", role="img"), class_=f"blank {also}".strip())
    step = sum(share(cell) >= bound for bound in RAMP)
    return element(
        "td", f"{cell.passed}/{cell.trials}", element("small", in_percent(cell)), class_=f"heat-{step} {also}".strip()
    )


def speed(report: Report) -> Markup:
    """How fast motions came."""
    return section("Generation speed", element("p", speed_of(report)) if report.speed else "", id="speed")


def repeat(report: Report) -> Markup:
    """How to repeat it: command, hashes, settings, versions; and what else is to be known."""
    given = (("generator", report.generator), ("evaluator", report.evaluator), ("data", report.source))
    hashes = [
        (
            label,
            join(each.name, " ", element("code", each.sha256)) if each else Markup("none: joints alone were measured"),
        )
        for label, each in given
    ]
    settings = [(name, element("code", plain(value))) for name, value in report.settings.items()]
    software = [(name, element("code", version)) for name, version in report.software.items()]
    command = element("pre", element("code", report.command)) if report.command else ""
    lists = [_facts("What ran", hashes), _facts("Settings", settings), _facts("Software", software)]
    notes = element("ul", *(element("li", note) for note in report.notes)) if report.notes else ""
    return join(section("How to repeat it", command, *lists, id="repeat"), section("Notes", notes, id="notes"))


def _facts(title: str, rows: list[tuple[str, Markup]]) -> Markup:
    if not rows:
        return Markup("")
    facts = element("dl", *(join(element("dt", name), element("dd", value)) for name, value in rows), class_="settings")
    return join(element("h3", title), facts)


def speed_of(report: Report) -> str:
    """`1.42 motions a second, 9.80 s a motion (median), 1 worker`; empty when it was not measured."""
    if report.speed is None:
        return ""
    rate, median = report.speed.motions_per_second, report.speed.median_seconds_per_motion
    note = f", {report.speed.note}" if report.speed.note else ""
    return f"{rate:.3g} motions a second, {median:.3g} s a motion (median){note}"


def plain(value: object) -> str:
    """A setting as a person types it."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
