"""The picture of the layers is the one that import-linter enforces, and every package has a line."""

from __future__ import annotations

import re
import tomllib

from tests.support.pages import ROOT

PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
(LAYERS,) = [contract["layers"] for contract in CONTRACTS if contract["type"] == "layers"]


def test_the_picture_shows_the_layers_that_lint_enforces() -> None:
    (picture,) = re.findall(r"<!-- layers -->\n```text\n(.*?)```", PAGE, re.DOTALL)
    assert picture.splitlines() == LAYERS


def test_every_package_has_a_line_in_the_order_of_the_layers() -> None:
    section = PAGE[PAGE.index("\n## Layers") : PAGE.index("\n## The API process")]
    packages = [name for layer in LAYERS for name in re.split(r" [|:] ", layer)]
    assert re.findall(r"^\| `(\w+)` \| \S", section, re.MULTILINE) == packages
