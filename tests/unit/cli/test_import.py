"""The small client stays small."""

from __future__ import annotations

import subprocess
import sys

HEAVY = (
    *("torch", "numpy", "pydantic", "sqlalchemy", "fastapi", "celery", "psycopg", "redis", "structlog"),
    *("opentelemetry", "httpx2"),
)


def test_the_command_line_imports_no_server_and_no_numbers() -> None:
    code = "import marey.cli.main, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(HEAVY) & set(done.stdout.split())


def test_the_client_needs_nothing_but_its_own_packages() -> None:
    code = "import marey.client.transport, marey.cli.watching, marey.client.fetching, sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert not set(HEAVY[:-1]) & set(done.stdout.split())
