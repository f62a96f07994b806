"""Settings and models that releases share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import psycopg
import pytest
import sqlalchemy as sa

from marey.bundles import Bundle
from marey.core.settings import Settings
from marey.registry import model_names
from marey.text.keys import resolve
from tests.servers.ports import free_ports
from tests.support.marey import tiny, tiny_models


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Generators of format 1, as the oldest of these releases wrote them, with encoder and labeller of this one.

    They name both by hash: an earlier release has no encoder of its own to look at.
    """
    folder = tiny_models(tmp_path_factory.mktemp("models"))
    for name in map(tiny, model_names()):
        bundle = Bundle.open(folder / name)
        assert bundle.manifest.text is not None
        text = resolve(bundle.manifest.text, config=Settings(models=folder)).model_dump(mode="json")
        document = bundle.manifest.model_dump(mode="json", exclude_unset=True, exclude={"actions", "offsets"})
        (folder / name / "manifest.json").write_text(json.dumps({**document, "format": 1, "text": text}))
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
