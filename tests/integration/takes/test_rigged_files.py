"""Files that the API makes on the rigs of a tenant, and what becomes of them when the rig changes or goes."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

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
from marey.motion.body_files import body_of_rig
from marey.motion.change_body import change_body, load_shape
from marey.motion.clip import MotionClip, parse_npz
from marey.motion.export_options import REFERENCE_RIGS, ExportOptions
from marey.motion.io.glb_read import parse_glb
from marey.motion.retarget.load import parse_body
from marey.motion.retarget.reference import REFERENCES
from marey.motion.skeleton import HUMANML3D
from tests.servers.audit import audit
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker

CLIP = walker(seconds=0.5, prompt="a person walks")
NPZ = CLIP.to_npz()
GLB = exporter_of("glb").encode(CLIP, Coordinates())
FIGURE = exporter_of("glb").write(CLIP, Coordinates(rig="ue4"))
"""A character with another body, of 68 joints in an A-pose."""
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


@pytest.mark.parametrize(("format", "asked"), [("npz", {}), ("glb", {"in_place": "travel"}), ("gif", {})])
def test_a_motion_gets_the_proportions_of_a_rig_of_the_tenant(
    api: LiveApi, http: httpx2.Client, motion: str, format: str, asked: dict[str, Any]
) -> None:
    add(http, "figure", FIGURE)
    answer = get(http, motion, format, body="figure", **asked)
    assert answer.status_code == 200, answer.text
    sha256 = hashlib.sha256(FIGURE).hexdigest()
    assert answer.headers["marey-rig"] == f"figure; version=1; sha256={sha256}"
    body = body_of_rig(parse_body(FIGURE, "figure.glb"), HUMANML3D)
    local = exporter_of(format).write(change_body(CLIP, body), Coordinates.of(ExportOptions(**asked)))
    assert answer.content == local
    assert answer.content not in (get(http, motion, format, **asked).content, get(http, motion, format).content)
    if format == "npz":
        clip = parse_npz(answer.content, "npz")
        assert clip.manifest["body"] == {"name": "figure.glb", "sha256": body.sha256}
        assert "quality" not in clip.manifest
    with transaction(api.engine) as conn:
        assert audit(conn) == []


@pytest.mark.parametrize("body", ["standard", *REFERENCE_RIGS])
def test_bodies_that_are_always_there(http: httpx2.Client, motion: str, body: str) -> None:
    answer = get(http, motion, "npz", body=body)
    assert (answer.status_code, "marey-rig" in answer.headers) == (200, False), answer.text
    assert answer.content == change_body(CLIP, load_shape(body)).to_npz()
    refused = http.post("/v1/rigs", params={"name": body, "format": "glb"}, content=GLB)
    assert (refused.status_code, refused.json()["where"]) == (422, "name"), refused.text


def test_a_rig_of_a_size_that_no_human_has_is_no_body(http: httpx2.Client, motion: str) -> None:
    giant = MotionClip.of(
        HUMANML3D.with_offsets(3 * HUMANML3D.offsets), CLIP.rotations, 3 * CLIP.root, CLIP.contacts, CLIP.fps
    )
    add(http, "giant", exporter_of("glb").encode(giant, Coordinates()))
    assert get(http, motion, "bvh", rig="giant").status_code == 200
    answer = get(http, motion, "bvh", body="giant")
    found = answer.json()
    assert (answer.status_code, found["where"]) == (422, "body"), answer.text
    assert "m tall; allowed: 0.5 to 3" in found["detail"]
    assert get(http, motion, "bvh", body="giant").status_code == 422  # the reason is kept


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
        ("glb", {"body": "nobody"}, 404, "body"),
        ("glb", {"body": "/etc/hero.glb"}, 404, "body"),
        ("npz", {"body": ""}, 422, "body"),
        ("glb", {"body": "hero", "rig": "hero"}, 422, "body"),
        ("glb", {"body": "standard", "rig": "mixamo"}, 422, "body"),
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


@pytest.mark.parametrize("option", ["rig", "body"])
def test_files_go_with_the_version_of_the_rig_and_with_the_rig(
    api: LiveApi, http: httpx2.Client, motion: str, option: str
) -> None:
    add(http, "changing")
    before = rows(api.engine)
    first = get(http, motion, "glb", **{option: "changing"})
    assert rows(api.engine) == before + 1
    add(http, "changing", map='{"left_toes": null}')
    assert rows(api.engine) == before
    second = get(http, motion, "glb", **{option: "changing"})
    assert second.headers["marey-rig"] == first.headers["marey-rig"].replace("version=1", "version=2")
    assert rows(api.engine) == before + 1
    assert http.delete("/v1/rigs/changing").status_code == 204
    assert rows(api.engine) == before
    assert get(http, motion, "glb", **{option: "changing"}).status_code == 404


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
    marey("rigs", "add", hero, "--name", "héro").refused(
        2, "--name: 'héro' cannot name a rig\n  Allowed are letters from A to Z, digits, _ and -, at most 63"
    )
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
