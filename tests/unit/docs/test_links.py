"""Links of every Markdown file lead to a file of the repository, and anchors to a heading of it.

The build of the site checks its own pages (test_site.py). README.md and the pages beside code are none of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from tests.lint.words import tracked_documents
from tests.support.pages import ROOT

FENCE = re.compile(r"^( *)(```+|~~~+).*?^\1\2 *$", re.DOTALL | re.MULTILINE)
CODE = re.compile(r"(`+)(.*?)\1", re.DOTALL)
LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")
HEADING = re.compile(r"^#{1,6} +(.+?) *#*$", re.MULTILINE)
DOCUMENTS = sorted({*tracked_documents(), *(page.relative_to(ROOT) for page in ROOT.glob("docs/research/**/*.md"))})


@cache
def anchors(page: Path) -> frozenset[str]:
    """Anchors of the headings of a page, as GitHub makes them."""
    found: dict[str, int] = {}
    names = set()
    for heading in HEADING.findall(FENCE.sub("", page.read_text(encoding="utf-8"))):
        text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading)
        slug = re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-")
        number = found[slug] = found.get(slug, -1) + 1
        names.add(f"{slug}-{number}" if number else slug)
    return frozenset(names)


def dead_links(page: Path) -> Iterator[str]:
    """Yield the links of a page that lead nowhere."""
    text = CODE.sub("", FENCE.sub("", page.read_text(encoding="utf-8")))
    for name, anchor in LINK.findall(text):
        target = (page.parent / name).resolve() if name else page
        if not target.exists():
            yield name
        elif anchor and target.suffix == ".md" and anchor not in anchors(target):
            yield f"{name}#{anchor}"


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_links_lead_somewhere(document: Path) -> None:
    assert [*dead_links(ROOT / document)] == []


@pytest.mark.parametrize(
    "link", ["[a](no-such-page.md)", "[a](#no-such-heading)", "[a](page.md#no-such-heading)", "![a](picture.png)"]
)
def test_a_dead_link_is_found(link: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# A page\n\n## A `code` heading\n\n[x](#a-code-heading) {link}\n", encoding="utf-8")
    assert len([*dead_links(page)]) == 1
