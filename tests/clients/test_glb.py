"""Written glb files in other programs: valid, and every joint where the npz has it.

`tests.support.clients` says what has to be installed.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.io.glb_write import write_glb
from tests.support.clients import blender, node
from tests.support.exported import CLIPS, LONG
from tests.support.opened import opened_in_blender, opened_in_three

pytestmark = pytest.mark.slow

ALL = CLIPS | LONG
NAMES = list(ALL)
VARIANTS = {"plain": {}, "root bone": {"root_bone": True}, "T-pose": {"tpose_frame": True, "root_bone": True}}
VARIANTS |= {"body": {"mesh": True}, "body and root bone": {"mesh": True, "root_bone": True}}


CASES = [
    (name, variant)
    for name in CLIPS
    for variant, options in VARIANTS.items()
    if not ("root_bone" in options and "root" in CLIPS[name].skeleton.joint_names)
]


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_the_validator_of_khronos_has_nothing_to_say(name, variant, tmp_path):
    content = exporter_of("glb").write(CLIPS[name], Coordinates(**VARIANTS[variant]))
    (tmp_path / "a.glb").write_bytes(content)
    messages = node("glb_faults.mjs", "gltf-validator", tmp_path / "a.glb")
    assert {(each["code"], each["severity"]) for each in messages} <= {("UNUSED_OBJECT", 2)}, "there is no mesh"


@pytest.mark.parametrize("name", NAMES)
def test_three_puts_every_joint_where_the_npz_has_it(name, tmp_path):
    clip = ALL[name]
    write_glb(tmp_path / "a.glb", clip)
    seen = opened_in_three(tmp_path / "a.glb")
    seen.check(clip.skeleton.joint_names, clip.joints, clip.fps)
    assert seen.extras["manifest"] == json.loads(json.dumps(clip.manifest))


@pytest.fixture(scope="module")
def imported(tmp_path_factory) -> Path:
    """All files, seen by Blender; one process, because it takes seconds to start."""
    folder = tmp_path_factory.mktemp("blender")
    for number, name in enumerate(NAMES):
        write_glb(folder / f"{number}.glb", ALL[name])
    blender("blender_motions.py", folder, "import_scene.gltf")
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_blender_puts_every_joint_where_the_npz_has_it(name, imported):
    clip, seen = ALL[name], opened_in_blender(imported / f"{NAMES.index(name)}.npz")
    seen.check(clip.skeleton.joint_names, clip.joints, clip.fps)
    assert seen.empties == 0, "every joint is a bone"
    assert seen.rest[:, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor at rest"
