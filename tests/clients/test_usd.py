"""Written USD files: the validators of pxr.UsdValidation find no fault, and joints are where the npz has them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.clients import blender, python
from tests.support.exported import CLIPS, LONG
from tests.support.marey import REPOSITORY
from tests.support.opened import Opened, opened_in_blender, opened_in_usd

pytestmark = pytest.mark.slow

ALL = CLIPS | LONG
VARIANTS = {
    "plain": {},
    "body, metres, Z up": {"mesh": True, "root_bone": True, "unit": "m", "up": "z"},
    "T-pose": {"tpose_frame": True},
}
CASES = [(name, "plain") for name in ALL] + [("a walk", variant) for variant in VARIANTS if variant != "plain"]


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """All files and what `usd-core` sees in them; a process for each step, because it takes seconds to start."""
    folder = tmp_path_factory.mktemp("usd")
    for number, (name, _) in enumerate(CASES):
        ALL[name].save_npz(folder / f"{number}.npz")
    options = {str(number): VARIANTS[variant] for number, (_, variant) in enumerate(CASES)}
    python("MAREY_USD_PYTHON", "usd_write.py", REPOSITORY / "shared", folder, json.dumps(options))
    python("MAREY_USD_PYTHON", "usd_check.py", folder)
    return folder


@pytest.fixture(scope="module")
def imported(files: Path) -> Path:
    """The same files, seen by Blender, beside those of `usd-core`."""
    blender("blender_motions.py", files, "wm.usd_import")
    return files


def stands_at_rest(seen: Opened) -> bool:
    """Say if the toes are on the floor in the rest pose."""
    return seen.rest is not None and seen.rest[:, 1].min() == pytest.approx(0, abs=1e-4)


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_usd_core_puts_every_joint_where_the_npz_has_it(name, variant, files):
    clip, seen = ALL[name], opened_in_usd(files / f"{CASES.index((name, variant))}.json")
    seen.check(clip.skeleton.joint_names, clip.joints, clip.fps, first=int("tpose_frame" in VARIANTS[variant]))
    assert stands_at_rest(seen)


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_blender_puts_every_joint_where_the_npz_has_it(name, variant, imported):
    clip, seen = ALL[name], opened_in_blender(imported / f"{CASES.index((name, variant))}.npz")
    seen.check_places(clip.skeleton.joint_names, clip.joints, first=int("tpose_frame" in VARIANTS[variant]))
    assert stands_at_rest(seen)
    # Blender makes a frame of each time code, and keeps the rate of the scene
    np.testing.assert_allclose(seen.times * seen.fps, np.arange(len(seen.times)), atol=1e-4)
    assert (len(seen.points) > 1000) == ("mesh" in VARIANTS[variant])


def test_the_validators_find_faults_where_there_are_some(tmp_path):
    (tmp_path / "a.usd").write_text('#usda 1.0\ndef SkelRoot "Character"\n{\n}\n', encoding="utf-8")
    assert "StageMetadata" in python("MAREY_USD_PYTHON", "usd_check.py", tmp_path, "--faults")
