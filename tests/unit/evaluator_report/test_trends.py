"""The plots: drawn for one run, for many, for equal values, with gaps; told in words too."""

from __future__ import annotations

import re
from datetime import timedelta
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.evaluator.report import TrendPoint
from marey.evaluator.report.templates import render
from marey.evaluator.report.trends import BOTTOM, HEIGHT, LEFT, RIGHT, TOP, WIDTH, describe, plot_of, ticks_of
from tests.support.reports import METRICS, MONDAY

R1 = METRICS[0]


def runs(*values: float | None, bundle: str = "b@1") -> list[TrendPoint]:
    return [
        TrendPoint(MONDAY + timedelta(weeks=k), str(k), bundle, {} if value is None else {"r1": value})
        for k, value in enumerate(values)
    ]


def drawn(points: list[TrendPoint]) -> ElementTree.Element:
    return ElementTree.fromstring(render("plot.svg.jinja", plot=plot_of("t", R1, points)))


def dots(picture: ElementTree.Element) -> list[tuple[float, float]]:
    found = [c for c in picture.iter("circle") if c.get("class") == "dot"]
    return [(float(c.attrib["cx"]), float(c.attrib["cy"])) for c in found]


def test_one_run_is_a_dot_in_the_middle() -> None:
    ((x, y),) = dots(drawn(runs(0.4)))
    assert x == pytest.approx((LEFT + RIGHT) / 2)
    assert TOP < y < BOTTOM


def test_equal_values_are_a_level_line_inside_the_plot() -> None:
    for value in (0.0, 0.4, -3.0, 1e9):
        heights = {y for _, y in dots(drawn(runs(value, value, value)))}
        assert len(heights) == 1
        assert TOP < heights.pop() < BOTTOM


def test_higher_values_stand_higher_and_later_runs_to_the_right() -> None:
    places = dots(drawn(runs(0.1, 0.3, 0.2)))
    assert [x for x, _ in places] == sorted(x for x, _ in places)
    assert places[1][1] < places[2][1] < places[0][1]


def test_a_run_without_the_metric_is_a_gap() -> None:
    picture = drawn(runs(0.1, 0.2, None, 0.3, 0.4))
    (path,) = [p.attrib["d"] for p in picture.iter("path")]
    assert len(dots(picture)) == 4
    assert re.sub(r"[^ML]", "", path) == "MLML"


def test_a_line_stands_where_another_bundle_begins() -> None:
    points = [*runs(0.1, 0.2), *(TrendPoint(MONDAY + timedelta(weeks=9), "9", "b@2", {"r1": 0.3}),)]
    (line,) = [e for e in drawn(points).iter("line") if e.get("class") == "bundle"]
    places = dots(drawn(points))
    assert places[1][0] < float(line.attrib["x1"]) < places[2][0]


def test_the_picture_is_told_in_words_and_each_run_on_a_tooltip() -> None:
    picture = drawn(runs(0.41, 0.36, 0.47))
    title, desc = picture.find("title"), picture.find("desc")
    assert title is not None
    assert desc is not None
    assert picture.attrib["role"] == "img"
    assert picture.attrib["aria-labelledby"].split() == [title.get("id"), desc.get("id")]
    assert desc.text == "3 runs from 23 Nov 2026 to 7 Dec 2026: from 0.410 to 0.470, lowest 0.360, highest 0.470."
    tooltips = [found.text for group in picture.iter("g") if (found := group.find("title")) is not None]
    assert tooltips[0] == "0.410 · b@1 · 23 Nov 2026, 05:40 UTC · evaluation 0"
    assert len(tooltips) == 3


def test_a_single_run_is_told_as_one() -> None:
    assert describe(R1, runs(0.4)) == "One run, 23 Nov 2026: 0.400."


@settings(deadline=None)
@given(st.lists(st.none() | st.floats(-1e12, 1e12, allow_nan=False), min_size=1, max_size=30))
def test_whatever_the_values_every_dot_is_inside_the_plot(values: list[float | None]) -> None:
    text = render("plot.svg.jinja", plot=plot_of("t", R1, runs(*values)))
    known = [value for value in values if value is not None]
    assert bool(text) is bool(known)
    if known:
        assert not re.search(r"\b(nan|inf)\b", text)
        places = dots(ElementTree.fromstring(text))
        assert len(places) == len(known)
        for x, y in places:
            assert 0 < x < WIDTH
            assert TOP - 0.1 <= y <= BOTTOM + 0.1 < HEIGHT


@settings(deadline=None)
@given(st.lists(st.floats(-1e12, 1e12, allow_nan=False), min_size=1, max_size=9))
def test_ticks_are_few_even_and_around_all_values(values: list[float]) -> None:
    ticks = ticks_of(values)
    assert 2 <= len(ticks) <= 6
    assert ticks[0] <= min(values) + 1e-12
    assert ticks[-1] >= max(values) - 1e-12


def test_ticks_are_round() -> None:
    assert ticks_of([0.36, 0.44]) == pytest.approx([0.35, 0.4, 0.45])
