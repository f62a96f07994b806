"""The report of an evaluation in a real browser: it plays its clips, follows the theme, prints, runs no prompt."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from marey.evaluator.port import Evaluator
from marey.evaluator.report import Change, HeatCell, Report, Value, to_html
from marey.evaluator.report.tables import tables_of
from marey.evaluator.scoring import metrics_of
from marey.measures.comparing import OBEYED, RETRIEVED
from tests.support import chromium
from tests.support.reports import sample_report
from tests.support.tab import Tab, open_tab
from tests.support.walker import walker

pytestmark = pytest.mark.slow

HOSTILE = "</script><script>document.documentElement.dataset.taken='yes'</script><img src=x onerror=alert(1)>"
FRAMES = "[...document.querySelectorAll('.player')].map((box) => Number(box.dataset.frame ?? -1))"
WIDER = (
    "[...document.querySelectorAll('.wide')].filter((box) => box.scrollWidth > box.clientWidth).map((b) => b.ariaLabel)"
)
STILL = """const media = window.matchMedia;
window.matchMedia = (query) => query.includes("reduced-motion") ? { matches: true } : media.call(window, query);"""
PICTURE = """(() => {{
  const {{ width, height }} = document.querySelectorAll('.player canvas')[{0}];
  const pen = new OffscreenCanvas(width, height).getContext('2d');
  pen.drawImage(document.querySelectorAll('.player canvas')[{0}], 0, 0);
  return {{ width, height, data: [...pen.getImageData(0, 0, width, height).data] }};
}})()"""


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with open_tab(chromium.find(tmp_path_factory.mktemp("browser"))) as tab:
        yield tab


@pytest.fixture
def report() -> Report:
    return sample_report(worst=[walker(turn=0.7, prompt="one")], best=[walker(seconds=1, fps=30, prompt="two")])


def opened(tab: Tab, report: Report, folder: Path, *, before: str = "") -> None:
    page = folder / "report.html"
    page.write_bytes(to_html(report))
    tab.complaints.clear()
    tab.prefer("light")
    tab.size(1200, 900)
    tab.go(page.as_uri(), before=before)


def picture(tab: Tab, index: int) -> np.ndarray:
    seen = tab.ask(PICTURE.format(index))
    return np.array(seen["data"]).reshape(seen["height"], seen["width"], 4)


def coloured(image: np.ndarray) -> tuple[int, int]:
    """Pixels of the figure's left side, blue, and of its right side, orange."""
    return int((image[..., 2] - image[..., 0] > 60).sum()), int((image[..., 0] - image[..., 2] > 60).sum())


def test_the_joints_on_the_screen_are_the_clips(tab: Tab, report: Report, tmp_path: Path) -> None:
    opened(tab, report, tmp_path)
    for index, exhibit in enumerate((*report.worst, *report.best)):
        assert exhibit.clip is not None
        tab.ask(f"marey.seek({index}, 0.5)")
        off = np.array(tab.ask(f"marey.joints({index})")) - exhibit.clip.joints[round(0.5 * exhibit.clip.fps)]
        assert np.linalg.norm(off, axis=-1).max() < 1e-3
        assert min(coloured(picture(tab, index))) > 100
    assert tab.complaints == []


def test_a_clip_plays_when_it_comes_into_view_and_not_before(tab: Tab, report: Report, tmp_path: Path) -> None:
    opened(tab, report, tmp_path)
    assert tab.ask(FRAMES) == [-1, -1]
    tab.ask("document.querySelector('#worst').scrollIntoView()")
    tab.wait(f"{FRAMES}[0] > 2")
    assert tab.complaints == []


def test_a_person_who_asks_for_less_motion_gets_a_still_picture_and_a_button(
    tab: Tab, report: Report, tmp_path: Path
) -> None:
    opened(tab, report, tmp_path, before=STILL)
    tab.ask("document.querySelector('#worst').scrollIntoView()")
    tab.wait(f"{FRAMES}[0] === 0")
    tab.ask("document.querySelector('.play').click()")
    tab.wait(f"{FRAMES}[0] > 2")


def test_pages_and_players_follow_the_theme(tab: Tab, report: Report, tmp_path: Path) -> None:
    opened(tab, report, tmp_path)
    tab.ask("marey.seek(0, 0.5)")
    light = picture(tab, 0)
    tab.click("theme")
    assert tab.ask("document.documentElement.dataset.theme") == "dark"
    tab.ask("marey.seek(0, 0.5)")
    dark = picture(tab, 0)
    assert light[5, 5, :3].min() > 200
    assert dark[5, 5, :3].max() < 60
    assert tab.complaints == []


