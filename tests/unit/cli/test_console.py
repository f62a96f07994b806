"""Whatever a text holds, nothing that the command line prints makes a terminal do anything."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from marey.cli import console
from marey.cli.live.screen import Screen
from marey.cli.main import app
from marey.core.characters import LINES, find_forbidden
from marey.core.errors import InvalidInput

TEXT = st.text(st.characters(), max_size=40)
ATTACK = "a\x1b[2J\x1b]8;;http://evil\x07b\x9b31m\x7f\u202egnp.\u2066x\udc80\r"


class Terminal(io.StringIO):
    """A stream that says it is a terminal."""

    encoding = "utf-8"  # type: ignore[assignment]

    def isatty(self) -> bool:
        return True


def printed(act: Callable[[], None], *, terminal: bool) -> str:
    out, err = (Terminal(), Terminal()) if terminal else (io.StringIO(), io.StringIO())
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = out, err
    try:
        with console.escaped_output():
            act()
    finally:
        sys.stdout, sys.stderr = before
    return out.getvalue() + err.getvalue()


def harmless(text: str) -> bool:
    """No control character is left; colours and cursor movements of our own are taken out first."""
    return find_forbidden(re.sub(r"\x1b\[[0-9;?]*[A-Za-z]|\r", "", text), LINES) is None


@given(TEXT)
def test_any_text_is_printed_without_control_characters(text: str) -> None:
    def act() -> None:
        console.say(text)
        console.result(text)
        console.result_json({"text": text})
        console.table(("text",), [(text,)])
        print(text, file=sys.stderr)
        sys.stdout.writelines([text])

    assert find_forbidden(printed(act, terminal=False), LINES) is None


@given(TEXT)
def test_json_is_lossless(text: str) -> None:
    assert json.loads(printed(lambda: console.result_json([text]), terminal=False)) == [text]


def test_tables_bars_and_screens_of_a_terminal_escape_what_is_foreign(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.setenv("COLUMNS", "200")

    def act() -> None:
        console.table(("name",), [(ATTACK,), ("[bold]x[/bold] :smile:",)])
        with console.bar() as bar:
            bar.add_task("[link=http://evil]y[/link]", total=2)
            bar.add_task(ATTACK, total=2)
            bar.console.print(ATTACK)
        Screen().say(ATTACK)

    shown = printed(act, terminal=True)
    assert harmless(shown)
    assert r"a\x1b[2J" in shown
    assert "[bold]x[/bold] :smile:" in shown
    assert "[link=http://evil]y[/link]" in shown
    assert "\x1b]" not in shown


@pytest.mark.parametrize(("done", "shown"), [(0, False), (1, True)])
def test_a_bar_stays_only_where_there_was_progress_before_an_error(done: int, shown: bool) -> None:
    def act() -> None:
        with suppress(InvalidInput), console.bar() as bar:
            bar.update(bar.add_task("captions", total=2), completed=done)
            raise InvalidInput("there is no such folder")

    said = printed(act, terminal=False)
    assert ("captions" in said, said == "") == (shown, not shown)


@pytest.mark.parametrize(
    "arguments",
    [
        [f"jobs{ATTACK}"],
        ["submit", f"--{ATTACK}", "a person waves"],
        ["submit", "--priority", ATTACK, "a person waves"],
        ["submit", "-f", ATTACK.replace("/", "") + ".csv"],
        ["generate", "a person waves", "--name-template", ATTACK],
    ],
)
def test_errors_that_quote_an_argument_escape_it(arguments: list[str]) -> None:
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code in (2, 3)
    assert find_forbidden(done.output, LINES) is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["fetch", "j", "--review", "bogus"], "'--review': 'bogus' is not one of 'kept', 'rejected', 'rerolled'."),
        (
            ["review", "j", "--review", "bogus"],
            "'--review': 'bogus' is not one of 'new', 'kept', 'rejected', 'rerolled'.",
        ),
        (["motions", "list", "--review", "bogus"], "'--review': 'bogus' is not one of 'new', 'kept', "),
        (["generate", "x", "--scope", "bogus"], "'--scope': 'bogus' is not one of 'warn', 'refuse', 'ignore'."),
        (["submit", "x", "--seed", "high"], "'--seed': 'high' is not a whole number"),
        (["submit", "x", "--keep-days", "0"], "'--keep-days': 0 is below 1, the least that is allowed"),
        (["jobs", "list", "--limit", "x"], "'--limit': 'x' is not a whole number"),
    ],
)
def test_a_value_that_an_option_does_not_have_is_named_with_those_it_has(arguments: list[str], said: str) -> None:
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 2
    assert f"Error: Invalid value for {said}" in done.output


def test_an_error_names_an_argument_by_the_word_of_the_help() -> None:
    done = CliRunner().invoke(app, ["rigs", "show", "nobody"])
    assert (done.exit_code, done.stderr.startswith("marey: NAME|FILE: there is no rig 'nobody'")) == (2, True)


def test_the_traceback_of_a_bug_is_escaped() -> None:
    code = (
        "import sys; from marey.cli import main; main.app.command('bug')(lambda: 1 / len('') if 0 else "
        "(_ for _ in ()).throw(RuntimeError('a\\x1b[2Jb'))); sys.argv = ['marey', 'bug']; main.run()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "RuntimeError" in done.stderr
    assert r"a\x1b[2Jb" in done.stderr
    assert "\x1b" not in done.stderr


def test_characters_that_the_terminal_does_not_have_are_escaped() -> None:
    code = "from marey.cli import console; console.escape_output(); console.result('ü 😀')"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, "PYTHONIOENCODING": "ascii"}, capture_output=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, b"\\xfc \\U0001f600\n"), done.stderr


def test_drawn_tables_shorten_ids_alone_and_fit_eighty_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """The id of a tenant is its name, the target of an audited act an id or a name."""
    identifier = "019a1b2c-3d4e-7f00-8000-0123456789ab"
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("TERM", "dumb")
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    console.table(["id", "queued"], [["studio-north", 3]])
    audited = ["2026-11-24T09:50:43+00:00", "studio-north", "ann", identifier, "job.cancel", identifier, "name=day 1"]
    columns = ["at", "tenant", "actor", "key", "verb", "target", "data"]
    console.table(columns, [audited, [*audited[:5], "studio-north", ""]])
    text = terminal.getvalue()
    assert "\nstudio-north  3" in text
    assert text.count("456789ab") == 3
    assert identifier not in text
    assert max(map(len, text.splitlines())) <= 80
    console.table(["id"], [[identifier]], full_ids=True)
    assert identifier in terminal.getvalue()
