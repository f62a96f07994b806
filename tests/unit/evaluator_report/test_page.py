"""The page: what is in it, and what cannot get out of it. A real browser opens it in tests/clients."""

from __future__ import annotations

import base64
import dataclasses
import json
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser

import numpy as np
import pytest

from marey.evaluator.report import (
    ArtifactReference,
    Baseline,
    Exhibit,
    HeatCell,
    Metric,
    MetricRow,
    Report,
    TrendPoint,
    Value,
    from_json,
    to_html,
    to_json,
)
from marey.evaluator.report.templates import PACKAGE
from marey.viz.pages import asset
from tests.support.policies import policy_hashes
from tests.support.reports import UNMEASURED, sample_report
from tests.support.walker import walker

HOSTILE = (
    "</script><script>alert(1)</script><!-- %SCRIPTS% %POLICY% -->\" ' & \u202e\u2028 <img src=x onerror=alert(1)>"
)


@dataclass
class Page(HTMLParser):
    """The elements of a page as a browser would see them."""

    html: str
    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    code: dict[str, list[str]] = field(default_factory=lambda: {"script": [], "style": []})
    words: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()
        self._open = ""
        self.feed(self.html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open = tag
        self.elements.append((tag, dict(attrs)))
        if tag in self.code:
            self.code[tag].append("")

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open in self.code:
            self.code[self._open][-1] += data
        else:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", "".join(self.words))

    def attributes(self, name: str) -> list[str]:
        return [str(given[name]) for _, given in self.elements if name in given]

    @property
    def policy(self) -> str:
        return next(str(a["content"]) for tag, a in self.elements if tag == "meta" and a.get("http-equiv"))

    @property
    def motion(self) -> dict[str, list[dict[str, object]]]:
        at = [given for tag, given in self.elements if tag == "script"].index(
            {"type": "application/json", "id": "motion"}
        )
        return json.loads(self.code["script"][at])


@pytest.fixture(scope="module")
def page(report: Report) -> Page:
    return Page(to_html(report).decode())


def hostile(report: Report) -> Report:
    """Every text of the report is an attack."""
    metrics = tuple(
        dataclasses.replace(m, label=HOSTILE, explanation=HOSTILE, unit=HOSTILE if m.unit else "")
        for m in report.metrics
    )
    return dataclasses.replace(
        report,
        title=HOSTILE,
        evaluation=HOSTILE,
        generator=ArtifactReference(HOSTILE, HOSTILE),
        licence=HOSTILE,
        source=ArtifactReference(HOSTILE, HOSTILE),
        comparability=HOSTILE,
        metrics=metrics,
        rows=tuple(MetricRow(r.key, HOSTILE, HOSTILE, r.values) for r in report.rows),
        baselines=tuple(Baseline(b.against, HOSTILE, HOSTILE, b.finished) for b in report.baselines),
        alarms=(HOSTILE,) * len(report.alarms),
        trend=tuple(TrendPoint(t.finished, HOSTILE, f"{HOSTILE}{t.bundle}", t.values) for t in report.trend),
        heat=tuple(HeatCell(f"{HOSTILE}{c.act}", f"{HOSTILE}{c.style}", c.trials, c.passed) for c in report.heat),
        ranked_by=HOSTILE,
        worst=tuple(dataclasses.replace(e, prompt=HOSTILE, reason=HOSTILE) for e in report.worst),
        best=tuple(dataclasses.replace(e, prompt=HOSTILE) for e in report.best),
        command=HOSTILE,
        settings={HOSTILE + key: HOSTILE for key in report.settings},
        software={HOSTILE + key: HOSTILE for key in report.software},
        notes=(HOSTILE,) * len(report.notes),
    )


def test_a_text_stays_a_text_whatever_is_in_it(report: Report, page: Page) -> None:
    attacked = Page(to_html(hostile(report)).decode())
    assert [tag for tag, _ in attacked.elements] == [tag for tag, _ in page.elements]
    assert attacked.code == page.code
    assert attacked.policy == page.policy
    assert attacked.text.count("<img src=x onerror=alert(1)>") > 30
    assert "\u202e" not in attacked.html


def test_no_attribute_runs_code_and_nothing_is_fetched(report: Report) -> None:
    page = Page(to_html(hostile(report)).decode())
    for tag, attributes in page.elements:
        assert tag not in {"img", "iframe", "object", "embed", "base", "form"}
        assert not {"src", "srcdoc", "action", "style"} & set(attributes)
        assert not [name for name in attributes if name.startswith("on")]
        assert re.fullmatch(r"data:,|#[a-z0-9-]+", attributes.get("href") or "#x")
    assert not re.search(r"@import|url\(", "".join(page.code["style"]))


def test_the_policy_names_each_script_and_style_of_the_page_and_nothing_else(page: Page) -> None:
    policy = dict(part.split(" ", 1) for part in page.policy.split("; "))

    scripts = [code for code in page.code["script"] if not code.startswith('{"bodies"')]
    assert len(scripts) == 6
    assert policy["default-src"] == "'none'"
    assert policy["script-src"].split() == policy_hashes(scripts)
    assert policy["style-src"].split() == policy_hashes(page.code["style"])
    assert policy["img-src"] == "data:"
    assert "unsafe" not in page.policy


def test_no_mark_of_the_template_is_left(page: Page) -> None:
    assert not re.search(r"%[A-Z]{4,}%", page.html)


@pytest.mark.parametrize(("name", "package"), [("report.js", PACKAGE), ("small_players.js", "marey.viz")])
def test_no_text_is_ever_read_as_html_or_as_code(name: str, package: str) -> None:
    code = asset(name, package)
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function", code)
    assert not re.search(r"</script|<!--", code)


def test_ids_are_unique_and_every_link_leads_somewhere(page: Page) -> None:
    ids = page.attributes("id")
    assert len(ids) == len(set(ids))
    links = {link[1:] for link in page.attributes("href") if link.startswith("#")}
    assert {"note-1-1", "note-2-2", "verdict", "numbers", "heat", "worst", "trends", "repeat"} <= links <= set(ids)
    assert {name for names in page.attributes("aria-labelledby") for name in names.split()} <= set(ids)


def test_a_footnote_of_two_tables_stands_under_each_with_an_id_of_its_own(report: Report) -> None:
    rows = tuple(
        dataclasses.replace(row, values={**row.values, "skate": Value.missing(UNMEASURED)})
        if row.key == "reconstruction"
        else row
        for row in report.rows
    )
    page = Page(to_html(dataclasses.replace(report, rows=rows)).decode())
    ids = [name for name in page.attributes("id") if name.startswith("note-")]
    assert ids == ["note-1-1", "note-2-2", "note-3-2"]
    assert {f"#{name}" for name in ids} <= set(page.attributes("href"))


def test_what_changed_comes_first_then_numbers_then_where_it_fails_then_how_to_repeat_it(page: Page) -> None:
    parts = [a["id"] for tag, a in page.elements if tag == "section"]
    assert parts == ["verdict", "numbers", "heat", "worst", "best", "trends", "speed", "repeat", "notes"]
    assert page.text.index("Regressed") < page.text.index("Measured by")


def test_missing_values_marks_and_caveats_are_on_the_page(page: Page) -> None:
    text = page.text.replace("\u00a0", " ")
    assert "not available" in text
    assert "this tokenizer cannot encode clips of the compositional split" in text
    assert "N 337, D 256: N < 5·D" in text
    assert "pools only: 3 generated the motions anew" in text
    assert "not comparable with the numbers that papers print for HumanML3D" in text
    assert "Measured by evaluator-starter@5f0c2b7d91ae on test split" in text


def test_change_and_heat_are_said_in_words_not_by_colour_alone(page: Page) -> None:
    text = page.text
    for said in ("↓ −6.3", "worse", "↑ +0.031", "better", "no difference found", "3/36", "8 %"):
        assert said in text
    heat = page.html[page.html.index('class="heat"') : page.html.index("</tfoot>")]
    assert heat.count("<td") == 9 * 7 + 1  # and the corner
    assert heat.count('aria-label="not tried"') == 2
    assert re.search(r'<td class="heat-0">3/36<small>8 %</small></td>', heat)
    assert re.search(r'<td class="heat-5">36/36<small>100 %</small></td>', heat)


def test_the_players_hold_the_motions_and_three_js_once(report: Report, page: Page) -> None:
    assert len([a for _, a in page.elements if a.get("class") == "player"]) == 4
    assert page.attributes("data-clip") == ["0", "1", "2", "3"]
    entries = page.motion["clips"]
    shown = [*report.worst, *report.best]
    for entry, exhibit in zip(entries, shown, strict=True):
        assert exhibit.clip is not None
        root = np.frombuffer(base64.b64decode(str(entry["root"])), "<f4").reshape(-1, 3)
        np.testing.assert_array_equal(root, exhibit.clip.root)
    assert len(page.motion["bodies"]) == 1
    assert page.html.count("three.js 0.187.0, Copyright") == 1
    assert "Permission is hereby granted, free of charge" in page.html


def test_the_same_clip_may_be_among_the_best_and_the_worst(report: Report) -> None:
    only = report.worst[:1]
    page = Page(to_html(dataclasses.replace(report, worst=only, best=only)).decode())
    assert page.attributes("data-clip") == ["0", "1"]
    assert len(page.motion["clips"]) == 2


def test_a_report_read_back_has_a_small_page_without_players(report: Report) -> None:
    page = to_html(from_json(to_json(report)))
    assert b"a person kicks" in page
    assert b"<canvas" not in page
    assert b"WebGLRenderer" not in page
    assert len(page) < 100_000


def test_twelve_clips_of_ten_seconds_stay_under_a_megabyte_and_a_half() -> None:
    clip = walker(seconds=9.75)
    assert clip.frames == 196
    page = to_html(sample_report(worst=[clip] * 6, best=[clip] * 6))
    assert 1_000_000 < len(page) < 1_500_000


def test_parts_without_content_are_left_out() -> None:
    bare = sample_report(heat=(), trend=(), notes=(), speed=None, command="")
    page = Page(to_html(bare).decode())
    assert [a["id"] for tag, a in page.elements if tag == "section"] == ["verdict", "numbers", "repeat"]


def test_a_report_of_joints_alone_names_no_evaluator() -> None:
    metric = Metric("skate", "Foot skate", "%", "lower", 1)
    rows = (
        MetricRow("ground_truth", "ground truth"),
        MetricRow("reconstruction", "reconstruction"),
        MetricRow("exported", "exported"),
    )
    bare = sample_report(
        metrics=(metric,), rows=rows, changes=(), trend=(), baselines=(), regressed=None, alarms=(), evaluator=None
    )
    text = Page(to_html(bare).decode()).text
    assert "Not compared" in text
    assert "none: joints alone were measured" in text


def test_equal_reports_give_equal_bytes() -> None:
    def made() -> bytes:
        return to_html(sample_report(worst=[walker()], best=[walker(turn=0.3)]))

    assert made() == made()


def test_an_exhibit_says_whether_its_check_passed_and_why_not(report: Report) -> None:
    failed = Exhibit("a person kicks", 3, False, "no foot rises", -0.5)
    text = Page(to_html(dataclasses.replace(report, worst=(failed,))).decode()).text
    assert "✕ failed: no foot rises" in text
    assert "seed 3 · score −0.500" in text
