"""Settings and models that releases share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import psycopg
import pytest
import sqlalchemy as sa

from tests.servers.ports import free_ports
from tests.support.marey import tiny_models


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bundles of format 1, as the oldest of these releases wrote them."""
    folder = tiny_models(tmp_path_factory.mktemp("models"))
    for file in folder.glob("*/manifest.json"):
        document = json.loads(file.read_text())
        file.write_text(json.dumps({**document, "format": 1}))
    return folder


@pytest.fixture
def values(tmp_path: Path, database_url: str, queue_url: str, models: Path) -> Mapping[str, str]:
    """Settings of both releases, with an empty database."""
    dsn = sa.make_url(database_url).set(drivername="postgresql").render_as_string(hide_password=False)
    with psycopg.connect(dsn, autocommit=True) as conn:
        conn.execute("DROP SCHEMA public CASCADE")
        conn.execute("CREATE SCHEMA public")
    port = free_ports(1)[0]
    return {
        "MAREY_HOME": str(tmp_path / "home"),
        "MAREY_MODELS": str(models),
        "MAREY_DATABASE_URL": database_url,
        "MAREY_QUEUE_URL": queue_url,
        "MAREY_STORE": str(tmp_path / "assets"),
        "MAREY_PORT": str(port),
        "MAREY_SERVER": f"http://127.0.0.1:{port}",
        "MAREY_LIVE_SLOTS": "0",
    }
