"""The imports of the command line: small, and without HTTP of its own."""

from __future__ import annotations

import ast
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

HEAVY = (
    *("torch", "numpy", "pydantic", "sqlalchemy", "fastapi", "celery", "psycopg", "redis", "structlog"),
    *("opentelemetry", "httpx2"),
)


def test_the_command_line_imports_no_server_and_no_numbers() -> None:
    code = "import marey.cli.main, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(HEAVY) & set(done.stdout.split())


def test_the_client_needs_nothing_but_its_own_packages() -> None:
    code = "import marey.client.client, marey.cli.watching, marey.client.fetching, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(HEAVY[:-1]) & set(done.stdout.split())


INTERRUPTED = """
import os, signal, sys
class Interrupting:
    def find_spec(self, name, *_):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
sys.argv[1:] = {arguments!r}
from marey.cli.start import run
run()
"""


@pytest.mark.parametrize("module", ["typer", "marey.cli.commands.train", "marey.cli.roles.data", "numpy.linalg"])
def test_ctrl_c_during_imports_ends_with_one_line(module: str) -> None:
    code = INTERRUPTED.format(module=module, arguments=["data", "inspect", "nowhere"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "marey: interrupted\n")


def test_the_console_script_begins_before_the_imports() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["scripts"] == {"marey": "marey.cli.start:run"}
    code = "import marey.cli.start, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not {"typer", "click", "rich", "marey.core.errors"} & set(done.stdout.split())


ROOT = Path(__file__).resolve().parents[3]
CLI = ROOT / "services" / "marey" / "cli"
HTTP = (
    *("marey.client.transport", "marey.client.stream_socket", "httpx", "httpx2", "requests", "websockets"),
    *("http.client", "urllib.request", "urllib3"),
)
"""Modules that send requests."""


def uses_of_http(source: str) -> Iterator[str]:
    """The imports of a module that sends requests, and the attributes that lead around the nouns of the client."""
    for node in ast.walk(ast.parse(source)):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Attribute) and node.attr in ("transport", "_transport"):
            yield node.attr
        yield from (name for name in names if name.startswith(HTTP))


@pytest.mark.parametrize("path", sorted(CLI.rglob("*.py")), ids=lambda path: str(path.relative_to(CLI)))
def test_commands_reach_a_server_through_the_nouns_of_the_client_alone(path: Path) -> None:
    assert list(uses_of_http(path.read_text(encoding="utf-8"))) == []


def test_each_way_around_the_client_is_noticed() -> None:
    for line in (
        "from marey.client.transport import Transport", "from marey.client import transport", "import httpx2",
        "import urllib.request", "from urllib import request", "from websockets.sync.client import connect",
        "client.transport.get('/v1/jobs')",
    ):  # fmt: skip
        assert len(list(uses_of_http(line))) == 1, line
    assert list(uses_of_http("from urllib.parse import quote\nfrom marey.client import Client")) == []
