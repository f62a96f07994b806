"""The gallery in a real browser: it plays its motions, and buttons become commands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.viz.gallery import Card, EditNote, html_gallery
from tests.support import chromium
from tests.support.tab import Tab, open_tab
from tests.support.walker import walker

pytestmark = pytest.mark.slow

HOSTILE = "</script><script>document.documentElement.dataset.taken='yes'</script><img src=x onerror=alert(1)>"
COLOURED = """(() => {
  const canvas = document.querySelector('.player canvas');
  const pen = new OffscreenCanvas(canvas.width, canvas.height).getContext('2d');
  pen.drawImage(canvas, 0, 0);
  const { data } = pen.getImageData(0, 0, canvas.width, canvas.height);
  let blue = 0;
  for (let i = 0; i < data.length; i += 4) blue += data[i + 2] - data[i] > 60;
  return blue;
})()"""


@pytest.fixture(scope="module")
def tab(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with open_tab(chromium.find(tmp_path_factory.mktemp("browser"))) as tab:
        yield tab


def test_a_page_plays_its_motions_and_turns_clicks_into_commands(tab: Tab, tmp_path: Path) -> None:
    cards = [
        Card(
            f"id-{k}",
            walker(turn=0.4 * k),
            HOSTILE if k == 1 else "a person walks",
            f"0000{k} · seed {k}",
            ["shot=010"],
            flags=["floating", "popping"] if k == 1 else (),
        )
        for k in range(3)
    ]
    html_gallery(cards, tmp_path / "r.html", title=HOSTILE, count="1 to 3 of 9", later="r 2.html")
    tab.prefer("light")
    tab.size(1200, 900)
    tab.go((tmp_path / "r.html").as_uri())
    tab.ask("marey.seek(0, 1)")
    assert tab.ask(COLOURED) > 100  # the left side of the figure
    assert tab.ask("[...document.querySelectorAll('.prompt')].map((p) => p.textContent)") == [
        "a person walks", HOSTILE, "a person walks",
    ]  # fmt: skip
    assert tab.ask(
        "[...document.querySelectorAll('.flags')].map((p) => [...p.children].map((s) => s.textContent))"
    ) == [["floating", "popping"]]
    assert tab.ask("document.documentElement.dataset.taken ?? 'no'") == "no"
    assert tab.ask("document.getElementById('later').getAttribute('href')") == "./r%202.html"
    assert tab.ask("document.getElementById('wishes').hidden") is True
    for card, wish in ((0, "keep"), (2, "keep"), (1, "reroll"), (0, "reject"), (1, "reroll")):
        tab.ask(f"document.querySelectorAll('.clip')[{card}].querySelector('[data-wish={wish}]').click()")
    assert tab.ask("document.getElementById('commands').value.split('\\n')") == [
        "marey motions keep id-2", "marey motions reject id-0",
    ]  # fmt: skip
    assert tab.complaints == []


def test_an_edit_links_its_source_and_stands_beside_it(tab: Tab, tmp_path: Path) -> None:
    note = EditNote("id-0", HOSTILE, "trim (from 0.5), mirror")
    cards = [
        Card("id-0", walker(), HOSTILE, "00000"),
        Card("id-1", walker(turn=0.4), "a person walks to the right", "00001", edit=note),
        Card("id-2", walker(), "a person waves", "00002", edit=EditNote("gone", "", "smooth")),
    ]
    html_gallery(cards, tmp_path / "e.html", title="day 1", columns=2)
    tab.prefer("light")
    tab.size(1000, 900)
    tab.go((tmp_path / "e.html").as_uri())
    assert tab.ask("[...document.querySelectorAll('.edited')].map((p) => p.textContent)") == [
        f"edited from “{HOSTILE}”: trim (from 0.5), mirror", "edited from gone: smooth",
    ]  # fmt: skip
    assert tab.ask("[...document.querySelectorAll('.edited a')].map((a) => a.getAttribute('href'))") == ["#motion-0"]
    tops = tab.ask("[...document.querySelectorAll('.clip')].map((c) => c.getBoundingClientRect().top)")
    assert tops[0] == tops[1] < tops[2]
    assert tab.ask("document.documentElement.dataset.taken ?? 'no'") == "no"
    assert tab.complaints == []
