"""The tables as words: marks, footnotes, changes, heat map."""

from __future__ import annotations

import dataclasses

import pytest

from marey.evaluator.report import HeatCell, Metric, Report
from marey.evaluator.report.tables import heat_of, in_percent, tables_of, trended, weakest_of


def lines(report: Report, table: int = 0):
    return {line.label: line for line in tables_of(report)[table].lines}


def test_numbers_of_different_evaluators_never_share_a_table(report: Report) -> None:
    other = Metric("t2m", "FID", measured_by="t2m@1")
    tables = tables_of(dataclasses.replace(report, metrics=(*report.metrics, other)))
    network = report.metrics[0].measured_by
    assert [table.measured_by for table in tables] == [network, network, "joints, without a network", "t2m@1"]
    for table in tables:
        assert {metric.measured_by for metric in table.metrics} == {table.measured_by}


def test_real_motion_and_reconstruction_stand_in_every_table_others_only_with_a_number(report: Report) -> None:
    shown = [[line.label for line in table.lines if line.of == "values"] for table in tables_of(report)]
    assert shown == [
        ["ground truth", "reconstruction", "label-level ceiling", "raw", "exported"],
        ["ground truth", "reconstruction", "label-level ceiling", "raw", "exported"],
        ["ground truth", "reconstruction", "exported"],
    ]


def test_many_columns_are_cut_into_tables_that_a_window_shows_and_none_is_lost(report: Report) -> None:
    names = [f"m{number}" for number in range(17)]
    metrics = tuple(Metric(name, name, measured_by="a@1") for name in names)
    bare = dataclasses.replace(report, metrics=(*report.metrics, *metrics))
    cut = [[metric.key for metric in table.metrics] for table in tables_of(bare) if table.measured_by == "a@1"]
    assert [len(keys) for keys in cut] == [6, 6, 5]
    assert [key for keys in cut for key in keys] == names


def test_a_table_in_which_nothing_was_compared_has_no_line_of_changes(report: Report) -> None:
    told = [[line.label for line in table.lines if line.of == "changes"] for table in tables_of(report)]
    last, pinned = "change against the last run", "change against the pinned baseline"
    assert told == [[last, pinned], [last], [last, pinned]]


def test_a_missing_value_is_marked_and_its_footnote_says_why(report: Report) -> None:
    table = tables_of(report)[1]
    cell = lines(report, 1)["reconstruction"].cells[-1]
    assert (cell.kind, cell.text) == ("missing", "not available")
    assert dict(table.footnotes)[cell.marks[0]] == "this tokenizer cannot encode clips of the compositional split"


def test_a_metric_that_makes_no_sense_for_a_row_is_blank_not_missing(report: Report) -> None:
    assert lines(report)["label-level ceiling"].cells[3].kind == "blank"


def test_fid_prints_n_and_d_and_is_marked_with_few_motions(report: Report) -> None:
    cell = lines(report)["exported"].cells[3]
    assert cell.detail.replace("\u00a0", " ") == "N 337, D 256: N < 5·D"
    (note,) = [text for mark, text in tables_of(report)[0].footnotes if mark in cell.marks]
    assert "fewer than 5·D = 1280" in note
    assert "never a reason for an alarm" in note


def test_fid_of_many_motions_prints_n_and_d_without_a_mark(report: Report) -> None:
    value = dataclasses.replace(report.row("exported").values["fid"], n=1280)
    row = dataclasses.replace(report.row("exported"), values={"fid": value})
    rows = tuple(row if r.key == "exported" else r for r in report.rows)
    cell = lines(dataclasses.replace(report, rows=rows))["exported"].cells[3]
    assert (cell.detail.replace("\u00a0", " "), cell.marks) == ("N 1280, D 256", ())


def test_equal_footnotes_have_one_number(report: Report) -> None:
    marks = {line.cells[3].marks for line in tables_of(report)[0].lines if line.cells[3].detail}
    assert len(marks) == 1


def test_changes_stand_right_under_the_judged_row_with_arrow_word_and_interval(report: Report) -> None:
    table = tables_of(report)[2]
    labels = [line.label for line in table.lines]
    at = labels.index("exported")
    assert labels[at + 1 : at + 3] == ["change against the last run", "change against the pinned baseline"]
    fell, risen, same, blank = table.lines[at + 1].cells
    assert (fell.kind, fell.text, fell.detail, fell.interval) == ("worse", "↓ −6.3", "worse", "−9.8 to −2.9")
    assert (risen.kind, risen.text, risen.detail) == ("better", "↓ −0.7", "better")
    assert (same.kind, same.text, same.detail) == ("same", "↑ +1", "no difference found")
    assert blank.kind == "blank"


def test_places_never_tried_are_empty_and_count_in_no_sum(report: Report) -> None:
    heat = heat_of(report)
    assert heat.cell("kick", "elderly") is None
    assert heat.total(act="kick").trials == 5 * 36
    assert heat.total(style="elderly").trials == 6 * 36
    assert heat.total().passed == sum(cell.passed for cell in report.heat)


def test_a_cell_without_trials_is_one_that_was_never_tried(report: Report) -> None:
    heat = heat_of(dataclasses.replace(report, heat=(HeatCell("walk", "normal", 0, 0),)))
    assert heat.cell("walk", "normal") is None
    assert weakest_of(heat) == ""


def test_the_weakest_places_are_named_but_not_those_of_one_or_two_trials(report: Report) -> None:
    cells = (HeatCell("bow", "active", 2, 0), HeatCell("kick", "", 12, 3), HeatCell("walk", "", 12, 12))
    assert weakest_of(heat_of(dataclasses.replace(report, heat=cells))) == "Weakest: kick 3 of 12."


@pytest.mark.parametrize(
    ("passed", "trials", "text"),
    [(0, 9, "0 %"), (1, 900, "1 %"), (899, 900, "99 %"), (900, 900, "100 %"), (1, 2, "50 %")],
)
def test_none_and_all_are_said_of_none_and_all_alone(passed: int, trials: int, text: str) -> None:
    assert in_percent(HeatCell("walk", "", trials, passed)) == text


def test_a_trend_shows_the_last_thirty_runs(report: Report) -> None:
    point = report.trend[0]
    runs, metrics = trended(dataclasses.replace(report, trend=(point,) * 50))
    assert len(runs) == 30
    assert [metric.key for metric in metrics] == ["r1", "kid", "obeyed", "skate"]
