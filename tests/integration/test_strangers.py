"""A request without a key opens no database connection: it gets 401 even while the database is away."""

from __future__ import annotations

from pathlib import Path

import httpx2
import pytest

from marey.embedded import EmbeddedServer
from tests.servers.ports import free_ports
from tests.support.live_api import ApiThread, settings_of

ID = "0199f3a2-6c1d-7b4e-9a55-3f1c2d7e8b90"


@pytest.mark.parametrize(
    ("method", "path"), [("GET", "/v1/jobs"), ("GET", f"/v1/motions/{ID}"), ("POST", f"/v1/jobs/{ID}/cancel")]
)
def test_no_key_is_401_without_the_database(tmp_path: Path, valkey: EmbeddedServer, method: str, path: str) -> None:
    away = f"postgresql+psycopg://marey:secret@127.0.0.1:{free_ports(1)[0]}/marey"
    with ApiThread(settings_of(tmp_path, away, valkey.url)) as url, httpx2.Client(base_url=url, timeout=30) as http:
        assert http.request(method, path).status_code == 401
        known = http.request(method, path, headers={"Authorization": "Bearer marey_aaaaaaaa_b"})
        assert (known.status_code, known.json()["detail"]) == (503, "the database does not answer")
