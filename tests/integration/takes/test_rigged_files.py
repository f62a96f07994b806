"""Files that the API makes on the rigs of a tenant, and what becomes of them when the rig changes or goes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import httpx2
import pytest
import sqlalchemy as sa

from marey.api.making import maker
from marey.client import Client
from marey.core.errors import NotFound
from marey.db import transaction
from marey.exporters import Coordinates, exporter_of
from marey.exporters.making import FileRecipe, RigFile
from marey.jobs import tables
from marey.motion.export_options import REFERENCE_RIGS, ExportOptions
from marey.motion.io.glb_read import parse_glb
from marey.motion.retarget.reference import REFERENCES
from tests.servers.audit import audit
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker

CLIP = walker(seconds=0.5, prompt="a person walks")
NPZ = CLIP.to_npz()
GLB = exporter_of("glb").encode(CLIP, Coordinates())
SHA256 = hashlib.sha256(GLB).hexdigest()


@pytest.fixture(autouse=True)
def patient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maker, "WAIT_SECONDS", 60.0)


@pytest.fixture(scope="module")
def motion(api: LiveApi) -> str:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks"}])
        api.work(NPZ)
        (found,) = client.pages(f"/v1/jobs/{job['id']}/motions")
    return found["id"]


def add(http: httpx2.Client, name: str, data: bytes = GLB, **asked: str) -> None:
    answer = http.post("/v1/rigs", params={"name": name, "format": "glb", **asked}, content=data)
    assert answer.status_code < 300, answer.text


def get(http: httpx2.Client, motion: str, format: str, **asked: str) -> httpx2.Response:
    return http.get(f"/v1/motions/{motion}/files/{format}", params=asked)


def rows(engine: sa.Engine) -> int:
    with transaction(engine) as conn:
        return conn.execute(sa.select(sa.func.count()).select_from(tables.made_file)).scalar_one()


def test_a_motion_is_put_on_a_rig_of_the_tenant(api: LiveApi, http: httpx2.Client, motion: str) -> None:
    add(http, "hero")
    answer = get(http, motion, "glb", rig="hero", in_place="travel")
    assert answer.status_code == 200, answer.text
    options = ExportOptions(rig="hero", in_place="travel")
    recipe = FileRecipe("glb", options, rig=RigFile("hero", "glb", SHA256))
    assert answer.content == recipe.make(NPZ, "motion", GLB)
    assert answer.headers["marey-rig"] == f"hero; version=1; sha256={SHA256}"
    about = parse_glb(answer.content, "glb").manifest["rig"]
    assert (about["name"], about["sha256"]) == ("hero.glb", SHA256)
    cached = http.get(
        f"/v1/motions/{motion}/files/glb",
        params={"rig": "hero", "in_place": "travel"},
        headers={"If-None-Match": answer.headers["etag"]},
    )
    assert (cached.status_code, cached.headers["marey-rig"]) == (304, answer.headers["marey-rig"])
    with transaction(api.engine) as conn:
        assert audit(conn) == []


@pytest.mark.parametrize("rig", [*REFERENCE_RIGS, "hero"])
@pytest.mark.parametrize("format", ["fbx", "bvh"])
def test_other_formats_and_reference_rigs(http: httpx2.Client, motion: str, rig: str, format: str) -> None:
    add(http, "hero")
    answer = get(http, motion, format, rig=rig)
    assert answer.status_code == 200, answer.text
    assert ("marey-rig" in answer.headers) == (rig == "hero")
    assert answer.content != get(http, motion, format).content


def test_the_reference_rigs_are_those_of_the_tables() -> None:
    assert set(REFERENCE_RIGS) == set(REFERENCES)


@pytest.mark.parametrize(
    ("format", "asked", "status", "where"),
    [
        ("glb", {"rig": "nobody"}, 404, "rig"),
        ("glb", {"rig": "/etc/hero.glb"}, 404, "rig"),
        ("npz", {"rig": "mixamo"}, 422, "rig"),
        ("gif", {"rig": "hero"}, 422, "rig"),
        ("glb", {"rig": "hero", "mesh": "true"}, 422, "mesh"),
        ("glb", {"rig": "hero", "rig_map": "x.json"}, 422, "rig_map"),
        ("bvh", {"rig": "hero", "root_bone": "true"}, 422, "root_bone"),
    ],
)
def test_senseless_requests_are_refused(
    http: httpx2.Client, motion: str, format: str, asked: dict[str, str], status: int, where: str
) -> None:
    add(http, "hero")
    answer = get(http, motion, format, **asked)
    assert (answer.status_code, answer.json()["where"]) == (status, where), answer.text


def test_files_go_with_the_version_of_the_rig_and_with_the_rig(api: LiveApi, http: httpx2.Client, motion: str) -> None:
    add(http, "changing")
    before = rows(api.engine)
    first = get(http, motion, "glb", rig="changing")
    assert rows(api.engine) == before + 1
    add(http, "changing", map='{"left_toes": null}')
    assert rows(api.engine) == before
    second = get(http, motion, "glb", rig="changing")
    assert second.headers["marey-rig"] == first.headers["marey-rig"].replace("version=1", "version=2")
    assert rows(api.engine) == before + 1
    assert http.delete("/v1/rigs/changing").status_code == 204
    assert rows(api.engine) == before
    assert get(http, motion, "glb", rig="changing").status_code == 404


def test_the_client_and_the_command_line(api: LiveApi, marey: Command, motion: str, tmp_path: Path) -> None:
    hero, odd, walk = tmp_path / "hero.glb", tmp_path / "my hero.glb", tmp_path / "walk.fbx"
    rig_map = tmp_path / "map.json"
    hero.write_bytes(GLB)
    odd.write_bytes(b"no glb")
    rig_map.write_text('{"left_toes": null}')
    done = marey("rigs", "add", hero, "--name", "lead").ok()
    assert (done.out.strip(), "version 1" in done.err) == ("lead", True)
    assert json.loads(marey("rigs", "add", hero, "--name", "lead", "--json").ok().out)["version"] == 1
    assert "version 2" in marey("rigs", "add", hero, "--name", "lead", "--map", rig_map).ok().err
    assert "lead" in marey("rigs", "list").ok().out
    marey("rigs", "add", odd).refused(2, "--name")
    marey("rigs", "add", odd, "--name", "odd").refused(2, f"{odd}: is not a glb file")
    rig_map.write_text('{"left_hand": "nobody"}')
    marey("rigs", "add", hero, "--map", rig_map).refused(2, f"{rig_map}: left_hand")
    marey("motions", "file", motion, "fbx", "--rig", "lead", "-o", walk).ok()
    with Client(api.url, api.key) as client:
        assert client.rigs.get("lead").map == {"left_toes": None}
        same = client.motions.make_file(motion, tmp_path / "same.fbx", rig="lead")
        assert same.read_bytes() == walk.read_bytes()
        assert [rig.name for rig in client.rigs.list(limit=1)] == ["lead"]
        with pytest.raises(NotFound, match="no rig 'nobody'"):
            client.motions.make_file(motion, tmp_path / "no.fbx", rig="nobody")
    marey("rigs", "remove", "lead", "nobody", "--yes").refused(3, "no rig 'nobody'")
    marey("rigs", "remove", "lead", "--yes").ok()
    marey("rigs", "remove", "lead", "--yes").refused(3, "marey rigs list")
