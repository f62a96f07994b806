"""The Markdown: tables that stay tables, texts that stay texts."""

from __future__ import annotations

import dataclasses
import re

import pytest

from marey.evaluator.report import ArtifactReference, HeatCell, MetricRow, Report, to_markdown
from tests.support.reports import sample_report

HOSTILE = (
    "</script><script>alert(1)</script> | `a` \\| *b* _c_ [d](http://e.f) ![g](h) ~i~ $j$ #1 @k\n\n# title\n- item"
)


def hostile_report(report: Report) -> Report:
    exhibit = dataclasses.replace(report.worst[0], prompt=HOSTILE, reason=HOSTILE)
    rows = (*report.rows[:-1], MetricRow("exported", HOSTILE, HOSTILE, report.rows[-1].values))
    return dataclasses.replace(
        report,
        title=HOSTILE,
        generator=ArtifactReference(HOSTILE, HOSTILE),
        rows=rows,
        worst=(exhibit,),
        heat=(HeatCell(HOSTILE, HOSTILE, 3, 1),),
        settings={HOSTILE: HOSTILE},
        notes=(HOSTILE,),
        alarms=(HOSTILE,),
        comparability=HOSTILE,
    )


def cells_of(line: str) -> list[str]:
    return re.split(r"(?<!\\)(?:\\\\)*\|", line)[1:-1]


def tables_in(text: str) -> list[list[str]]:
    return [block.split("\n") for block in text.split("\n\n") if block.startswith("|")]


@pytest.mark.parametrize("make", [lambda report: report, hostile_report])
def test_every_row_of_a_table_has_as_many_cells_as_its_head(report: Report, make) -> None:
    tables = tables_in(to_markdown(make(report)).decode())
    assert len(tables) >= 6
    for table in tables:
        assert {len(cells_of(line)) for line in table} == {len(cells_of(table[0]))}
        assert re.fullmatch(r"\| ---:?( \| ---:?)* \|", table[1])
        assert all(not line.startswith("|---") and line.endswith("|") for line in table)


def test_no_text_becomes_markdown_or_html(report: Report) -> None:
    text = to_markdown(hostile_report(report)).decode()
    ours = re.sub(r"</?code>|<br>|(?<!\\)`[^`\n]*`", "", text)
    assert not re.search(r"(?<!\\)[<@$~]", ours)
    assert not re.search(r"(?<!\\)(?:\\\\)*\]\(", text)
    assert [line for line in text.split("\n") if line.startswith("# ")] == [text.split("\n", 1)[0]]
    assert "http://" not in text
    assert "\n- item" not in text


def test_a_text_that_would_begin_a_list_or_a_rule_stays_a_text(report: Report) -> None:
    notes = ("1. one", "---", "- two", "1.5 s")
    text = to_markdown(dataclasses.replace(report, notes=notes)).decode()
    assert text.endswith("- 1\\. one\n- \\---\n- \\- two\n- 1.5 s\n")


def test_the_outcome_comes_before_every_number(report: Report) -> None:
    blocks = to_markdown(report).decode().split("\n\n")
    assert blocks[2].startswith("> **Regressed.** Prompt adherence fell")
    assert all(not block.startswith("|") for block in blocks[:3])


def test_it_holds_missing_values_marks_and_the_caveat(report: Report) -> None:
    text = to_markdown(report).decode().replace("\u00a0", " ")
    assert "| not available [2] |" in text
    assert "- [2] this tokenizer cannot encode" in text
    assert "N 337, D 256: N \\< 5·D" in text
    assert "pools only" in text
    assert "not comparable with the numbers that papers print for HumanML3D" in text
    assert "| kick | 22/36 (61 %) | 17/36 (47 %) | – |" in text
    assert "`96a91328572de3541eb2499337627ffc969eb1b6d1157f84dbb1ccaf4bfe006f`" in text


def test_parts_without_content_have_no_heading(report: Report) -> None:
    bare = dataclasses.replace(report, heat=(), best=(), worst=(), trend=(), notes=(), speed=None)
    headings = [line for line in to_markdown(bare).decode().split("\n") if line.startswith("## ")]
    assert headings == ["## Numbers", "## How to repeat it"]


def test_equal_reports_give_equal_bytes() -> None:
    assert to_markdown(sample_report()) == to_markdown(sample_report())
