"""The platform names no model but its default: a model is a folder, a line, its tests and its bundle.

`docs/extending.md` says where a model's own things lie. `tests/integration/packaging/test_without_a_model.py` deletes
one.
"""

from __future__ import annotations

import io
import tokenize
from collections.abc import Sequence
from pathlib import PurePath

import pytest

from marey.registry import model_names
from tests.support.marey import REPOSITORY
from tests.support.models import OTHERS, is_of
from tests.support.without_model import tracked

REGISTERED = "pyproject.toml"
NAMING = {
    REGISTERED: "the line that registers it",
    "models/packages/starter/pyproject.toml": "the package of bundles that has its bundle",
    "models/packages/open/pyproject.toml": "the package of bundles that has another of its bundles",
    "models/packages/open/LICENSE": "the terms of that bundle",
    "mkdocs.yml": "the list of pages",
    "workers/marey/evaluator/protocol/published.toml": "rows of the papers' tables",
    "tests/unit/evaluator/test_protocol.py": "reads these rows",
    "tests/acceptance/test_published_data.py": "trains both models of the papers on their data sets",
    "tests/acceptance/test_published_sizes.py": "trains both models of the papers at their sizes",
}
"""Files that name a model, with the reason."""
SKIPPED = (".md", ".lock", ".png", ".jpg", ".svg", ".safetensors", ".npz", ".gz", ".bvh", ".csv", ".tsv", ".woff2")
"""Prose, locks, and what holds no code."""


def code(name: str, text: str) -> str:
    """The text of a file without comments and, in Python, without docstrings: papers are cited there."""
    if not name.endswith(".py"):
        return "\n".join(line for line in text.splitlines() if not line.lstrip().startswith("#"))
    kept: list[str] = []
    begun = False
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT):
            begun = False
        elif token.type not in (tokenize.COMMENT, tokenize.NL):
            if begun or token.type != tokenize.STRING:
                kept.append(token.string)
            begun = True
    return " ".join(kept)


@pytest.mark.parametrize("model", OTHERS)
def test_the_platform_does_not_name_a_model(model: str) -> None:
    naming = set()
    longer = [other for other in OTHERS if model in other and other != model]
    for name in tracked():
        if PurePath(name).suffix in SKIPPED or any(is_of(each, name) for each in model_names()):
            continue
        text = (REPOSITORY / name).read_text(encoding="utf-8", errors="ignore")
        if model in text.lower() and model in without(longer, code(name, text).lower()):
            naming.add(name)
    assert REGISTERED in naming
    assert naming <= set(NAMING)


def without(names: Sequence[str], text: str) -> str:
    """Remove the names of other models, in which a model's may be."""
    for name in names:
        text = text.replace(name, "")
    return text


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("import stroller\n", True),
        ('NAME = "stroller"\n', True),
        ('f(x, "stroller")\n', True),
        ('"""STROLLER, 2025."""\nx = 1  # stroller\n', False),
        ('x = 1\n"""Of the stroller."""\n\n\ndef f() -> None:\n    """Stroll as stroller."""\n', False),
    ],
)
def test_code_is_read_and_citations_are_not(text: str, found: bool) -> None:
    assert ("stroller" in code("a.py", text)) is found


def test_every_model_has_tests_of_its_own() -> None:
    for model in OTHERS:
        assert [name for name in tracked() if is_of(model, name) and name.startswith("tests/models/")]
