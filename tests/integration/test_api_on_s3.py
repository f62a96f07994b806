"""Files of motions where the asset store is S3: the API sends clients there."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Iterator
from email.utils import parsedate_to_datetime
from pathlib import Path

import httpx2
import pytest
from pydantic import SecretStr

from marey.api.making import maker
from marey.client import Client
from marey.client.downloads import ATTEMPTS, download_all
from marey.client.file_to_fetch import FileToFetch
from marey.core.errors import InvalidInput, Unreachable
from marey.core.hashing import sha256_of
from marey.db import create_engine, transaction
from marey.exporters import Coordinates, exporter_of
from marey.exporters.making import FileRecipe
from marey.jobs import asset_key
from marey.motion.clip import parse_npz
from marey.motion.export_options import ExportOptions
from marey.storage import open_store
from marey.storage.s3 import S3Store
from marey.tenants import DEFAULT_TENANT, create_key
from tests.support.editing import edited, stored
from tests.support.live_api import ApiThread, LiveApi, settings_of
from tests.support.walker import walker


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
            assert http.head(path).headers["content-length"] == str(len(content))
            sent = http.get(path, params={"redirect": "false"}, headers={"Range": "bytes=0-9"})
            assert (sent.status_code, sent.content) == (206, content[:10])
        signed = answer.headers["location"]
        fetched = httpx2.get(signed)
        assert fetched.content == content
        assert fetched.headers["content-disposition"] == sent.headers["content-disposition"]
        assert f"00000_a-person-walks_{motion['seed']}.npz" in sent.headers["content-disposition"]
        assert httpx2.get(signed[:-4] + "0000").status_code == 403
        digest = next(file for file in motion["files"] if file["format"] == "npz")
        target = FileToFetch(path, digest["sha256"], digest["size"], tmp_path / "x.npz")
        (tmp_path / "x.npz.part").write_bytes(content[:1000])
        download_all(client, [target], overwrite=False, done=lambda _: None)
    assert sha256_of(tmp_path / "x.npz") == digest["sha256"]
    assert parsedate_to_datetime(answer.headers["expires"]) > parsedate_to_datetime(answer.headers["date"])


def test_a_file_on_a_rig_of_the_bucket_is_fetched_from_the_bucket(api: LiveApi, tmp_path: Path) -> None:
    clip = walker(seconds=0.5)
    hero = tmp_path / "hero.glb"
    hero.write_bytes(exporter_of("glb").encode(clip, Coordinates()))
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])
        api.work(clip.to_npz())
        (motion,) = client.pages(f"/v1/jobs/{job['id']}/motions")
    with Client(api.url, api.key) as client, api.http() as http:
        rig = client.rigs.add(hero)
        path = client.motions.make_file(motion["id"], tmp_path / "walk.fbx", rig="hero")
        answer = http.get(f"/v1/motions/{motion['id']}/files/fbx", params={"rig": "hero"})
        assert answer.status_code == 307
        assert answer.headers["marey-rig"] == f"hero; version=1; sha256={rig.sha256}"
        assert httpx2.get(answer.headers["location"]).content == path.read_bytes()
        client.rigs.remove(rig)
    assert not api.store.exists(asset_key(DEFAULT_TENANT, rig.sha256))


def test_a_file_made_on_request_is_fetched_from_the_bucket(
    api: LiveApi, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maker, "WAIT_SECONDS", 0.05)  # so that the client has to ask again
    npz = walker(seconds=0.3).to_npz()
    with api.client() as transport:
        job = transport.submit([{"prompt": "a person walks"}])
        api.work(npz)
        (motion,) = transport.pages(f"/v1/jobs/{job['id']}/motions")
    with Client(api.url, api.key) as client:
        path = client.motions.make_file(motion["id"], tmp_path / "walk.glb", fps=24, root_bone=True)
        wanted = FileRecipe("glb", ExportOptions(root_bone=True), 24.0).make(npz, "motion")
        assert path.read_bytes() == wanted
        with pytest.raises(InvalidInput, match="unknown parameter 'rooty_bone'"):
            client.motions.make_file(motion["id"], tmp_path / "other.glb", rooty_bone=True)
    with api.http() as http:
        answer = http.get(f"/v1/motions/{motion['id']}/files/glb?fps=24&root_bone=true")
    assert answer.status_code == 307
    assert httpx2.get(answer.headers["location"]).content == wanted


def test_a_motion_in_the_bucket_is_edited_and_its_result_is_stored_there(api: LiveApi) -> None:
    source = stored(api)
    (motion,) = edited(api, source["id"], {"op": "trim", "from": "f5", "to": "f20"})
    assert (motion["frames"], motion["edited_from"]) == (16, [source["id"]])
    with api.http() as http:
        answer = http.get(f"/v1/motions/{motion['id']}/files/npz")
    assert answer.status_code == 307
    assert parse_npz(httpx2.get(answer.headers["location"]).content).frames == 16


def test_signed_urls_that_expired_are_asked_for_anew(
    api: LiveApi, s3_store: S3Store, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = b"motion" * 100
    key = asset_key(DEFAULT_TENANT, hashlib.sha256(content).hexdigest())
    s3_store.put(key, content)
    expired = s3_store.presign(key, filename="x.npz", media_type="x/y", seconds=1)
    assert expired is not None
    while httpx2.get(expired).status_code != 403:
        time.sleep(0.1)
    signed = S3Store.presign
    given: list[str] = []

    def stale_at_first(store: S3Store, key: str, **options: str) -> str | None:
        given.append(key)
        return expired if len(given) < ATTEMPTS else signed(store, key, **options)

    monkeypatch.setattr(S3Store, "presign", stale_at_first)
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])
        api.work(content)
        (motion,) = client.pages(f"/v1/jobs/{job['id']}/motions")
        digest = hashlib.sha256(content).hexdigest()
        target = FileToFetch(f"/v1/motions/{motion['id']}/files/npz", digest, len(content), tmp_path / "x.npz")
        download_all(client, [target], overwrite=False, done=lambda _: None)
        assert (tmp_path / "x.npz").read_bytes() == content
        assert len(given) == ATTEMPTS
        (tmp_path / "x.npz").unlink()
        monkeypatch.setattr(S3Store, "presign", lambda *_, **__: expired)
        with pytest.raises(Unreachable, match="answered 403 to a URL that was signed") as caught:
            download_all(client, [target], overwrite=False, done=lambda _: None)
        assert "Signature" not in str(caught.value)
    assert list(tmp_path.glob("x.*")) == []
