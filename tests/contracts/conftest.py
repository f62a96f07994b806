"""Programs of the Postgres that the tests run."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.contracts.__main__ import pg_dump_program


@pytest.fixture
def pg_dump() -> Path:
    """The program."""
    return pg_dump_program()
