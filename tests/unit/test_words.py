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


def test_strings_that_are_not_docstrings_pass() -> None:
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


@pytest.mark.parametrize(
    ("source", "word"),
    [
        ('raise InvalidInput("nobody asked")', "nobody"),
        ('raise InvalidInput(f"{name} is no parameter of this route")', "is no parameter of"),
        ('log.warning("lost in company", item=1)', "in company"),
        ('option(help="Wait for whoever comes.")', "whoever"),
        ('error = Refused("the address", hint="It may not be told.")', "may not be told"),
        ('return NotFound("two acts are missing")', "two acts"),
    ],
)
def test_messages_are_checked(source: str, word: str) -> None:
    (message,) = found(f"def f() -> None:\n    {source}\n")
    assert message.startswith(f"word {word!r}: use ")


def test_messages_of_tests_and_other_strings_pass() -> None:
    source = 'raise ValueError("nobody")\n'
    assert found(source, Path("tests/unit/example.py")) == []
    assert found('prompts = ("nobody walks",)\nopen_file("nobody")\n') == []


def found_in(text: str, path: Path = Path("docs/example.md")) -> list[tuple[int, str]]:
    """Line and message of all findings in a document."""
    return [(finding.line, finding.message) for finding in words.check_markdown(text, path)]


def test_prose_of_documents_is_checked_by_line() -> None:
    assert found_in("# A title\n\nA prompt is\nparted into several acts.\n") == [
        (4, "word 'parted': use split"),
        (4, "word 'several acts': use action"),
    ]


def test_code_and_link_targets_of_documents_pass() -> None:
    text = "Run `nobody` or\n\n```console\n$ whoever\n```\n\nas [this page](nobody.md) says.\n"
    assert found_in(text) == []


def test_replaced_class_names_in_code_of_documents_are_found() -> None:
    assert found_in("Import `port.ReadAs` and\n`create_show()`, not `Room`.\n") == [
        (1, "name 'ReadAs': use PromptRewrite"),
        (2, "name 'create_show': use create_live_model"),
    ]


def test_names_of_documents_are_checked() -> None:
    assert found_in("", Path("docs/two-acts.md")) == [(1, "file name: use 'action'")]


def test_a_class_name_has_one_meaning() -> None:
    one, two = Path("shared/marey/one.py"), Path("workers/marey/two.py")
    sources = {
        one: "class Batch:\n    pass\n\n\nclass Generator:\n    pass\n",
        two: "X = 1\n\n\nclass Batch:\n    pass\n\n\nclass Generator:\n    pass\n",
        Path("tests/unit/three.py"): "class Batch:\n    pass\n",
    }
    (finding,) = words.check_meanings(sources)
    assert (finding.path, finding.line) == (two, 4)
    assert finding.message == "class 'Batch' exists in shared/marey/one.py: name their difference"


def test_the_code_is_checked_by_make_lint() -> None:
    """That it is clean is for `make lint` to say, which the gate (`.ci/run`) runs before these tests."""
    assert CLAIM in words.tracked_files()
    assert "python -m tests.lint.words\n" in (words.ROOT / "Makefile").read_text().partition("\nlint:")[2]


def test_findings_fail_the_command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(words, "tracked_files", lambda: [CLAIM])
    assert words.main() == 0
    monkeypatch.setattr(words, "NAMES", {**words.NAMES, "claim": "take"})
    assert words.main() == 1
    assert "shared/marey/jobs/claim.py:" in capsys.readouterr().out
