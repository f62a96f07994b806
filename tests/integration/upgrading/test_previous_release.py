"""The previous release and this one on the same rows: each finishes what the other's API has queued."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx2
import psycopg
import pytest
import sqlalchemy as sa

from shared.bundles import Bundle
from tests.servers.ports import free_ports
from tests.support.marey import REPOSITORY, TINY, tiny_models
from tests.support.releases import Release, previous_release, wait_until

COUNT = 3
PREPARE = """
from shared.jobs import create_engine, create_key, transaction, upgrade
from shared.settings import settings
engine = create_engine(settings().database_url.get_secret_value())
upgrade(engine)
with transaction(engine) as conn:
    print(create_key(conn, "tester", ["read", "submit"]).secret)
"""
OPEN = """
from pathlib import Path
from shared.bundles import Bundle
from shared.errors import InvalidBundle
try:
    Bundle.open(Path({path!r}))
except InvalidBundle as error:
    print(error)
"""


@pytest.fixture(scope="module")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bundles of format 1, as the previous release wrote them."""
    folder = tiny_models(tmp_path_factory.mktemp("models"))
    for file in folder.glob("*/manifest.json"):
        document = json.loads(file.read_text())
        file.write_text(json.dumps({**document, "format": 1}))
    return folder


@pytest.fixture
def releases(tmp_path: Path, database_url: str, queue_url: str, models: Path) -> Callable[[], tuple[Release, Release]]:
    """The previous release and this one, with an empty database."""

    def made() -> tuple[Release, Release]:
        previous = previous_release(tmp_path / "previous")
        dsn = sa.make_url(database_url).set(drivername="postgresql").render_as_string(hide_password=False)
        with psycopg.connect(dsn, autocommit=True) as conn:
            conn.execute("DROP SCHEMA public CASCADE")
            conn.execute("CREATE SCHEMA public")
        environment = {
            "MAREY_HOME": str(tmp_path / "home"),
            "MAREY_MODELS": str(models),
            "MAREY_DATABASE_URL": database_url,
            "MAREY_QUEUE_URL": queue_url,
            "MAREY_STORE": str(tmp_path / "assets"),
            "MAREY_PORT": str(free_ports(1)[0]),
            "MAREY_LIVE_SLOTS": "0",
        }
        return Release(previous, environment), Release(REPOSITORY, environment)

    return made


def submit(http: httpx2.Client, word: str) -> str:
    items = [{"prompt": f"a person walks {n} steps, {word}", "seconds": 2, "seed": n} for n in range(COUNT)]
    answer = http.post("/v1/jobs", json={"items": items})
    assert answer.status_code in (200, 201, 202), answer.text
    return answer.json()["id"]


def job(http: httpx2.Client, job_id: str) -> dict[str, Any]:
    answer = http.get(f"/v1/jobs/{job_id}")
    assert answer.status_code == 200, answer.text
    return answer.json()


def test_each_release_finishes_what_the_other_has_queued(
    tmp_path: Path, models: Path, releases: Callable[[], tuple[Release, Release]]
) -> None:
    previous, current = releases()
    log = tmp_path / "log"
    reference = Bundle.open(models / TINY).reference
    key = previous.python(PREPARE).strip()
    with previous.api(log, key) as http:
        queued = submit(http, "old")

    current.python(PREPARE)
    with current.api(log, key) as http, current.running(log, "scheduler"):
        assert job(http, queued)["counters"].get("succeeded", 0) == 0
        with current.running(log, "worker", "hgm3+text"):
            wait_until(lambda: job(http, queued)["counters"].get("succeeded") == COUNT, log)
        assert bundles_of(http, queued) == {reference}

        newer = submit(http, "new")
        with previous.running(log, "worker", "hgm3+text"):
            wait_until(lambda: job(http, newer)["counters"].get("succeeded") == COUNT, log)
        assert bundles_of(http, newer) == {reference}


def bundles_of(http: httpx2.Client, job_id: str) -> set[str]:
    found = http.get(f"/v1/jobs/{job_id}/items", params={"limit": 100}).json()["items"]
    assert len(found) == COUNT
    return {item["bundle"] for item in found}


def test_a_bundle_of_format_2_is_refused_by_the_previous_release_and_named(tmp_path: Path, models: Path) -> None:
    newer = tmp_path / TINY
    shutil.copytree(models / TINY, newer)
    document = json.loads((newer / "manifest.json").read_text())
    (newer / "manifest.json").write_text(json.dumps({**document, "format": 2}))
    assert Bundle.open(newer).manifest.format == 2
    previous = Release(previous_release(tmp_path / "previous"), {})
    said = previous.python(OPEN.format(path=str(newer)))
    assert "is not a manifest this version reads: format" in said
