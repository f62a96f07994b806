"""Motions of jobs on bodies of other proportions: the command line and the client put them there."""

from __future__ import annotations

import json
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from marey.client import Client
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.exporters import Coordinates, exporters
from marey.motion.body_files import read_body
from marey.motion.change_body import change_body
from marey.motion.clip import MotionClip, load_npz
from marey.motion.io.bvh import read_bvh
from marey.motion.skeleton import HUMANML3D
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.repeating import repeating
from tests.support.walker import walker
from tests.unit.motion.test_body_files import CHILD, shaped, write

CLIP = walker(seconds=0.5)
HERO = exporters()["glb"].write(CLIP, Coordinates(rig="ue4"))
"""A character with another body, of 68 joints in an A-pose."""
NAMES = ("--name-template", "{name}")


@pytest.fixture
def child(tmp_path: Path) -> Path:
    return write(tmp_path / "child.bvh", CHILD)


@pytest.fixture
def wanted(child: Path) -> MotionClip:
    return change_body(CLIP, read_body(child, HUMANML3D))


@pytest.fixture(scope="module")
def job(api: LiveApi) -> str:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks", "name": "walk"}])["id"]
    api.work(CLIP.to_npz())
    return job


def working(api: LiveApi) -> AbstractContextManager[None]:
    """Have a worker at the queue, which makes `CLIP` of every prompt."""
    return repeating(lambda: api.work(CLIP.to_npz()), 0.2)


def test_fetched_files_are_on_the_body(
    marey: Command, job: str, child: Path, wanted: MotionClip, tmp_path: Path
) -> None:
    folder = tmp_path / "clips"
    marey("fetch", job, "-o", folder, "--body", child, *NAMES).ok()
    assert (folder / "walk.npz").read_bytes() == wanted.to_npz()
    found = read_bvh(folder / "walk.bvh")
    np.testing.assert_allclose(found.skeleton.offsets[1:].sum(axis=0), wanted.offsets[1:].sum(axis=0), atol=1e-4)
    about = load_npz(folder / "walk.npz").manifest
    assert about["body"] == read_body(child, HUMANML3D).describe()
    again = marey("fetch", job, "-o", folder, *NAMES)
    assert again.code != 0
    assert "holds something else" in again.err
    marey("convert", folder / "walk.npz", folder / "back.npz", "--body", "standard").ok()
    assert load_npz(folder / "back.npz").manifest["body"]["name"] == "standard"


def test_the_client_puts_motions_on_the_body(
    api: LiveApi, job: str, child: Path, wanted: MotionClip, tmp_path: Path
) -> None:
    with Client(api.url, api.key) as client:
        client.jobs.fetch(job, tmp_path / "of_job", formats=["npz"], name_template="{name}", body=str(child))
        (motion,) = client.motions.list(job=job)
        client.motions.fetch(motion, tmp_path / "one.npz", body=str(child))
        (of_all,) = client.motions.fetch_all([motion], tmp_path / "all", body=str(child))
    for path in (tmp_path / "of_job" / "walk.npz", tmp_path / "one.npz", of_all):
        assert path.read_bytes() == wanted.to_npz()


def test_submit_fetches_on_the_body(
    marey: Command, api: LiveApi, child: Path, wanted: MotionClip, tmp_path: Path
) -> None:
    with working(api):
        ran = marey(
            *("submit", "a person walks", "--fetch", tmp_path / "clips", "--body", child, "--format", "npz"),
            *("--timeout", "60"),
        ).ok()
    (made,) = (tmp_path / "clips").glob("*.npz")
    assert made.name in ran.out
    assert made.read_bytes() == wanted.to_npz()


