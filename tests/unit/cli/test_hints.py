"""Errors of the client, as the command line words them; and the client's own words, which name no option."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from marey.cli.hints import OPTIONS, hint_of_timeout, name_options
from marey.client import Conflict, InvalidInput, MareyError, TimedOut
from marey.items.problems import InvalidItems, Problem
from tests.contracts.surfaces import command_line

CLIENT = Path(__file__).resolve().parents[3] / "services" / "marey" / "client"
OPTION = re.compile(r"(?<![\w-])(--[a-z][a-z-]+|-[a-z])(?![\w-])")


def test_an_error_names_the_option_in_place_of_the_argument() -> None:
    hint = "Choose another folder, or pass overwrite=True."
    error = name_options(Conflict("already exists", where="walk.npz", hint=hint, argument="overwrite"))
    assert str(error) == "walk.npz: already exists\n  Choose another folder, or use --overwrite."
    error = name_options(InvalidInput("-1 is outside 0 to 9", where="seed", argument="seed"))
    assert str(error) == "--seed: -1 is outside 0 to 9"
    error = name_options(InvalidInput("no", hint="Name it as the rig: --rig a.npz.", argument="rig"))
    assert error.hint == "Name it as the rig: --rig a.npz."
    error = name_options(InvalidInput("no", where="file", hint="Choose extra_columns tag.", argument="extra_columns"))
    assert str(error) == "file: no\n  Choose --extra-columns tag."


def test_an_error_without_an_argument_stays_as_it_is() -> None:
    error = InvalidInput("is empty", where="seed", hint="Is overwrite=True?")
    assert str(name_options(error)) == "seed: is empty\n  Is overwrite=True?"


GIVEN = {"keep_days": "--keep-days", "value": "PRIORITY", "priority": "PRIORITY", "events": "--event", "tags": "--tag"}


@pytest.mark.parametrize(
    ("where", "named"),
    [
        ("keep_days", "--keep-days"),
        ("priority", "PRIORITY"),
        ("events.0", "--event"),
        ("tags", "--tag"),
        ("settings", "settings"),
        ("events.0.kind", "events.0.kind"),
        ("job 12", "job 12"),
        (None, None),
    ],
)
def test_an_error_of_the_server_names_the_option_of_its_field(where: str | None, named: str | None) -> None:
    assert name_options(InvalidInput("no", where=where), GIVEN).where == named
    problems = [Problem(None, where, "no"), Problem(3, where, "no")]
    listed = name_options(InvalidItems(problems), GIVEN)
    assert isinstance(listed, InvalidItems)
    assert [each.field for each in listed.problems] == [named, where]


def test_an_option_of_another_name_than_its_field_is_named_where_the_command_has_it() -> None:
    assert name_options(InvalidInput("no", where="settings"), {"sampling": "--set"}).where == "--set"


@pytest.mark.parametrize("words", [["-o", "loop"], ["-oloop"], ["--output=./loop"], ["walk.npz", "-o", "loop/a.npz"]])
def test_an_error_about_a_file_with_the_name_of_an_option_names_the_file(words: list[str]) -> None:
    error = InvalidInput("cannot write here", where="loop")
    assert name_options(error, {"loop": "--loop"}, words).where == "loop"
    assert name_options(error, {"loop": "--loop"}, ["--loop", "-o", "walk"]).where == "--loop"


def test_each_option_exists() -> None:
    assert set(OPTIONS.values()) <= set(re.findall(r"--[a-z-]+", str(command_line())))


def test_a_timeout_gets_the_hint_of_the_command() -> None:
    with pytest.raises(TimedOut) as caught, hint_of_timeout("Wait again."):
        raise TimedOut("too late", hint="Call wait again.")
    assert caught.value.hint == "Wait again."
    with pytest.raises(MareyError) as other, hint_of_timeout("Wait again."):
        raise InvalidInput("is empty", hint="Write one.")
    assert other.value.hint == "Write one."


@pytest.mark.parametrize("path", sorted(CLIENT.rglob("*.py")), ids=lambda path: str(path.relative_to(CLIENT)))
def test_no_text_of_the_client_names_an_option(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    texts = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    assert [text for text in texts if OPTION.search(text)] == []
