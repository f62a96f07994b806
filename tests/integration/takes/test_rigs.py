"""Rigs of a tenant: added, found, replaced and removed."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import httpx2
import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, QuotaUsedUp
from marey.db import transaction
from marey.exporters import Coordinates, exporter_of
from marey.jobs import asset_key, tables
from marey.storage import FolderStore
from marey.takes import NewRig, add_rig, collect_garbage, get_rig, remove_rig
from marey.tenants import Actor, Quotas, create_tenant, list_audit, usage
from tests.integration.takes.test_retention import objects
from tests.servers.audit import audit
from tests.support.live_api import LiveApi
from tests.support.walker import walker

CLIP = walker(seconds=0.5)
BVH = exporter_of("bvh").encode(CLIP, Coordinates())
GLB = exporter_of("glb").encode(CLIP, Coordinates())
ANN = Actor("ann", None)


def add(http: httpx2.Client, data: bytes = BVH, **asked: str) -> httpx2.Response:
    return http.post("/v1/rigs", params={"name": "hero", "format": "bvh", **asked}, content=data)


def added(response: httpx2.Response, status: int = 201) -> dict[str, Any]:
    assert response.status_code == status, response.text
    return response.json()


def test_a_rig_is_added_once_and_found(api: LiveApi, http: httpx2.Client) -> None:
    answer = add(http)
    rig = added(answer)
    assert answer.headers["location"] == "/v1/rigs/hero"
    assert (rig["name"], rig["version"], rig["format"], rig["size"], rig["map"], rig["added_by"]) == (
        "hero", 1, "bvh", len(BVH), None, "all",
    )  # fmt: skip
    assert rig["sha256"] == rig["report"]["sha256"] == hashlib.sha256(BVH).hexdigest()
    assert rig["report"]["parts"]["left_foot"]["joint"]
    assert added(add(http), 200) == rig
    assert http.get("/v1/rigs/hero").json() == rig
    (listed,) = http.get("/v1/rigs").json()["items"]
    assert listed == {name: value for name, value in rig.items() if name != "report"}
    with transaction(api.engine) as conn:
        assert audit(conn) == []
        noted = list_audit(conn, verb="rig").rows
    assert [(row.verb, row.target, row.data["version"]) for row in noted] == [("rig.add", "hero", 1)] * 2


def test_another_file_or_map_is_a_new_version_and_the_old_file_goes(api: LiveApi, http: httpx2.Client) -> None:
    first = added(add(http, name="changing"))
    hand = first["report"]["parts"]["left_hand"]["joint"]
    mapped = added(add(http, name="changing", map=json.dumps({"left_hand": hand, "left_toes": None})))
    assert (mapped["version"], mapped["map"]) == (2, {"left_hand": hand, "left_toes": None})
    assert mapped["report"]["parts"]["left_hand"] == {"joint": hand, "how": "map"}
    assert "left_toes" not in mapped["report"]["parts"]
    another = added(add(http, GLB, name="changing", format="glb"))
    assert (another["version"], another["format"], another["map"]) == (3, "glb", None)
    assert another["created"] == first["created"] < another["updated"]
    removed = http.delete("/v1/rigs/changing")
    assert removed.status_code == 204, removed.text
    assert http.get("/v1/rigs/changing").status_code == http.delete("/v1/rigs/changing").status_code == 404
    assert not there(api, GLB)


def there(api: LiveApi, data: bytes) -> bool:
    key = asset_key("default", hashlib.sha256(data).hexdigest())
    return key in set(api.store.keys("t/"))


@pytest.mark.parametrize(
    ("data", "asked", "status", "where", "words"),
    [
        (b"no glb", {"format": "glb"}, 422, "body", "is not a glb file"),
        (b"", {}, 422, "body", ""),
        (BVH, {"format": "xyz"}, 422, "format", "Known: glb"),
        (BVH, {"name": "mixamo"}, 422, "name", "reference rig"),
        (BVH, {"name": "a.glb"}, 422, "name", ""),
        (BVH, {"map": "[1"}, 422, "map", ""),
        (BVH, {"map": "[1]"}, 422, "map", "parts and joint names"),
        (BVH, {"map": '{"head": null, "head": "head"}'}, 422, "map", "gives 'head' twice"),
        (BVH, {"map": "[]"}, 422, "map", "parts and joint names"),
        (BVH, {"map": '{"hips": null}'}, 422, "map", "no rig is without hips"),
        (BVH, {"map": '{"left_hand": "nobody"}'}, 422, "map", "has no joint 'nobody'"),
        (BVH, {"map": '{"left_foot": null}'}, 422, "body", "no joint found for left foot"),
        (BVH, {"mpa": "{}"}, 422, "mpa", "unknown parameter"),
        (b" " * (64 * 2**20 + 1), {}, 413, "body", "64 MiB"),
    ],
)
def test_a_rig_that_cannot_be_used_is_refused_with_the_reason(
    api: LiveApi, http: httpx2.Client, data: bytes, asked: dict[str, str], status: int, where: str, words: str
) -> None:
    before = set(api.store.keys("t/"))
    answer = add(http, data, **{"name": "broken", **asked})
    assert (answer.status_code, answer.json()["where"]) == (status, where), answer.text
    assert words in json.dumps(answer.json(), ensure_ascii=False)
    assert http.get("/v1/rigs/broken").status_code == 404
    assert set(api.store.keys("t/")) == before


def test_names_of_joints_that_no_text_may_hold_are_refused(http: httpx2.Client) -> None:
    answer = add(http, BVH.replace(b"JOINT ", b"JOINT \x01", 1), name="odd")
    assert (answer.status_code, answer.json()["where"]) == (422, "body"), answer.text


def test_scopes_of_the_rig_routes(api: LiveApi) -> None:
    with api.http("read") as reader:
        assert add(reader).status_code == reader.delete("/v1/rigs/hero").status_code == 403
        assert reader.get("/v1/rigs").status_code == 200


# --- rows, without an API ---


def new_rig(name: str = "hero", data: bytes = b"file", tenant: str = "default", **fields: Any) -> NewRig:
    return NewRig(tenant, name, "glb", data, fields.get("map"), {"family": None})


def test_the_numbers_of_rigs_and_bytes_are_limited(engine: sa.Engine, folder_store: FolderStore) -> None:
    with transaction(engine) as conn:
        create_tenant(conn, "small", Quotas(bytes=10))
    add_rig(engine, folder_store, new_rig(tenant="small"), ANN, limit=1)
    with pytest.raises(Conflict, match="1 are allowed"):
        add_rig(engine, folder_store, new_rig("other", tenant="small"), ANN, limit=1)
    add_rig(engine, folder_store, new_rig("other", b"larger", tenant="small"), ANN, limit=2)
    with pytest.raises(QuotaUsedUp):
        add_rig(engine, folder_store, new_rig("third", b"1", tenant="small"), ANN, limit=9)
    assert not add_rig(engine, folder_store, new_rig(tenant="small"), ANN, limit=0).changed
    with transaction(engine) as conn:
        assert usage(conn, "small").bytes == 10


def test_garbage_collection_leaves_files_of_rigs(engine: sa.Engine, folder_store: FolderStore) -> None:
    add_rig(engine, folder_store, new_rig(data=b"one"), ANN, limit=9)
    add_rig(engine, folder_store, new_rig("twin", b"one"), ANN, limit=9)
    add_rig(engine, folder_store, new_rig("other", b"two"), ANN, limit=9)
    assert collect_garbage(engine, folder_store).rows == 0
    assert add_rig(engine, folder_store, new_rig("other", b"three"), ANN, limit=9).rig.version == 2
    assert sorted(objects(folder_store)) == [b"one", b"three"]
    for name, left in (("twin", 2), ("hero", 1)):
        with transaction(engine) as conn:
            remove_rig(conn, "default", name)
        collect_garbage(engine, folder_store)
        assert len(objects(folder_store)) == left
    with transaction(engine) as conn:
        assert get_rig(conn, "default", "other").sha256 == hashlib.sha256(b"three").hexdigest()
        assert conn.execute(sa.select(sa.func.count()).select_from(tables.asset)).scalar_one() == 1
        assert audit(conn) == []


def test_a_file_that_was_lost_is_stored_again(engine: sa.Engine, folder_store: FolderStore) -> None:
    rig = add_rig(engine, folder_store, new_rig(), ANN, limit=9).rig
    folder_store.delete(asset_key("default", rig.sha256))
    assert not add_rig(engine, folder_store, new_rig(), ANN, limit=9).changed
    assert objects(folder_store) == [b"file"]
