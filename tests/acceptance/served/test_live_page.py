"""The live page as a person uses it: a browser, `marey serve`, a worker that makes the frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from marey.client.server_address import read_server
from tests.support import chromium
from tests.support.marey import Marey
from tests.support.tab import open_tab

pytestmark = pytest.mark.slow


def test_a_person_starts_steers_and_stops_a_stream_on_the_page(marey: Marey, tmp_path: Path) -> None:
    server = read_server(marey.home)
    assert server is not None
    with open_tab(chromium.find(tmp_path)) as tab:
        tab.go(f"{server.url}/live")
        tab.type(server.key or "", "key")
        tab.type("a person walks", "prompt")
        tab.press("Enter")
        tab.wait("Number(document.body.dataset.frame) > 20")
        tab.type("a person waves", "prompt")
        tab.press("Enter")
        tab.wait("document.body.dataset.prompt === '1'")
        tab.click("stop")
        tab.wait("document.body.dataset.state === 'ended'")
        assert tab.data["gaps"] == "0"
        assert "Its clip is made by job" in tab.text("message")
        shown = tab.ask("[...document.querySelectorAll('#prompts .text')].map((each) => each.textContent)")
        assert shown == ["a person walks", "a person waves"]
        assert tab.complaints == []
