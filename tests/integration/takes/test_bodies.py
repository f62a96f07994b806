"""Motions of jobs on bodies of other proportions: the command line and the client put them there."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest

from marey.client import Client
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.motion.body_files import read_body
from marey.motion.change_body import change_body
from marey.motion.clip import MotionClip, load_npz
from marey.motion.io.bvh import read_bvh
from marey.motion.skeleton import HUMANML3D
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker
from tests.unit.motion.test_body_files import CHILD, shaped, write

CLIP = walker(seconds=0.5)
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
    ended = threading.Event()

    def work() -> None:
        while not ended.wait(0.2):
            api.work(CLIP.to_npz())

    worker = threading.Thread(target=work)
    worker.start()
    try:
        ran = marey(
            *("submit", "a person walks", "--fetch", tmp_path / "clips", "--body", child, "--format", "npz"),
            *("--timeout", "60"),
        ).ok()
    finally:
        ended.set()
        worker.join()
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
            ("hero.fbx", 2, "is not a body"),
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
        for name, kind in (("gone.npz", NotFound), ("hero.glb", InvalidInput)):
            with pytest.raises(kind):
                client.jobs.fetch(job, tmp_path / "x", body=str(tmp_path / name))
        (tmp_path / "text.npz").write_text("no npz")
        (motion,) = client.motions.list(job=job)
        with pytest.raises(InvalidFile):
            client.motions.fetch(motion, tmp_path / "y.npz", body=str(tmp_path / "text.npz"))
    assert not (tmp_path / "x").exists()
