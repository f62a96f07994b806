"""`marey` commands and scripts as forks of one process that has imported the libraries and the command line: less CPU
for each.

A command is a process of its own, with its arguments, environment, folder and streams, and ends as `python -m
marey.cli` or `python SCRIPT` does.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import gc
import importlib
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import typer

IMPORTED = (
    *("torch", "numpy", "scipy", "safetensors.torch", "tokenizers", "httpx2", "sqlalchemy", "alembic", "fastapi"),
    *("marey.cli.main", "marey.client.transport", "marey.client.fetching", "marey.core.settings", "rich.progress"),
    *("marey.generate.oneshot", "marey.text.pipeline", "marey.text.light", "marey.text.minilm_encoder", "marey.db"),
    *("marey.generation.candidates", "marey.vocabulary.scope"),
)
REPOSITORY = Path(__file__).resolve().parents[2]
LENGTH = 8
"""Bytes of the length of a request."""
ANSWER = 8
"""Bytes of a process id, and of an exit code."""


@dataclass(frozen=True)
class Forks:
    """The process that forks, as the tests see it."""

    process: subprocess.Popen[bytes]
    connection: socket.socket

    def run(
        self,
        arguments: Sequence[str],
        environment: Mapping[str, str],
        folder: Path,
        stdin: bytes,
        timeout: float,
        script: Path | None = None,
    ) -> tuple[int, bytes, bytes]:
        """Run a command to its end; returns its exit code, stdout and stderr.

        Args:
            script: to run instead of `marey`.

        Raises:
            subprocess.TimeoutExpired: it ran for longer than `timeout` seconds, and was killed.
        """
        asked = {
            "arguments": [str(script or "marey"), *arguments],
            "environment": dict(environment),
            "folder": str(folder),
            "script": script is not None,
        }
        request = json.dumps(asked).encode()
        with contextlib.ExitStack() as files:
            streams = [files.enter_context(tempfile.TemporaryFile()) for _ in range(3)]
            streams[0].write(stdin)
            streams[0].seek(0)
            numbers = [stream.fileno() for stream in streams]
            self.connection.settimeout(None)
            socket.send_fds(self.connection, [len(request).to_bytes(LENGTH, "big")], numbers)
            self.connection.sendall(request)
            process = _number(self.connection)
            code = self._code(process, arguments, timeout)
            out, err = (_whole(stream.fileno()) for stream in streams[1:])
        return code, out, err

    def _code(self, process: int, arguments: Sequence[str], timeout: float) -> int:
        self.connection.settimeout(timeout)
        try:
            return _number(self.connection)
        except TimeoutError:
            os.kill(process, signal.SIGKILL)
            self.connection.settimeout(None)
            _number(self.connection)
            raise subprocess.TimeoutExpired(list(arguments), timeout) from None


@functools.cache
def forks() -> Forks:
    """The process that forks, started on first use; it ends with this one."""
    ours, theirs = socket.socketpair()
    command = [sys.executable, "-m", "tests.support.forking", str(theirs.fileno())]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
    environment |= {"OMP_NUM_THREADS": "1"}
    with theirs:
        process = subprocess.Popen(
            command,
            cwd=REPOSITORY,
            env=environment,
            pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
    return Forks(process, ours)


def _number(connection: socket.socket) -> int:
    return int.from_bytes(_exactly(connection, ANSWER), "big", signed=True)


def _exactly(connection: socket.socket, size: int) -> bytes:
    parts: list[bytes] = []
    while size:
        part = connection.recv(size)
        if not part:
            raise EOFError("the process that forks has ended")
        parts.append(part)
        size -= len(part)
    return b"".join(parts)


def _whole(file: int) -> bytes:
    return os.pread(file, os.fstat(file).st_size, 0)


def _command(connection: socket.socket) -> Callable[[], None] | None:
    """Fork for each request until the tests end; in a fork, take on what was asked for and return what to run."""
    while True:
        head, files, _, _ = socket.recv_fds(connection, LENGTH, 3)
        if not head:
            return None
        asked = json.loads(_exactly(connection, int.from_bytes(head, "big")))
        process = os.fork()
        if not process:
            for number, file in enumerate(files):
                os.dup2(file, number)
                os.close(file)
            os.environ.clear()
            os.environ.update(asked["environment"])
            os.chdir(asked["folder"])
            _find_packages()
            sys.argv = asked["arguments"]
            return _script if asked["script"] else _marey
        for file in files:
            os.close(file)
        connection.sendall(process.to_bytes(ANSWER, "big", signed=True))
        code = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        connection.sendall(code.to_bytes(ANSWER, "big", signed=True))


def _find_packages() -> None:
    """Find what the environment's `PYTHONPATH` names first, as a new interpreter would: plug-ins of a test."""
    named = [path for path in os.environ.get("PYTHONPATH", "").split(os.pathsep) if path]
    sys.path[1:] = [*named, *(path for path in sys.path[1:] if path not in named)]
    importlib.invalidate_caches()


_codes: list[int] = []
"""The exit code of this fork, once it ends."""


def _leave() -> None:
    """End a fork behind all that runs at its end, without freeing object by object what it shares."""
    if _codes:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_codes[0])


def _marey() -> None:
    runpy.run_module("marey.cli", run_name="__main__", alter_sys=True)


def _script() -> None:
    sys.path[0] = str(Path(sys.argv[0]).parent)
    runpy.run_path(sys.argv[0], run_name="__main__")


def _run(command: Callable[[], None]) -> None:
    """Run a command to its end."""
    _codes.append(1)  # of an exception
    try:
        command()
        _codes[0] = 0
    except SystemExit as end:
        _codes[0] = end.code if isinstance(end.code, int) else bool(end.code)
        raise


if __name__ == "__main__":
    atexit.register(_leave)  # before any other, to run after them
    for module in IMPORTED:
        importlib.import_module(module)
    typer.main.get_command = functools.cache(typer.main.get_command)  # which `app()` calls: a tenth of a second
    typer.main.get_command(importlib.import_module("marey.cli.main").app)
    scope = importlib.import_module("marey.vocabulary.scope")
    scope.match_scope("a person walks", scope.every_action())  # its patterns: more than half a second
    gc.freeze()
    with socket.socket(fileno=int(sys.argv[1])) as link:
        forked = _command(link)
    if forked:
        _run(forked)
