"""Stored files of many motions in one tar."""

from __future__ import annotations

import io
import tarfile
from pathlib import Path
from typing import Any

import httpx2
import pytest

from marey.api.takes import packs
from marey.client import Client
from marey.core.errors import NotFound
from marey.db import transaction
from marey.jobs import asset_key
from marey.tenants import DEFAULT_TENANT, create_key, create_tenant
from tests.support.live_api import LiveApi

NOBODY = "01a2185a-bb8d-7f1c-a04c-452b827cd415"
PATH = "/v1/motions/files"


@pytest.fixture
def motions(api: LiveApi) -> list[dict[str, Any]]:
    """Six motions, made."""
    with api.client() as client:
        job = client.submit([{"prompt": f"a person walks {n} steps"} for n in range(6)])["id"]
        api.work()
        return list(client.pages(f"/v1/jobs/{job}/motions"))


def asked(http: httpx2.Client, motions: list[dict[str, Any]], *formats: str) -> httpx2.Response:
    return http.post(PATH, json={"motions": [each["id"] for each in motions], "formats": list(formats)})


def members(answer: httpx2.Response) -> dict[str, bytes]:
    assert answer.status_code == 200, answer.text
    assert answer.headers["content-type"] == "application/x-tar"
    with tarfile.open(fileobj=io.BytesIO(answer.content)) as tar:
        return {member.name: tar.extractfile(member).read() for member in tar.getmembers()}  # type: ignore[union-attr]


def test_files_of_many_motions_come_in_one_tar(http: httpx2.Client, motions: list[dict[str, Any]]) -> None:
    found = members(asked(http, motions, "bvh", "npz"))
    assert list(found) == [f"{each['id']}.{ending}" for each in motions for ending in ("bvh", "npz")]
    for name, content in found.items():
        motion, ending = name.split(".")
        answer = http.get(f"/v1/motions/{motion}/files/{ending}", params={"redirect": "false"})
        assert answer.content == content


def test_motions_and_formats_that_are_given_twice_come_once(http: httpx2.Client, motions: list[dict[str, Any]]) -> None:
    assert list(members(asked(http, [motions[0]] * 2, "npz", "npz"))) == [f"{motions[0]['id']}.npz"]


def test_what_is_missing_is_named(http: httpx2.Client, motions: list[dict[str, Any]]) -> None:
    answer = asked(http, [*motions, {"id": NOBODY}], "npz")
    assert (answer.status_code, answer.json()["where"]) == (404, f"motion {NOBODY}")
    answer = asked(http, motions, "npz", "glb")
    assert (answer.status_code, answer.json()["where"]) == (404, motions[0]["id"])
    assert "no stored glb" in answer.json()["detail"]


def test_motions_of_another_tenant_are_not_found(api: LiveApi, motions: list[dict[str, Any]]) -> None:
    with transaction(api.engine) as conn:
        create_tenant(conn, "packs")
        key = create_key(conn, "theirs", ["read"], tenant="packs").secret
    with httpx2.Client(base_url=api.url, headers={"Authorization": f"Bearer {key}"}) as theirs:
        assert asked(theirs, motions, "npz").status_code == 404


def test_more_than_is_sent_together_is_refused(
    http: httpx2.Client, motions: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = [file["size"] for each in motions for file in each["files"] if file["format"] == "npz"]
    monkeypatch.setattr(packs, "MAX_BYTES", sum(sizes) - 1)
    answer = asked(http, motions, "npz")
    assert (answer.status_code, answer.json()["where"]) == (413, "motions")
    assert members(asked(http, motions[:-1], "npz"))


def test_a_content_that_is_lost_is_left_out_and_its_fetch_says_so(
    api: LiveApi, http: httpx2.Client, motions: list[dict[str, Any]], tmp_path: Path
) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person bows"}])["id"]
        api.work(b"another content")
        (lost,) = client.pages(f"/v1/jobs/{job}/motions")
    api.store.delete(asset_key(DEFAULT_TENANT, next(f["sha256"] for f in lost["files"] if f["format"] == "npz")))
    names = [f"{each['id']}.npz" for each in motions]
    assert list(members(asked(http, [*motions[:3], lost, *motions[3:]], "npz"))) == names
    with Client(api.url, api.key) as client:
        found = [client.motions.get(each["id"]) for each in [*motions[:3], lost, *motions[3:]]]
        with pytest.raises(NotFound):
            client.motions.fetch_all(found, tmp_path / "out")
    assert sorted(path.name for path in (tmp_path / "out").glob("*.npz")) == sorted(names)
