"""The player in a real browser."""

from __future__ import annotations

import json
import re
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from marey.viz.player import html_player
from tests.support import chromium
from tests.support.walker import walker

pytestmark = pytest.mark.slow

HOSTILE = "</script><script>document.documentElement.dataset.taken='yes'</script><img src=x onerror=alert(1)>"
# Before the page's policy, which lets no script run but its own.
PROBE = """<head><script>
addEventListener("load", () => {
  const press = (key, more) => dispatchEvent(new KeyboardEvent("keydown", { key, ...more }));
  const seen = [];
  const theme = () => document.documentElement.dataset.theme;
  const note = () => seen.push({ ...marey.state(), joints: marey.joints(), theme: theme() });
  marey.pause();
  %STEPS%
  document.getElementById("probe").textContent = JSON.stringify(seen);
});
</script>"""


@pytest.fixture
def browser(tmp_path):
    return chromium.find(tmp_path)


@pytest.fixture
def clips():
    return [walker(turn=0.7, prompt="one"), walker(seconds=1, fps=30, prompt="two")]


def probed(browser, page: Path, steps: str):
    """Run steps in the page and give what they noted."""
    text = page.read_text(encoding="utf-8").replace("<head>", PROBE.replace("%STEPS%", steps), 1)
    copy = page.with_name("probed.html")
    copy.write_text(text.replace("</body>", '<pre id="probe"></pre></body>'), encoding="utf-8")
    found = re.search(r'<pre id="probe">(.+?)</pre>', browser.dom(copy), re.DOTALL)
    assert found, "the probe noted nothing"
    return json.loads(unescape(found[1]))


def test_the_joints_on_the_screen_are_the_clips(browser, clips, tmp_path):
    page = html_player(clips, tmp_path / "a.html")
    steps = (
        "marey.seek(0); note(); marey.seek(1); note(); marey.seek(99); note(); marey.select(1); marey.seek(.5); note();"
    )
    seen = probed(browser, page, steps)
    wanted = [(0, 0), (0, 20), (0, 40), (1, 15)]
    assert [(s["clip"], s["frame"]) for s in seen] == wanted
    for state, (clip, frame) in zip(seen, wanted, strict=True):
        off = np.linalg.norm(np.array(state["joints"]) - clips[clip].joints[frame], axis=-1)
        assert off.max() < 1e-3


def test_between_two_frames_the_pose_lies_between_them(browser, clips, tmp_path):
    page = html_player(clips, tmp_path / "a.html")
    (half,) = probed(browser, page, "marey.seek(10.5 / 20); note();")
    between = clips[0].joints[10:12].mean(axis=0)
    assert np.linalg.norm(np.array(half["joints"]) - between, axis=-1).max() < 5e-3


def test_the_figure_moves_on_the_screen(browser, clips, tmp_path):
    page = html_player(clips[0], tmp_path / "a.html", theme="light")
    early, late = (browser.picture(page, f"t={t}&paused").astype(int) for t in (0, 1.0))
    for picture in (early, late):
        figure = picture[100:680]
        assert (figure[..., 2] - figure[..., 0] > 60).sum() > 2000  # the left side, blue
        assert (figure[..., 0] - figure[..., 2] > 60).sum() > 2000  # the right side, orange
    assert (np.abs(late - early).max(axis=-1) > 40)[100:680].sum() > 3000


def test_it_plays_without_being_told(browser, clips, tmp_path):
    dom = browser.dom(html_player(clips, tmp_path / "a.html"))
    state = re.search(r"<body([^>]*)>", dom)
    assert state
    assert 'data-ready="yes"' in state[1]
    assert 'data-frame="0"' not in state[1]


def test_the_keyboard_drives_it(browser, clips, tmp_path):
    page = html_player(clips, tmp_path / "a.html", theme="light")
    keys = [
        'press("ArrowRight")',
        'press("ArrowRight", { shiftKey: true })',
        'press("ArrowLeft")',
        'press("End")',
        'press("Home")',
        'press("d")',
        'press("2")',
        'press("a")',
        'press(" ")',
        'press("ArrowDown")',
    ]
    seen = probed(browser, page, "marey.seek(0); " + " ".join(f"{key}; note();" for key in keys))
    assert [s["frame"] for s in seen[:5]] == [1, 11, 10, 40, 0]
    assert seen[5]["theme"] == "dark"
    assert seen[6]["speed"] == 0.5
    assert seen[7]["axes"] is True
    assert seen[8]["playing"] is True
    assert seen[9]["clip"] == 1


def test_a_hostile_prompt_is_shown_and_does_nothing(browser, tmp_path):
    dom = browser.dom(html_player(walker(prompt=HOSTILE), tmp_path / "a.html"))
    assert "data-taken" not in dom.split("<head", 1)[0]
    shown = re.search(r'<h1 id="caption">(.*?)</h1>', dom, re.DOTALL)
    assert shown
    assert unescape(shown[1]) == HOSTILE


def test_a_browser_without_webgl_says_so(browser, clips, tmp_path):
    page = html_player(clips, tmp_path / "a.html")
    text = page.read_text(encoding="utf-8")
    blind = "<script>HTMLCanvasElement.prototype.getContext = () => null;</script>"
    page.write_text(text.replace("<head>", f"<head>{blind}", 1), encoding="utf-8")
    dom = browser.dom(page, quiet=False)
    assert re.search(r'<p id="failure" role="alert">This browser shows no WebGL', dom)
