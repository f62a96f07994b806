"""Rigs and motions of FBX files by other programs: read as ufbx and Blender read them, to a millimetre."""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest

from marey.motion.io.fbx_read import read_fbx
from marey.motion.rigs.read import read_rig
from tests.support.archives import archive
from tests.support.clients import blender, python
from tests.support.fbx import scene_file

pytestmark = [pytest.mark.slow, pytest.mark.data]

FILES = ("maya_human_ik_7400_binary.fbx", "91_48.fbx")


def rest_of(seen) -> dict[str, np.ndarray]:
    """The matrices (3, 4) of ufbx by name."""
    return dict(zip(seen["names"], np.array(seen["rest"]), strict=True))


@pytest.mark.parametrize("name", FILES)
def test_a_rig_is_where_ufbx_has_it(name):
    rig = read_rig(archive(f"rigs/{name}"))
    seen = rest_of(json.loads(python("MAREY_UFBX_PYTHON", "ufbx_joints.py", archive(f"rigs/{name}"))))
    assert len(rig) >= 44
    for joint, position in zip(rig.joint_names, rig.positions, strict=True):
        np.testing.assert_allclose(position, seen[joint][:, 3] * rig.unit, atol=1e-3)


@pytest.mark.parametrize("order", range(6))
def test_transforms_are_those_of_ufbx(order, tmp_path):
    random = np.random.default_rng(order)
    names = ("Lcl Translation", "RotationOffset", "RotationPivot", "ScalingOffset", "ScalingPivot")
    turns = ("PreRotation", "PostRotation", "Lcl Rotation")
    models = []
    for k in range(5):
        properties = {name: tuple(random.normal(0, 10, 3)) for name in names}
        properties |= {name: tuple(random.uniform(-180, 180, 3)) for name in turns}
        properties |= {"Lcl Scaling": (random.uniform(0.5, 2),) * 3, "RotationOrder": (order,), "RotationActive": (1,)}
        models.append((f"j{k}", k - 1, properties | {"InheritType": (int(random.integers(3)),)}))
    (tmp_path / "a.fbx").write_bytes(scene_file(models))
    rig = read_rig(tmp_path / "a.fbx")
    seen = rest_of(json.loads(python("MAREY_UFBX_PYTHON", "ufbx_joints.py", tmp_path / "a.fbx")))
    for joint, position in zip(rig.joint_names, rig.positions, strict=True):
        np.testing.assert_allclose(position, seen[joint][:, 3] * rig.unit, atol=1e-6)


def test_a_motion_is_where_blender_has_it(tmp_path):
    shutil.copy(archive("rigs/91_48.fbx"), tmp_path / "a.fbx")
    blender("blender_motions.py", tmp_path, "wm.fbx_import")
    clip = read_fbx(tmp_path / "a.fbx")
    with np.load(tmp_path / "a.npz") as seen:
        order = [list(seen["names"]).index(joint) for joint in clip.skeleton.joint_names]
        rows = np.rint(seen["times"] * clip.fps).astype(int)
        whole = np.abs(seen["times"] * clip.fps - rows) < 1e-3
        off = seen["joints"][whole][:, order] - clip.joints()[rows[whole]]
        assert whole.sum() > 100
        assert np.linalg.norm(off, axis=-1).max() < 1e-3 * 100, "a millimetre of a body that is 100 times too large"
