"""The JSON: stable bytes, read back whole but for the clips."""

from __future__ import annotations

import dataclasses
import json
from datetime import UTC, datetime
from typing import Any

import hypothesis
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidFile, InvalidInput
from marey.evaluator.report import Change, Exhibit, MotionScore, Report, Value, from_json, to_json
from tests.support.reports import sample_report

BASE = sample_report()
FLOATS = st.floats(-1e12, 1e12, allow_nan=False)
TEXTS = st.text(max_size=40)
TIMES = st.datetimes(datetime(2000, 1, 1), datetime(2100, 1, 1), timezones=st.just(UTC))
VALUES = st.one_of(
    st.builds(
        Value, FLOATS, st.none() | st.floats(0, 1e9), st.integers(0, 10**6), TEXTS, st.none() | st.integers(1, 9999)
    ),
    st.builds(Value.missing, st.text(min_size=1, max_size=20).filter(str.strip)),
)
EXHIBITS = st.builds(Exhibit, TEXTS, st.integers(0, 2**31 - 1), st.booleans(), TEXTS, FLOATS)


def without_clips(report: Report) -> Report:
    def bare(exhibits: tuple[Exhibit, ...]) -> tuple[Exhibit, ...]:
        return tuple(dataclasses.replace(each, clip=None, score=rounded(each.score)) for each in exhibits)

    return dataclasses.replace(report, best=bare(report.best), worst=bare(report.worst))


def rounded(number: float) -> float:
    return float(f"{number:.6g}")


def test_a_report_is_read_back_without_its_clips(report: Report) -> None:
    points = [
        dataclasses.replace(point, values={key: rounded(value) for key, value in point.values.items()})
        for point in report.trend
    ]
    assert from_json(to_json(report)) == dataclasses.replace(without_clips(report), trend=tuple(points))


@hypothesis.settings(deadline=None, max_examples=40)
@given(
    texts=st.tuples(TEXTS, TEXTS, TEXTS),
    created=TIMES,
    values=st.lists(VALUES, min_size=1, max_size=4),
    exhibits=st.lists(EXHIBITS, max_size=6),
    settings=st.dictionaries(TEXTS, st.none() | st.booleans() | st.integers() | FLOATS | TEXTS, max_size=4),
)
def test_any_report_is_read_back_as_it_was_written(
    texts: tuple[str, str, str],
    created: datetime,
    values: list[Value],
    exhibits: list[Exhibit],
    settings: dict[str, Any],
) -> None:
    base = BASE
    row = dataclasses.replace(base.rows[-1], values=dict(zip(("r1", "fid", "obeyed", "jerk"), values, strict=False)))
    report = dataclasses.replace(
        base,
        title=texts[0],
        licence=texts[1],
        notes=texts,
        created=created,
        rows=(*base.rows[:-1], row),
        worst=tuple(exhibits),
        settings=settings,
    )
    data = to_json(report)
    again = from_json(data)
    assert to_json(again) == data
    assert (again.title, again.notes, again.created, again.settings) == (texts[0], texts, created, settings)
    for key, value in row.values.items():
        mean = None if value.mean is None else rounded(value.mean)
        half = None if value.half_width is None else rounded(value.half_width)
        assert again.row(row.key).values[key] == dataclasses.replace(value, mean=mean, half_width=half)


@hypothesis.settings(deadline=None, max_examples=40)
@given(before=FLOATS, moved=st.floats(1e-9, 1e6))
def test_a_change_too_small_for_the_written_digits_is_read_back_all_the_same(before: float, moved: float) -> None:
    after = before + moved
    verdict = "better" if after > before else "no difference found"
    change = Change("r1", "last run", before, after, 0.0, 2 * moved, verdict)
    report = dataclasses.replace(BASE, changes=(change,))
    assert from_json(to_json(report)).changes[0].verdict == verdict


def test_the_document_names_its_schema_and_holds_no_clip(report: Report) -> None:
    document = json.loads(to_json(report))
    assert (document["schema"], document["version"]) == ("marey.evaluation-report", 1)
    assert document["created"] == "2026-11-23T05:40:00Z"
    assert document["worst"][0] == {
        "prompt": "a person kicks",
        "seed": 7,
        "passed": False,
        "reason": "no foot rises over the knee in front of the body",
        "score": -0.04,
    }


def test_each_motions_scores_are_a_line_and_read_back(report: Report) -> None:
    data = to_json(report)
    assert b'\n    {"index": 0, "variant": 1, "obeyed": 1.0, "retrieved": 0.25},\n' in data
    assert from_json(data).scores == report.scores
    timeline = (MotionScore(0, 0, None, None, 0.5),)
    written = to_json(sample_report(scores=timeline))
    assert b'"retrieved": null, "rows_shown": 0.5}' in written
    assert from_json(written).scores == timeline
    assert from_json(to_json(sample_report(scores=()))).scores == ()


def test_settings_keep_every_digit() -> None:
    settings = {"learning_rate": 0.12345678901234567, "seeds": [1, 2]}
    assert from_json(to_json(sample_report(settings=settings))).settings == settings


def test_equal_reports_give_equal_bytes() -> None:
    assert to_json(sample_report()) == to_json(sample_report())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "other"}, "not a report of an evaluation"),
        ({"version": 2}, "version 2; this Marey reads version 1"),
        ({"motions": "many"}, "motions: 'many' is not a whole number"),
        ({"rows": 3}, "rows: 3 is not a list"),
        ({"created": "yesterday"}, "created: 'yesterday' is not a time"),
    ],
)
def test_a_document_that_is_none_is_refused_with_the_field(
    report: Report, change: dict[str, Any], message: str
) -> None:
    document = {**json.loads(to_json(report)), **change}
    with pytest.raises(InvalidFile, match=message):
        from_json(json.dumps(document).encode())


def test_a_missing_field_broken_json_and_nan_are_refused(report: Report) -> None:
    document = json.loads(to_json(report))
    del document["generator"]
    with pytest.raises(InvalidFile, match="generator: is missing"):
        from_json(json.dumps(document).encode())
    for data in (b"{", b"[]", b"\xff", b"[" * 100_000):
        with pytest.raises(InvalidFile):
            from_json(data)
    with pytest.raises(InvalidFile, match="holds a number that is not finite"):
        from_json(to_json(report).replace(b'"motions_per_second": 1.42', b'"motions_per_second": NaN'))


def test_a_contradiction_in_the_document_is_refused(report: Report) -> None:
    document = {**json.loads(to_json(report)), "regressed": False}
    with pytest.raises(InvalidInput, match="regressed"):
        from_json(json.dumps(document).encode())
