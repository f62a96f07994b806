"""Files of motions where the asset store is S3: the API sends clients there."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx2
import pytest
from pydantic import SecretStr

from services.cli.fetching import Download, download_all
from shared.hashing import sha256_of
from shared.jobs import create_engine, create_key, transaction
from shared.storage import open_store
from shared.storage.s3 import S3Store
from tests.support.live_api import ApiThread, LiveApi, settings_of


@pytest.fixture
def api(database_url: str, queue_url: str, s3_store: S3Store, tmp_path: Path) -> Iterator[LiveApi]:
    options = s3_store.options
    config = settings_of(tmp_path / "home", database_url, queue_url).model_copy(
        update={
            "store": f"s3://{options.bucket}",
            "s3_endpoint": options.endpoint,
            "s3_access_key": SecretStr(options.access_key),
            "s3_secret_key": SecretStr(options.secret_key),
        }
    )
    engine = create_engine(database_url)
    with transaction(engine) as conn:
        key = create_key(conn, "all", ["admin"]).secret
    with ApiThread(config) as url:
        yield LiveApi(url, key, engine, open_store(config))
    engine.dispose()


def test_a_file_is_fetched_from_a_signed_url_without_the_key(api: LiveApi, tmp_path: Path) -> None:
    content = bytes(range(256)) * 100
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])
        api.work(content)
        (motion,) = client.pages(f"/v1/jobs/{job['id']}/motions")
        path = f"/v1/motions/{motion['id']}/files/npz"
        with api.http() as http:
            answer = http.get(path)
            assert answer.status_code == 307
        signed = answer.headers["location"]
        assert httpx2.get(signed).content == content
        assert httpx2.get(signed[:-4] + "0000").status_code == 403
        digest = next(file for file in motion["files"] if file["format"] == "npz")
        target = Download(path, digest["sha256"], digest["size"], tmp_path / "x.npz")
        (tmp_path / "x.npz.part").write_bytes(content[:1000])
        download_all(client, [target], overwrite=False, done=lambda _: None)
    assert sha256_of(tmp_path / "x.npz") == digest["sha256"]
