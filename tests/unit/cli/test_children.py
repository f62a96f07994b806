"""Processes that are kept running: what is said when one ends."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

from marey.cli.children import SupervisedProcess

BEFORE = "marey: an error of the process before it\n"


def said_of(script: str, log: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """Report on a child that runs the script to its end."""
    child = SupervisedProcess("child", [sys.executable, "-c", script], dict(os.environ), log)
    child.start(time.monotonic())
    assert child.process is not None
    child.process.wait(60)
    child.keep(time.monotonic())
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("script", "line"),
    [
        ("print('marey: MAREY_X: cannot be used'); print('  Use y.'); exit(2)", "marey: MAREY_X: cannot be used"),
        (
            "print('now [error    ] worker_cannot_start error=no device'); print('[info ] bye'); exit(1)",
            "no device",
        ),
        ("""print('{"event": "no device", "level": "error"}'); exit(1)""", "no device"),
        ("raise ValueError('broken')", "ValueError: broken"),
    ],
    ids=["command", "log line", "JSON", "traceback"],
)
def test_a_child_that_fails_is_told_with_its_last_error(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], script: str, line: str
) -> None:
    log = tmp_path / "child.log"
    log.write_text(BEFORE)
    said = said_of(script, log, capsys)
    assert "starting it again" in said
    assert line in said
    assert "before it" not in said


def test_a_child_that_says_nothing_wrong_is_told_without(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "child.log"
    log.write_text(BEFORE)
    assert len(said_of("print('all well'); exit(3)", log, capsys).splitlines()) == 1
