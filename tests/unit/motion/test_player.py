"""The 3D player's page: what is in it, and what cannot get out of it. A real browser opens it in tests/clients."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import normalize
from marey.viz import player
from marey.viz.pages import script_json
from marey.viz.player import html_player
from tests.support.walker import walker

ASSETS = Path(player.__file__).parent / "assets"
HOSTILE = '</script><script>alert(1)</script><!-- %THREE% %PLAYER% & "\u2028" <b>'


@dataclass
class Page(HTMLParser):
    """The elements of a page as a browser would see them."""

    text: str
    scripts: list[str] = field(default_factory=list)
    elements: list[tuple[str, dict[str, str | None]]] = field(default_factory=list)
    title: str = ""

    def __post_init__(self) -> None:
        super().__init__()
        self._open = ""
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._open = tag
        self.elements.append((tag, dict(attrs)))
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open == "script":
            self.scripts[-1] += data
        elif self._open == "title":
            self.title += data

    @property
    def motion(self):
        return json.loads(self.scripts[self._motion])

    @property
    def code(self) -> list[str]:
        """All scripts but the motion."""
        return [script for at, script in enumerate(self.scripts) if at != self._motion]

    @property
    def policy(self) -> str:
        return next(str(a["content"]) for tag, a in self.elements if tag == "meta" and a.get("http-equiv"))

    @property
    def _motion(self) -> int:
        given = [attributes for tag, attributes in self.elements if tag == "script"]
        return given.index({"type": "application/json", "id": "motion"})


@pytest.fixture(scope="module")
def clip():
    return walker(turn=0.7)


def page_of(clips, tmp_path: Path, **options: object) -> Page:
    return Page(html_player(clips, tmp_path / "a.html", **options).read_text(encoding="utf-8"))


def test_the_motion_in_the_page_is_the_clips_to_a_millimetre(clip, tmp_path):
    document = page_of(clip, tmp_path).motion
    entry = document["clips"][0]
    body = document["bodies"][entry["body"]]
    root = np.frombuffer(base64.b64decode(entry["root"]), "<f4").reshape(-1, 3)
    local = np.frombuffer(base64.b64decode(entry["rotations"]), "<f2").reshape(len(root), -1, 4).astype(np.float64)
    skeleton = clip.skeleton.with_offsets(np.array(body["offsets"]))
    joints = forward_kinematics(skeleton, normalize(local), root)
    assert np.linalg.norm(joints - clip.joints, axis=-1).max() < 1e-3
    contacts = np.frombuffer(base64.b64decode(entry["contacts"]), np.uint8).reshape(-1, 4)
    np.testing.assert_array_equal(contacts, clip.contacts)
    assert (entry["fps"], entry["frames"], body["parents"]) == (20, 41, list(clip.skeleton.parents))


def test_a_prompt_stays_text_whatever_is_in_it(tmp_path):
    plain = page_of(walker(), tmp_path)
    hostile = page_of(walker(prompt=HOSTILE), tmp_path)
    assert [tag for tag, _ in hostile.elements] == [tag for tag, _ in plain.elements]
    assert hostile.code == plain.code
    assert hostile.policy == plain.policy
    assert hostile.motion["clips"][0]["caption"] == HOSTILE.replace('"\u2028"', '" "')
    assert hostile.title == HOSTILE.replace('"\u2028"', '" "')


def test_json_inside_a_script_can_neither_end_it_nor_open_a_comment():
    text = script_json({"a": HOSTILE})
    assert not re.search("[<>&\u2028\u2029]", text)
    assert json.loads(text) == {"a": HOSTILE}


def test_the_page_fetches_nothing(clip, tmp_path):
    page = page_of(clip, tmp_path)
    for tag, attributes in page.elements:
        assert tag not in {"img", "iframe", "object", "embed", "base"}
        assert not {"src", "srcdoc"} & set(attributes)
        assert attributes.get("href", "data:,") == "data:,"
    assert "default-src 'none'" in page.policy
    assert not re.search(r"https?:|url\(|unsafe", page.policy)
    assert not re.search(r"@import|url\(", (ASSETS / "player.css").read_text())


def test_no_mark_of_the_template_is_left(clip, tmp_path):
    assert not re.search(r"%[A-Z]{4,}%", page_of(clip, tmp_path).text)


def test_several_clips_of_one_skeleton_share_its_body(clip, tmp_path):
    document = page_of([clip, walker(prompt="b"), clip], tmp_path, captions=["one", "two", "three"]).motion
    assert len(document["bodies"]) == 1
    assert [c["caption"] for c in document["clips"]] == ["one", "two", "three"]


def test_the_library_is_the_pinned_one_and_brings_its_licence(clip, tmp_path):
    code = (ASSETS / "three.min.js").read_bytes()
    assert hashlib.sha256(code).hexdigest() in (ASSETS / "README.md").read_text()
    assert b"</script" not in code.lower()
    assert b"<!--" not in code
    text = page_of(clip, tmp_path).text
    assert "three.js authors" in text
    assert "Permission is hereby granted, free of charge" in text


def test_the_theme_is_in_the_page(clip, tmp_path):
    assert page_of(clip, tmp_path, theme="dark").elements[0] == ("html", {"lang": "en", "data-theme": "dark"})


def test_what_cannot_be_written_is_refused(clip, tmp_path):
    with pytest.raises(InvalidInput, match="no clip"):
        html_player([], tmp_path / "a.html")
    with pytest.raises(InvalidInput, match=r"\.html, not \.txt"):
        html_player(clip, tmp_path / "a.txt")
    with pytest.raises(InvalidInput, match="unknown theme"):
        html_player(clip, tmp_path / "a.html", theme="pink")
    with pytest.raises(InvalidInput, match="1 captions for 2 clips"):
        html_player([clip, clip], tmp_path / "a.html", captions=["one"])
    with pytest.raises(InvalidInput, match="cannot be written"):
        html_player(clip, tmp_path / "missing" / "a.html")
    assert not list(tmp_path.iterdir())
