"""`marey generate --constraints` and `marey.generate`, with a shipped bundle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import marey.generate
from marey.core.errors import InvalidInput
from marey.motion.clip import load_npz
from tests.support.command import Command

BUNDLE = "hgm3-starter"
PATH = {"type": "root_path", "times": [0, 1, 2, 2.95], "positions_xz": [[0, 0], [0.1, 0.8], [0.5, 1.5], [1.0, 2.0]]}


@pytest.fixture
def marey_command(tmp_path: Path) -> Command:
    return Command({"MAREY_HOME": str(tmp_path), "MAREY_THREADS": "1"})


def write(folder: Path, *constraints: dict[str, Any]) -> Path:
    file = folder / "constraints.json"
    file.write_text(json.dumps({"constraints": constraints}))
    return file


def test_a_path_that_ends_in_the_pose_of_another_motion(marey_command: Command, tmp_path: Path) -> None:
    prompt = ("a person walks forward", "--bundle", BUNDLE, "--seed", 1, "--format", "npz", "--json")
    ran = marey_command("generate", *prompt, "--seconds", 2, "-o", tmp_path / "plain")
    assert ran.code == 0, ran.err
    source = Path(json.loads(ran.out)["files"]["npz"])
    (tmp_path / "pose.npz").write_bytes(source.read_bytes())
    pose = {"type": "pose_keyframe", "frame": 59, "motion": {"file": "pose.npz", "frame": 30}}
    ran = marey_command("generate", *prompt, "-o", tmp_path / "out", "--constraints", write(tmp_path, PATH, pose))
    assert ran.code == 0, ran.err
    line = json.loads(ran.out)
    errors = line["quality"]["constraints"]
    assert [error["missed"] for error in errors] == [False, False]
    clip, theirs = load_npz(Path(line["files"]["npz"])), load_npz(source)
    assert clip.frames == 60
    assert clip.root[-1, 1] == pytest.approx(theirs.root[30, 1], abs=0.03)
    bend = [np.linalg.norm(each.joints[at, 4] - each.joints[at, 21]) for each, at in ((clip, -1), (theirs, 30))]
    assert bend[0] == pytest.approx(bend[1], abs=0.05)


def test_bad_constraints_name_the_field(marey_command: Command, tmp_path: Path) -> None:
    fast = {**PATH, "positions_xz": [[0, 0], [0, 20], [0, 21], [0, 22]]}
    ran = marey_command("generate", "walk", "--bundle", BUNDLE, "--constraints", write(tmp_path, fast), "-o", tmp_path)
    assert ran.code == 2
    assert f"{tmp_path / 'constraints.json'}: constraints.0.positions_xz.1: 20.0 m/s" in ran.err
    (tmp_path / "text.json").write_text("hello")
    ran = marey_command("generate", "walk", "--constraints", tmp_path / "text.json", "-o", tmp_path)
    assert ran.code == 2
    assert f"{tmp_path / 'text.json'}: constraints: is not JSON" in ran.err


def test_python_takes_constraints_of_all_and_of_a_row() -> None:
    model = marey.generate.load(BUNDLE, threads=1)
    hand = {"type": "effector_target", "joint": "left_wrist", "frames": [20], "positions": [[0.3, 1.2, 0.5]]}
    rows = [{"prompt": "a person walks", "seed": 2}, {"prompt": "a person walks", "seed": 2, "constraints": [hand]}]
    path, own = model.generate(rows, seconds=3, constraints=[PATH])
    assert [error["type"] for error in path.manifest["quality"]["constraints"]] == ["root_path"]
    assert [error["type"] for error in own.manifest["quality"]["constraints"]] == ["effector_target"]
    assert path.to_npz() == model.generate([rows[0]], seconds=3, constraints=[PATH])[0].to_npz()
    with pytest.raises(InvalidInput, match="beyond the clip"):
        model.generate(rows, seconds=2, constraints=[PATH])
