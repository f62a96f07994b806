"""The documentation site: built strictly, complete, and without anything from elsewhere."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import pytest
import yaml

from marey.registry import resolve, trainings
from marey.training.config_file import list_fields
from tests.support.pages import ROOT

LOADED = {"src", "srcset", "data", "poster"}
ELSEWHERE = re.compile(r"\s*(https?:|//)", re.IGNORECASE)
CSS_LOADS = re.compile(r"(?:url\(\s*['\"]?|@import\s+['\"])(?:https?:|//)", re.IGNORECASE)
OPTIONAL = ("mermaid", "glightbox", "pyodide")
"""Features of the theme that would load a script from a CDN, by the class that asks for them."""


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with `pages` and `site`; proxies lead nowhere, so that a download fails."""
    out = tmp_path_factory.mktemp("site")
    nowhere = dict.fromkeys(("http_proxy", "https_proxy", "HTTP_PROXY", "HTTPS_PROXY"), "http://127.0.0.1:9")
    done = subprocess.run(
        [sys.executable, "docs/build_site.py", out],
        cwd=ROOT,
        env=os.environ | nowhere,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return out


def builder() -> ModuleType:
    """The program that builds the site."""
    spec = spec_from_file_location("build_site", ROOT / "docs" / "build_site.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pages_of(nav: object) -> set[str]:
    """Every page of the navigation."""
    if isinstance(nav, str):
        return {nav}
    if isinstance(nav, dict):
        return set().union(*map(pages_of, nav.values()))
    return set().union(*map(pages_of, nav)) if isinstance(nav, list) else set()


class Loads(HTMLParser):
    """Resources that a page loads by itself: sources, and links of its head."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self.classes: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = LOADED | ({"href"} if tag == "link" else set())
        self.found += [value for name, value in attrs if name in names and value]
        self.found += [value for name, value in attrs if name == "style" and value and CSS_LOADS.search(value)]
        self.classes |= {part for name, value in attrs if name == "class" for part in (value or "").split()}


def test_every_page_is_in_the_navigation_and_none_is_missing(out: Path) -> None:
    nav = pages_of(yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"])
    assert nav == {path.relative_to(out / "pages").as_posix() for path in (out / "pages").rglob("*.md")}


def test_pages_load_nothing_from_elsewhere(out: Path) -> None:
    pages = list((out / "site").rglob("*.html"))
    assert len(pages) > 50
    for page in pages:
        loads = Loads()
        loads.feed(page.read_text(encoding="utf-8"))
        assert [name for name in loads.found if ELSEWHERE.match(name) or CSS_LOADS.search(name)] == [], page.name
        assert not loads.classes & set(OPTIONAL), page.name


def test_style_sheets_load_nothing_from_elsewhere(out: Path) -> None:
    sheets = [*(out / "site").rglob("*.css"), *(out / "site").rglob("*.svg")]
    assert sheets
    assert [path.name for path in sheets if CSS_LOADS.search(path.read_text(encoding="utf-8"))] == []


def test_the_reference_has_every_command_and_route(out: Path) -> None:
    commands = (out / "pages" / "reference" / "cli.md").read_text(encoding="utf-8")
    for name in ("## marey submit", "### marey jobs list", "#### marey eval schedule add", "#### marey train hgm3 all"):
        assert f"\n{name}\n" in commands
    assert re.search(r"^\| `--dry-run` \| \w", commands, re.MULTILINE)
    assert "| `--input-format <csv|jsonl|txt>` |" in commands, "code stays as it is"
    routes = (out / "pages" / "reference" / "http-api.md").read_text(encoding="utf-8")
    assert "\n### POST /v1/jobs\n" in routes
    assert "\n### NewJobBody\n" in routes
    assert "`validate_only`: nothing was written" in routes


def test_the_reference_has_every_field_of_every_configuration(out: Path) -> None:
    page = (out / "pages" / "reference" / "configurations.md").read_text(encoding="utf-8")
    for name, training in trainings().items():
        section = page.partition(f"\n## {name}\n")[2].partition("\n## ")[0]
        rows = re.findall(r"^\| `([\w.]+)` \| `.+` \| `.+` \| .+ \| (.*) \|$", section, re.MULTILINE)
        assert [row[0] for row in rows] == [field.path for field in list_fields(resolve(training.config)("paper"))]
        assert sum(not about for _, about in rows) < len(rows) / 4, "nearly all say what they mean"


def test_a_broken_anchor_fails_the_build(tmp_path: Path) -> None:
    """Of a site of two pages, with the settings of the whole one: that takes seconds."""
    build, pages = builder(), tmp_path / "pages"
    build.ROOT = tmp_path / "root"
    build.ROOT.mkdir()
    settings, nav, _ = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")
    assert nav
    (build.ROOT / "mkdocs.yml").write_text(settings, encoding="utf-8")
    (pages / "reference").mkdir(parents=True)
    (pages / "reference" / "settings.md").write_text("# Settings\n\n## The port\n", encoding="utf-8")
    for name, fails in (("the-port", False), ("no-such-heading", True)):
        (pages / "index.md").write_text(f"[there](reference/settings.md#{name})\n", encoding="utf-8")
        assert (build.zensical(tmp_path) != 0) == fails, name


@pytest.mark.parametrize("broken", ["[a](no-such-page.md)", "![a](no-such-picture.png)", "[a](../../no-such-file.py)"])
def test_a_link_to_a_missing_file_fails_the_build(broken: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# A page\n\n{broken}\n", encoding="utf-8")
    with pytest.raises(SystemExit, match="leads nowhere"):
        builder().relink(page, "page.md", {page: "page.md"})


def test_a_link_to_code_becomes_text(tmp_path: Path) -> None:
    page, code = tmp_path / "page.md", tmp_path / "code.py"
    page.write_text("# A page\n\nSee [the code](code.py).\n\n```text\n[a](b.md)\n```\n", encoding="utf-8")
    code.write_text("", encoding="utf-8")
    relinked = builder().relink(page, "page.md", {page: "page.md"})
    assert relinked == "# A page\n\nSee the code.\n\n```text\n[a](b.md)\n```\n"
