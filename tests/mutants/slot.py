"""A warm process that runs tests against mutants, one forked child each.

Works in a tree of its own (a copy of the checkout, its working folder). The packages named as arguments are loaded
before the fork and the product after it, so a mutated file needs no reload, and processes that tests start see it too.
Reads one JSON request a line, `{"path", "source", "tests", "limit"}` (no path: nothing is mutated), and answers
`{"verdict": "survived" | "killed" | "timeout", "by", "seconds"}`.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import importlib.util
import json
import os
import shutil
import signal
import sys
import time
import traceback
from pathlib import Path
from typing import Any

import psutil
import psycopg
import pytest

OPTIONS = ("-x", "-q", "--no-header", "--tb=short", "-p", "no:cacheprovider", "-p", "no:xdist", "--hypothesis-seed=0")
PR_SET_CHILD_SUBREAPER = 36


class FirstFailure:
    """A pytest plugin that writes the id of the first test that fails into a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note a failed test."""
        if report.failed and not self.path.exists():
            self.path.write_text(report.nodeid)


def main() -> None:
    """Serve requests until standard input ends."""
    scratch = Path(os.environ["MAREY_MUTANTS_SCRATCH"])
    os.environ["TMPDIR"] = str(scratch / "tmp")
    for name in sys.argv[1:]:
        with contextlib.suppress(ImportError):
            importlib.import_module(name)
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        answers.write(json.dumps(_answer(json.loads(line), scratch)) + "\n")
        answers.flush()


def _answer(request: dict[str, Any], scratch: Path) -> dict[str, Any]:
    _clear(scratch)
    if request["path"] is None:
        return _run(request, scratch)
    path = Path(request["path"])
    original = path.read_bytes()
    try:
        _write(path, request["source"].encode())
        return _run(request, scratch)
    finally:
        _write(path, original)


def _write(path: Path, source: bytes) -> None:
    """Replace a file of the product, and leave no bytecode that could be taken for the new file's."""
    path.write_bytes(source)
    Path(importlib.util.cache_from_source(path)).unlink(missing_ok=True)


def _run(request: dict[str, Any], scratch: Path) -> dict[str, Any]:
    started = time.monotonic()
    first_failure = scratch / "first_failure"
    child = os.fork()
    if not child:
        _be_the_child(request["tests"], first_failure, scratch / "output.log")
    code = _wait(child, started + request["limit"])
    _end_descendants()
    by = first_failure.read_text() if first_failure.exists() else None
    verdict = "timeout" if code is None else "survived" if code == 0 else "killed"
    return {"verdict": verdict, "by": by, "code": code, "seconds": round(time.monotonic() - started, 2)}


def _be_the_child(tests: list[str], first_failure: Path, output: Path) -> None:
    code = 99
    try:
        os.setsid()
        log = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(log, 1)
        os.dup2(log, 2)
        arguments = [*OPTIONS, f"--basetemp={output.parent / 'tests'}", *tests]
        code = int(pytest.main(arguments, plugins=[FirstFailure(first_failure)]))
        sys.stdout.flush()
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _wait(child: int, until: float) -> int | None:
    """Exit status of a child; None if it had to be killed."""
    while time.monotonic() < until:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None


def _end_descendants() -> None:
    """Kill the processes that a child left behind; they are this process's, as the subreaper's."""
    left = psutil.Process().children(recursive=True)
    for process in left:
        with contextlib.suppress(psutil.NoSuchProcess):
            process.kill()
    psutil.wait_procs(left, timeout=10)


def _clear(scratch: Path) -> None:
    """Remove what a killed run may have left: its files, and its databases."""
    for name in ("tmp", "tests"):
        shutil.rmtree(scratch / name, ignore_errors=True)
    (scratch / "tmp").mkdir()
    (scratch / "first_failure").unlink(missing_ok=True)
    if "MAREY_TEST_POSTGRES" not in os.environ:
        return
    dsn = os.environ["MAREY_TEST_POSTGRES"].replace("postgresql+psycopg", "postgresql")
    with psycopg.connect(dsn, autocommit=True) as connection:
        names = connection.execute(r"SELECT datname FROM pg_database WHERE datname ~ '^(test|module)_\d+$'").fetchall()
        for (name,) in names:
            connection.execute(f'DROP DATABASE "{name}" WITH (FORCE)'.encode())


if __name__ == "__main__":
    main()
