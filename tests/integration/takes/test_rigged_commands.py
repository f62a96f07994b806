"""`--rig FILE` through the command line: a character's file in, motions on its joints out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.exporters import Coordinates, exporters
from marey.motion.clip import MotionClip, load_npz
from marey.motion.export_options import ExportOptions
from marey.motion.retarget import load_body, on_body, source_of
from marey.motion.rotations import Array
from marey.motion.skeleton import HUMANML3D
from tests.support.command import Command
from tests.support.live_api import LiveApi
from tests.support.walker import walker

CLIP = walker(seconds=1)
FORMATS = ("bvh", "glb", "fbx")


@pytest.fixture(scope="module", params=["glb", "fbx", "bvh"])
def hero(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a character of 68 joints in an A-pose, with other joint axes and a motion of its own."""
    path = tmp_path_factory.mktemp("rigs") / f"hero.{request.param}"
    options = ExportOptions(rig="ue4", tpose_frame=True)
    path.write_bytes(exporters()[request.param].write(walker(seconds=2, turn=0.5), Coordinates.of(options, "cm", "y")))
    return path


def joints_of(path: Path) -> dict[str, Array]:
    """Return the places (T, 3) of the joints of a file by their names, metres."""
    decode = exporters()[path.suffix[1:]].decode
    assert decode is not None
    clip = decode(path.read_bytes(), path.name, Coordinates())
    joints: Any = clip.joints
    places: Array = np.asarray(joints() if callable(joints) else joints)
    return {name: places[:, joint] for joint, name in enumerate(clip.skeleton.joint_names)}


def check(path: Path, clip: MotionClip, hero: Path) -> None:
    """Compare a file with the clip on the rig, and its hands and toes with the clip itself."""
    body = load_body(hero)
    wanted, found = on_body(clip, body).world()[1], joints_of(path)
    for joint, name in enumerate(body.rig.joint_names):
        if name in found and name != "root":
            assert np.linalg.norm(found[name] - wanted[:, joint], axis=-1).max() <= 1e-3, (path.name, name)
    assert {"pelvis", "hand_l", "ball_r", "index_01_l", "thigh_twist_01_r"} <= found.keys()
    source = source_of(clip)
    scale = body.leg / source.body.leg
    for name, own, most in (("hand_l", "L_wrist", 0.25), ("ball_l", "L_foot", 0.08), ("ball_r", "R_foot", 0.08)):
        theirs = scale * clip.joints[:, HUMANML3D.index(own)]
        assert np.linalg.norm(found[name] - theirs, axis=-1).max() < most, name


def test_convert(hero: Path, tmp_path: Path) -> None:
    marey = Command({"MAREY_HOME": str(tmp_path)})
    (tmp_path / "walk.npz").write_bytes(CLIP.to_npz())
    for format in FORMATS:
        out = tmp_path / f"walk.{format}"
        marey("convert", tmp_path / "walk.npz", out, "--rig", hero).ok()
        check(out, CLIP, hero)


@pytest.mark.parametrize("hero", ["fbx"], indirect=True)
def test_generate(hero: Path, tmp_path: Path) -> None:
    marey = Command({"MAREY_HOME": str(tmp_path), "MAREY_THREADS": "1"})
    formats = [word for format in FORMATS for word in ("--format", format)]
    marey(
        *("generate", "a person waves with the left hand", "--seconds", "2", "--bundle", "hgm3-starter"),
        *("--rig", hero, "-o", tmp_path / "clips", *formats, "--format", "npz"),
    ).ok()
    (npz,) = (tmp_path / "clips").glob("*.npz")
    for format in FORMATS:
        check(npz.with_suffix(f".{format}"), load_npz(npz), hero)


def test_fetch(marey: Command, api: LiveApi, hero: Path, tmp_path: Path) -> None:
    with api.client() as client:
        job = client.submit([{"prompt": "a person walks", "name": "walk"}])["id"]
    api.work(CLIP.to_npz())
    formats = [word for format in FORMATS for word in ("--format", format)]
    gone = marey("fetch", job, "-o", tmp_path / "none", "--rig", tmp_path / "none.fbx", "--format", "fbx")
    gone.refused(3, "none.fbx: no such file")
    assert "goes on" not in gone.err
    assert not (tmp_path / "none").exists()
    marey("fetch", job, "-o", tmp_path, "--rig", hero, *formats, "--name-template", "{name}").ok()
    for format in FORMATS:
        check(tmp_path / f"walk.{format}", CLIP, hero)