def with_all_columns(report: Report) -> Report:
    """The report with every column that an evaluation over both splits has, and a number in each place."""

    class Network:
        name = "evaluator-starter@5f0c2b7d91ae"

    metrics = metrics_of(cast("Evaluator", Network()), ("test", "compositional"))
    values = {metric.key: Value(88.8888, 0.44444, 928, dimensions=128) for metric in metrics}
    rows = tuple(dataclasses.replace(row, values=values) for row in report.rows)
    change = Change(OBEYED, "last run", 94.4, 88.8, -9.8, -2.9, "worse")
    changes = (change, dataclasses.replace(change, metric=RETRIEVED, low=-9.8, high=0.1, verdict="no difference found"))
    styles = ("active", "childish", "elderly", "exhausted", "feminine", "happy", "masculine", "normal", "not-confident")
    heat = [
        HeatCell(act, style, 105, 100) for act in ("2 actions in order", "walk") for style in (*styles, "sad", "giant")
    ]
    return dataclasses.replace(report, metrics=metrics, rows=rows, changes=changes, trend=(), heat=tuple(heat))


@pytest.mark.parametrize("width", [1280, 1000])
def test_tables_of_every_metric_need_no_sideways_scrolling(
    tab: Tab, report: Report, tmp_path: Path, width: int
) -> None:
    full = with_all_columns(report)
    opened(tab, full, tmp_path)
    tab.size(width, 900)
    assert tab.ask(WIDER) == []
    assert tab.ask("document.querySelectorAll('#numbers table').length") == len(tables_of(full)) > 4


def test_in_a_narrow_window_the_name_of_a_row_stays_beside_its_numbers(
    tab: Tab, report: Report, tmp_path: Path
) -> None:
    opened(tab, with_all_columns(report), tmp_path)
    tab.size(420, 800, phone=True)
    assert len(tab.ask(WIDER)) > 0
    for part in ("#numbers", "#heat"):
        tab.ask(f"document.querySelector('{part} .wide').scrollLeft = 200")
        head, box = (
            tab.ask(f"document.querySelector('{part} .wide {of}').getBoundingClientRect().left")
            for of in ("tbody th", "tbody td:last-child")
        )
        assert head == pytest.approx(tab.ask(f"document.querySelector('{part} .wide').getBoundingClientRect().left"))
        assert box > head


def test_on_a_phone_nothing_but_tables_is_wider_than_the_screen(tab: Tab, report: Report, tmp_path: Path) -> None:
    opened(tab, report, tmp_path)
    tab.size(400, 800, phone=True)
    assert tab.ask("document.documentElement.scrollWidth") == 400


def test_printing_draws_every_clip_on_white_paper(tab: Tab, report: Report, tmp_path: Path) -> None:
    opened(tab, report, tmp_path)
    tab.click("theme")
    tab.call("Page.printToPDF")
    assert min(min(coloured(picture(tab, index))) for index in (0, 1)) > 100
    assert tab.ask("document.documentElement.dataset.theme") == "dark"
    assert tab.complaints == []


def test_a_hostile_prompt_is_shown_and_does_nothing(tab: Tab, report: Report, tmp_path: Path) -> None:
    worst = (dataclasses.replace(report.worst[0], prompt=HOSTILE, reason=HOSTILE),)
    opened(tab, dataclasses.replace(report, worst=worst, title=HOSTILE), tmp_path)
    assert tab.ask("document.documentElement.dataset.taken ?? null") is None
    assert tab.ask("document.querySelector('#worst .prompt').textContent") == HOSTILE
    assert tab.ask("document.querySelector('h1').textContent") == HOSTILE
    assert tab.ask("document.querySelectorAll('img').length") == 0
    assert tab.complaints == []


def test_without_webgl_the_page_says_so_and_keeps_its_text(tab: Tab, report: Report, tmp_path: Path) -> None:
    blind = "HTMLCanvasElement.prototype.getContext = () => null;"
    opened(tab, report, tmp_path, before=blind)
    assert tab.text("failure").startswith("This browser shows no WebGL")
    assert tab.ask("[...document.querySelectorAll('.player')].every((box) => box.hidden)")
    assert "Regressed" in tab.text("verdict")
