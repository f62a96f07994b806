"""A clip without a server starts fast: nothing of the database or the network is imported."""

from __future__ import annotations

import subprocess
import sys

CODE = """
import sys
import marey.generation.candidates, marey.generate.oneshot, marey.models.hgm3.generate, marey.text.pipeline
foreign = {"sqlalchemy", "alembic", "psycopg", "redis", "celery", "httpx2", "fastapi", "transformers", "scipy", "PIL"}
print(sorted(foreign & set(sys.modules)))
"""


def test_generating_imports_no_database_and_no_network() -> None:
    ran = subprocess.run([sys.executable, "-c", CODE], capture_output=True, text=True, check=True, timeout=300)
    assert ran.stdout.strip() == "[]"