@pytest.mark.parametrize("command", [("fetch", "JOB"), ("submit", "a person walks", "--fetch", "clips")])
def test_bad_bodies_are_refused_before_anything_happens(
    marey: Command, api: LiveApi, job: str, tmp_path: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = [job if word == "JOB" else word for word in command]
    write(tmp_path / "giant.bvh", shaped(size=2))
    (tmp_path / "hero.fbx").write_bytes(b"x")
    with api.client() as client:
        jobs = len(list(client.pages("/v1/jobs")))
        for file, code, message in (
            ("missing.bvh", 3, "no such file"),
            ("giant.bvh", 2, "3.46 m tall; allowed: 0.5 to 3"),
            ("hero.fbx", 2, "is not an FBX file"),
            ("hero.txt", 2, "`.txt` is not a rig format"),
        ):
            ran = marey(*given, "--body", file)
            assert (ran.code, message in ran.err, file in ran.err) == (code, True, True), ran.err
        assert len(list(client.pages("/v1/jobs"))) == jobs
    assert not list(tmp_path.rglob("*.npz"))


def test_senseless_bodies_are_refused(marey: Command, api: LiveApi, job: str, child: Path, tmp_path: Path) -> None:
    ran = marey("submit", "a person walks", "--body", child)
    assert (ran.code, "--fetch" in ran.err) == (2, True)
    ran = marey("fetch", job, "-o", tmp_path, "--body", child, "--rig", "mixamo")
    assert (ran.code, "proportions of the rig" in ran.err, "Leave out --body" in ran.err) == (2, True, True)
    with Client(api.url, api.key) as client:
        for name, kind in (("gone.npz", NotFound), ("hero.txt", InvalidInput)):
            with pytest.raises(kind):
                client.jobs.fetch(job, tmp_path / "x", body=str(tmp_path / name))
        (tmp_path / "text.npz").write_text("no npz")
        (motion,) = client.motions.list(job=job)
        with pytest.raises(InvalidFile):
            client.motions.fetch(motion, tmp_path / "y.npz", body=str(tmp_path / "text.npz"))
    assert not (tmp_path / "x").exists()


def test_fetched_files_are_on_the_body_of_a_rig_file(marey: Command, job: str, tmp_path: Path) -> None:
    hero = tmp_path / "hero.glb"
    hero.write_bytes(HERO)
    marey("fetch", job, "-o", tmp_path, "--body", hero, "--format", "npz", *NAMES).ok()
    assert (tmp_path / "walk.npz").read_bytes() == change_body(CLIP, read_body(hero, HUMANML3D)).to_npz()
    (tmp_path / "map.json").write_text('{"head": null}')
    (tmp_path / "walk.npz").unlink()
    marey("fetch", job, "-o", tmp_path, "--body", hero, "--map", tmp_path / "map.json", "--format", "npz", *NAMES).ok()
    mapped = read_body(hero, HUMANML3D, tmp_path / "map.json")
    assert (tmp_path / "walk.npz").read_bytes() == change_body(CLIP, mapped).to_npz()
    assert mapped.sha256 != read_body(hero, HUMANML3D).sha256


def test_a_name_without_an_ending_is_a_rig_of_the_server_which_makes_the_files(
    marey: Command, api: LiveApi, job: str, tmp_path: Path
) -> None:
    hero, wide = tmp_path / "hero.glb", tmp_path / "hero.npz"
    hero.write_bytes(HERO)
    wide.write_bytes(b"no body")  # a file of the name is not meant
    marey("rigs", "add", hero).ok()
    wanted = change_body(CLIP, read_body(hero, HUMANML3D))
    folder = tmp_path / "clips"
    fetched = ("fetch", job, "-o", folder, "--body", "hero", "--root-bone", *NAMES)
    formats = ("--format", "npz", "--format", "bvh", "--format", "glb")
    ran = marey(*fetched, *formats, "--json").ok()
    assert set(json.loads(ran.out)["files"]) == {"npz", "bvh", "glb"}
    assert (folder / "walk.npz").read_bytes() == wanted.to_npz()
    for name in ("bvh", "glb"):
        local = exporters()[name].write(wanted, Coordinates(root_bone=True))
        assert (folder / f"walk.{name}").read_bytes() == local, name
    assert "walk.glb" in (folder / "manifest.csv").read_text()
    marey(*fetched, *formats).ok()  # nothing has changed
    (folder / "walk.glb").write_bytes(b"something else")
    marey(*fetched, *formats).refused(2, "holds something else")
    marey(*fetched, *formats, "--overwrite").ok()
    rigged = ("fetch", job, "-o", tmp_path / "rigged", "--rig", "hero", *NAMES)
    marey(*rigged, "--format", "fbx", "--format", "npz").ok()
    assert (tmp_path / "rigged" / "walk.npz").read_bytes() == CLIP.to_npz()  # npz has no rig
    local = exporters()["fbx"].write(CLIP, Coordinates(rig=str(hero)))
    assert (tmp_path / "rigged" / "walk.fbx").read_bytes() == local
    with Client(api.url, api.key) as client:
        (motion,) = client.motions.list(job=job)
        one = client.motions.fetch(motion, tmp_path / "one.npz", body="hero")
        (all_,) = client.motions.fetch_all([motion], tmp_path / "all", body="hero")
        made = client.motions.make_file(motion, tmp_path / "made.npz", body="hero")
    assert one.read_bytes() == all_.read_bytes() == made.read_bytes() == wanted.to_npz()
    marey("motions", "file", motion.id, "npz", "--body", "hero", "-o", tmp_path / "file.npz").ok()
    assert (tmp_path / "file.npz").read_bytes() == wanted.to_npz()


@pytest.mark.parametrize("command", [("fetch", "JOB"), ("submit", "a person walks", "--fetch", "clips")])
def test_unknown_rigs_of_the_server_are_refused_before_anything_happens(
    marey: Command, api: LiveApi, job: str, tmp_path: Path, command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    given = [job if word == "JOB" else word for word in command]
    with api.client() as client:
        jobs = len(list(client.pages("/v1/jobs")))
        marey(*given, "--body", "nobody").refused(3, "--body: there is no rig 'nobody'")
        assert len(list(client.pages("/v1/jobs"))) == jobs
    marey("fetch", job, "--rig", "nobody").refused(3, "--rig: there is no rig 'nobody'")
    (tmp_path / "map.json").write_text("{}")
    marey("fetch", job, "--body", "nobody", "--map", "map.json").refused(2, "--map: a rig of the server has a map")
    assert not list(tmp_path.rglob("*.npz"))


def test_submit_fetches_on_the_body_of_a_rig_of_the_server(marey: Command, api: LiveApi, tmp_path: Path) -> None:
    hero = tmp_path / "lead.glb"
    hero.write_bytes(HERO)
    marey("rigs", "add", hero).ok()
    with working(api):
        marey(
            *("submit", "a person walks", "--fetch", tmp_path / "clips", "--body", "lead", "--format", "npz"),
            *("--timeout", "60"),
        ).ok()
    (made,) = (tmp_path / "clips").glob("*.npz")
    assert made.read_bytes() == change_body(CLIP, read_body(hero, HUMANML3D)).to_npz()
