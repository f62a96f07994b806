"""The live page: what is in it, and what it may do. A real browser opens it in tests/clients."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest

from marey.motion.skeleton import HUMANML3D
from marey.viz import live_page as module
from marey.viz.body import dress
from marey.viz.live_page import live_page
from marey.viz.pages import fill
from tests.support.policies import policy_hashes

ASSETS = Path(module.__file__).parent / "assets"


class Elements(HTMLParser):
    """The elements of a page as a browser would see them: tag, attributes, text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None], list[str]]] = []
        self._open = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs), []))
        self._open = True

    def handle_endtag(self, tag: str) -> None:
        self._open = False

    def handle_data(self, data: str) -> None:
        if self._open:
            self.found[-1][2].append(data)

    def texts(self, tag: str, **attributes: str) -> list[str]:
        return ["".join(text) for name, given, text in self.found if name == tag and given == attributes]


@pytest.fixture(scope="module")
def page() -> str:
    return live_page().content.decode()


@pytest.fixture(scope="module")
def elements(page: str) -> Elements:
    return Elements(page)


def test_the_page_loads_nothing(elements: Elements):
    for tag, attributes, _ in elements.found:
        assert tag not in {"img", "iframe", "object", "embed", "base"}
        assert not {"src", "srcdoc", "action"} & set(attributes)
        assert attributes.get("href", "data:,") == "data:,"
        assert not [name for name in attributes if name.startswith("on") or name == "style"]
    assert not re.search(r"@import|url\(", "".join(elements.texts("style")))


def test_its_policy_names_each_script_and_its_style_and_nothing_else(elements: Elements):
    policy = dict(part.split(" ", 1) for part in live_page().policy().split("; "))

    scripts = elements.texts("script")
    assert len(scripts) == 7
    assert policy["script-src"].split() == policy_hashes(scripts)
    assert policy["style-src"].split() == policy_hashes(elements.texts("style"))
    assert policy["default-src"] == "'none'"
    assert policy["connect-src"] == "'self'"
    assert policy["frame-ancestors"] == "'none'"


def test_its_sockets_go_to_the_host_that_served_it():
    assert "connect-src 'self' ws://studio.example:8000 wss://studio.example:8000;" in live_page().policy(
        "studio.example:8000"
    )


@pytest.mark.parametrize(
    "host", ["", "a b", "x; script-src *", "x'", "[::1]:8000", "x:y", "a\nb", "example.com:8000\n"]
)
def test_a_host_that_is_none_does_not_get_into_the_policy(host: str):
    assert live_page().policy(host) == live_page().policy()


def test_no_mark_of_the_template_is_left(page: str):
    assert not re.search(r"%[A-Z]{4,}%", page)


def test_the_figure_is_the_body_of_the_skeleton_that_streams_have(elements: Elements):
    (text,) = elements.texts("script", type="application/json", id="bodies")
    (body,) = json.loads(text)
    assert (body["names"], body["parents"]) == (list(HUMANML3D.joint_names), list(HUMANML3D.parents))
    limbs = dress(HUMANML3D).limbs
    assert [limb["joints"] for limb in body["limbs"]] == [[limb.start, limb.end] for limb in limbs]
    assert body["feet"] == list(HUMANML3D.feet)


@pytest.mark.parametrize("name", ["live.js", "live_frames.js", "live_link.js", "live_view.js", "scene.js"])
def test_no_text_is_ever_read_as_html_or_as_code(name: str):
    code = (ASSETS / name).read_text()
    assert not re.search(r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function", code)
    assert not re.search(r"</script|<!--", code)


def test_three_js_brings_its_licence(page: str):
    assert "Permission is hereby granted, free of charge" in page


def test_what_is_filled_in_is_not_searched_for_marks():
    assert fill("a %ONE% b %TWO% c", {"%ONE%": "%TWO%", "%TWO%": "2"}) == "a %TWO% b 2 c"
