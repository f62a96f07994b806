"""The picture of the layers is the one that import-linter enforces, and packages, functions and files that the page
names exist."""

from __future__ import annotations

import ast
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
    section = PAGE[PAGE.index("\n## Layers") : PAGE.index("\n## From `marey submit`")]
    packages = [name for layer in LAYERS for name in re.split(r" [|:] ", layer)]
    assert re.findall(r"^\| `(\w+)` \| \S", section, re.MULTILINE) == packages


def _defined(module: str) -> set[str]:
    """Names of the functions and classes of a module, methods as `Class.method`, without importing it."""
    (path,) = ROOT.glob(f"*/{module.replace('.', '/')}.py")
    kinds = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef
    top = [each for each in ast.parse(path.read_text(encoding="utf-8")).body if isinstance(each, kinds)]
    members = {
        f"{each.name}.{member.name}"
        for each in top
        if isinstance(each, ast.ClassDef)
        for member in each.body
        if isinstance(member, kinds)
    }
    return {each.name for each in top} | members


def test_the_functions_of_a_prompts_way_exist() -> None:
    named = re.findall(r"`(marey(?:\.\w+)+):([\w.]+)`", PAGE)
    assert len(named) > 20
    assert [f"{module}:{name}" for module, name in named if name not in _defined(module)] == []


def test_the_files_of_packages_that_are_easily_confused_exist() -> None:
    section = PAGE[PAGE.index("\n## Packages that are easily confused") : PAGE.index("\n## The API process")]
    paths = re.findall(r"`(\w+/[\w/]+(?:\.py)?)`", section)
    assert len(paths) > 8
    assert [path for path in paths if not list(ROOT.glob(f"*/marey/{path}"))] == []
