"""Irreversible commands ask for confirmation at a terminal, and refuse without one."""

from __future__ import annotations

import contextlib
import os
import pty
import subprocess
from pathlib import Path
from uuid import uuid4

import pytest

from tests.support.marey import COMMAND, REPOSITORY, Marey, Ran

ASKING = [("jobs", "delete"), ("jobs", "erase"), ("webhooks", "remove"), ("eval", "schedule", "delete")]
NOWHERE = {"MAREY_SERVER": "http://127.0.0.1:9", "MAREY_KEY": "x"}


def at_a_terminal(answer: bytes, *arguments: str) -> Ran:
    """Run a command whose input is a terminal, at which `answer` is typed."""
    ours, theirs = pty.openpty()
    try:
        with contextlib.closing(os.fdopen(theirs, "rb")) as stdin:
            os.write(ours, answer)
            done = subprocess.run(
                [*COMMAND, *arguments], stdin=stdin, capture_output=True, timeout=120, check=False,
                cwd=REPOSITORY, env={**os.environ, **NOWHERE},
            )  # fmt: skip
    finally:
        os.close(ours)
    return Ran(done.returncode, done.stdout.decode(), done.stderr.decode())


@pytest.mark.parametrize("command", ASKING, ids=" ".join)
@pytest.mark.parametrize("stdin", [b"", b"y\n"], ids=["nothing", "yes"])
def test_without_a_terminal_it_is_a_wrong_use_and_y_is_named(
    tmp_path: Path, command: tuple[str, ...], stdin: bytes
) -> None:
    marey = Marey(tmp_path / "home", tmp_path / "models", NOWHERE)
    marey(*command, uuid4(), stdin=stdin).refused(2, "There is no terminal to ask this at", "-y")


@pytest.mark.parametrize("typed", [b"n\n", b"\n", b"\x04"], ids=["n", "enter", "end"])
def test_a_typed_no_ends_the_command_as_a_person_asked(typed: bytes) -> None:
    ran = at_a_terminal(typed, "jobs", "delete", str(uuid4())).refused(130, "Delete job ")
    assert "nothing was done" in ran.err or "interrupted" in ran.err
    assert "Aborted" not in ran.err


def test_a_typed_yes_does_it() -> None:
    at_a_terminal(b"y\n", "jobs", "delete", str(uuid4())).refused(4, "the server does not answer")
