"""Written FBX files in other programs: every joint where the npz has it, at the time of each key.

`tests.support.clients` says what has to be installed.
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.clip import MotionClip
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import multiply, rotate
from marey.viz.mannequin import mannequin
from tests.support.clients import blender, node, python
from tests.support.exported import CLIPS
from tests.support.walker import walker

pytestmark = pytest.mark.slow

RATES = {"24": 24.0, "25": 25.0, "30": 30.0, "60": 60.0, "23.976": 24000 / 1001}
LONG = {f"10 s at {name} fps": walker(seconds=10, fps=fps, turn=0.3) for name, fps in RATES.items()}
ALL = CLIPS | LONG
VARIANTS = {
    "plain": {},
    "root bone": {"root_bone": True},
    "T-pose": {"tpose_frame": True},
    "body": {"mesh": True, "root_bone": True},
    "metres, Z up": {"unit": "m", "up": "z", "mesh": True},
}
OPERATORS = ("import_scene.fbx", "wm.fbx_import")
CASES = [(name, "plain") for name in ALL] + [("a walk", variant) for variant in VARIANTS if variant != "plain"]


def written(folder: Path, name: str, variant: str) -> tuple[Path, MotionClip]:
    path = folder / "a.fbx"
    path.write_bytes(exporter_of("fbx").write(ALL[name], Coordinates(**VARIANTS[variant])))
    return path, ALL[name]


def check(joints: np.ndarray, names: list[str], clip: MotionClip, variant: str) -> None:
    order = [names.index(joint) for joint in clip.skeleton.joint_names]
    first = int("tpose_frame" in VARIANTS[variant])
    assert len(joints) == clip.frames + first
    assert np.linalg.norm(joints[first:, order] - clip.joints, axis=-1).max() < 1e-3
    if first:
        assert joints[0, order, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor in the T-pose"


def body(clip: MotionClip) -> np.ndarray:
    """Points of the mannequin in the last frame."""
    mesh = mannequin(clip)
    turns = global_rotations(clip.skeleton, clip.rotations.astype(float))[-1]
    return clip.joints[-1][mesh.joints] + rotate(turns[mesh.joints], mesh.points)


@pytest.fixture(scope="module", params=OPERATORS)
def imported(request, tmp_path_factory) -> tuple[Path, str]:
    """All files, seen by one of Blender's importers; one process, because it takes seconds to start."""
    folder = tmp_path_factory.mktemp("blender")
    for number, (name, variant) in enumerate(CASES):
        path, _ = written(folder, name, variant)
        path.rename(folder / f"{number}.fbx")
    blender("blender_fbx.py", folder, request.param)
    return folder, request.param


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_blender_puts_every_joint_where_the_npz_has_it(name, variant, imported):
    (folder, operator), clip = imported, ALL[name]
    with np.load(folder / f"{CASES.index((name, variant))}.npz") as seen:
        assert seen["empties"] == 0, "every joint is a bone"
        check(seen["joints"], list(seen["names"]), clip, variant)
        frames = seen["times"] * float(seen["fps"])
        if operator == OPERATORS[0]:  # the older importer places keys by a rate of its own: 23.976 is 24, 12.5 is 12
            step = 12 / 12.5 if clip.fps == 12.5 else 1.0
            np.testing.assert_allclose(frames, step * np.arange(len(frames)), atol=0.02 + 2e-3 * len(frames))
        else:
            np.testing.assert_allclose(seen["times"], np.arange(len(frames)) / clip.fps, atol=1e-4)
            assert float(seen["fps"]) == pytest.approx(clip.fps, rel=1e-4)
        assert seen["rest"][:, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor at rest"
        if "mesh" in VARIANTS[variant]:
            assert np.linalg.norm(seen["points"] - body(clip), axis=-1).max() < 1e-3


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_three_puts_every_joint_where_the_npz_has_it(name, variant, tmp_path):
    if "up" in VARIANTS[variant]:
        pytest.xfail("FBXLoader ignores axes and unit")
    path, clip = written(tmp_path, name, variant)
    seen = node("three_fbx.mjs", "three", path)
    check(np.array(seen["joints"]) / 100, seen["names"], clip, variant)
    np.testing.assert_allclose(seen["times"], np.arange(len(seen["times"])) / clip.fps, atol=1e-4)
    assert np.array(seen["rest"])[:, 1].min() == pytest.approx(0, abs=0.01)
    assert len(seen["meshes"]) == ("mesh" in VARIANTS[variant])


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_ufbx_puts_every_joint_where_the_npz_has_it(name, variant, tmp_path):
    path, clip = written(tmp_path, name, variant)
    seen = json.loads(python("MAREY_UFBX_PYTHON", "ufbx_joints.py", path, clip.fps))
    local = np.array(seen["local"]).swapaxes(0, 1)
    names, parents = seen["names"], seen["parents"]
    turns, places = local[..., [6, 3, 4, 5]], local[..., :3].copy()
    order = [seen["moving"].index(each) if each in seen["moving"] else -1 for each in names]
    world: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for index, (parent, at) in enumerate(zip(parents, order, strict=True)):
        if at < 0:
            continue
        turn, place = turns[:, at], places[:, at]
        if parent in world:
            above, origin = world[parent]
            turn, place = multiply(above, turn), origin + rotate(above, place)
        world[index] = (turn, place)
    joints = np.stack([place for _, place in world.values()], axis=1)
    unit, up = VARIANTS[variant].get("unit"), VARIANTS[variant].get("up")
    joints = joints * (1 if unit == "m" else 0.01)
    if up == "z":
        joints = joints[..., [0, 2, 1]] * [1, 1, -1]
    check(joints, [names[index] for index in world], clip, variant)
    np.testing.assert_allclose(seen["times"], np.arange(len(joints)) / clip.fps, atol=1e-4)
