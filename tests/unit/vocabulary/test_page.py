"""docs/reference/vocabulary.md: a row for every action, as the vocabulary has it."""

from __future__ import annotations

from pathlib import Path

import pytest

from marey.vocabulary.entries import load_vocabulary, parse_vocabulary
from marey.vocabulary.page import main, page_of
from tests.support.pages import ROOT


def test_the_page_is_that_of_the_vocabulary() -> None:
    """Written anew by `python -m marey.vocabulary.page docs/reference/vocabulary.md`."""
    assert (ROOT / "docs" / "reference" / "vocabulary.md").read_text(encoding="utf-8") == page_of(load_vocabulary())


def test_a_row_has_definition_kind_sides_and_words() -> None:
    text = """
[walk]
definition = "The body steps forward."
verbs = ["walk", "stroll"]
nouns = ["gait"]

[march]
definition = "Knees are lifted | high."
verbs = ["march"]
nouns = []
kind_of = "walk"
sided = "foot"
"""
    rows = page_of(parse_vocabulary(text.encode(), "here")).splitlines()[-2:]
    assert rows == [
        "| `walk` | steps forward. | walk, stroll, gait |",
        "| `march` | Knees are lifted \\| high. A manner of `walk`. Left and right name the foot. | march |",
    ]


def test_the_program_writes_the_file_that_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "page.md")]) == 0
    assert (tmp_path / "page.md").read_text(encoding="utf-8") == page_of(load_vocabulary())
    assert main([]) == 2
    assert "usage" in capsys.readouterr().err
