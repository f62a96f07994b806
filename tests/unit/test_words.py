"""The check of words finds what it shall, and the code that it covers is clean."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.lint import words

FILE = Path("shared/marey/example.py")
CLAIM = Path("shared/marey/jobs/claim.py")


def found(source: str, path: Path = FILE) -> list[str]:
    """Messages of all findings."""
    return [finding.message for finding in words.check_source(source, path)]


@pytest.mark.parametrize("first", words.FIRST_WORDS)
def test_docstrings_begin_with_an_imperative_or_a_noun_phrase(first: str) -> None:
    source = f'"""{first} it is."""\n\n\nclass A:\n    """A class."""\n\n    b: int\n    """{first} b is."""\n'
    begun = [message.split(":")[0] for message in found(source) if message.startswith("docstring")]
    assert begun == [f"docstring begins with {first!r}"] * 2


def test_a_word_that_merely_begins_so_passes() -> None:
    assert found('"""Whatever follows."""\n\n\ndef whole() -> None:\n    """Wholly fine."""\n') == []


def test_strings_that_are_no_docstrings_pass() -> None:
    assert found('def f() -> str:\n    """Return a text."""\n    return "What nobody tells"\n') == []


@pytest.mark.parametrize("name", ["Room", "Keeper", "Tailer", "Visit"])
def test_replaced_class_names_are_found(name: str) -> None:
    assert found(f"class {name}:\n    pass\n") == [f"name {name!r}: use {words.NAMES[name]}"]


@pytest.mark.parametrize("name", ["tell", "let_in", "dismiss", "practise"])
def test_replaced_function_names_are_found(name: str) -> None:
    assert found(f"async def {name}() -> None:\n    pass\n") == [f"name {name!r}: use {words.NAMES[name]}"]


def test_aliases_are_names_too() -> None:
    assert found("from marey.jobs import HeartbeatReply as Answer\n") == ["name 'Answer': use HeartbeatReply"]


def test_calls_of_methods_with_such_names_pass() -> None:
    assert found("position = file.tell()\npath.touch()\nname = name.lower()\n") == []


def test_module_names_are_checked() -> None:
    assert found("", Path("shared/marey/door.py")) == ["module 'door': use 'accept'"]


def test_words_in_comments_and_docstrings_are_found_with_their_line() -> None:
    source = '"""A module.\n\nFor whoever reads it.\n"""\n\nX = 1  # nobody else\n'
    findings = words.check_source(source, FILE)
    assert [(finding.line, finding.message) for finding in findings] == [
        (3, "word 'whoever': use the client, the worker"),
        (6, "word 'nobody': use no client, no worker"),
    ]


def test_the_code_is_checked_by_make_lint() -> None:
    """That it is clean is for `make lint` to say, which `make test` runs beside these tests."""
    assert CLAIM in words.tracked_files()
    assert "python -m tests.lint.words\n" in (words.ROOT / "Makefile").read_text().partition("\nlint:")[2]


def test_findings_fail_the_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(words, "tracked_files", lambda: [CLAIM])
    assert words.main() == 0
    monkeypatch.setattr(words, "NAMES", {**words.NAMES, "claim": "take"})
    assert words.main() == 1
    assert "shared/marey/jobs/claim.py:" in capsys.readouterr().out
