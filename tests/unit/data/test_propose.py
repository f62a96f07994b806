"""Proposed `dataset.toml`: joints, axes and unit of a folder of BVH files."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.cli.commands import data as command
from marey.core.errors import Conflict, InvalidFile, NotFound
from marey.data.dataset import read_dataset
from marey.data.propose import propose
from marey.data.retarget import read_source, retarget
from marey.motion.io.bvh import format_bvh, read_bvh
from marey.motion.skeleton import HUMANML3D
from marey.motion.units import METRES, Unit, Up
from tests.support.walker import walker

PARTS = ("hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist")
MIXAMO = dict(zip(PARTS, ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand"), strict=True))
UNREAL = dict(zip(PARTS, ("thigh", "calf", "foot", "ball", "clavicle", "upperarm", "lowerarm", "hand"), strict=True))
ASF = dict(zip(PARTS, ("femur", "tibia", "foot", "toes", "clavicle", "humerus", "radius", "hand"), strict=True))
TRUNK = {"pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck", "head": "Head"}


def mixamo(side: str, part: str) -> str:
    return f"mixamorig:{'Left' if side == 'L' else 'Right'}{MIXAMO[part]}"


def unreal(side: str, part: str) -> str:
    return f"{UNREAL[part]}_{side.lower()}"


def asf(side: str, part: str) -> str:
    return f"{side.lower()}{ASF[part]}"


def renamed(style: Any) -> dict[str, str]:
    """Return the name of each joint of the walker in a naming style."""
    sides = {f"{side}_{part}": style(side, part) for side in "LR" for part in PARTS}
    return {name: sides.get(name, TRUNK.get(name, name)) for name in HUMANML3D.joint_names}


def write(folder: Path, names: dict[str, str], *, unit: Unit = "cm", up: Up = "y", file: str = "walk.bvh") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text = format_bvh(walker(), unit=unit, up=up)
    text = re.sub(r"(ROOT|JOINT) (\S+)", lambda match: f"{match[1]} {names[match[2]]}", text)
    (folder / file).write_text(text)


@pytest.mark.parametrize("style", [mixamo, unreal, asf], ids=["mixamo", "unreal", "asf"])
def test_the_joints_of_known_naming_styles_are_found(tmp_path: Path, style: Any) -> None:
    names = renamed(style)
    write(tmp_path / "Take 1", names)
    found = propose(tmp_path)
    (rig,) = tomllib.loads(found.toml())["rig"]
    assert [rig[part] for part in ("pelvis", "spine", "middle", "chest", "neck", "head")] == [*TRUNK.values()]
    for side, key in (("L", "left"), ("R", "right")):
        assert rig[f"{key}_leg"] == [names[f"{side}_{part}"] for part in PARTS[:4]]
        assert rig[f"{key}_arm"] == [names[f"{side}_{part}"] for part in PARTS[4:]]
    assert "trunk" not in rig
    assert "rest_up" not in rig
    assert found.problems == ()


@pytest.mark.parametrize("unit", list(METRES))
@pytest.mark.parametrize("up", ["y", "z"])
def test_unit_and_up_axis_are_those_of_the_files(tmp_path: Path, unit: Unit, up: Up) -> None:
    write(tmp_path, renamed(mixamo), unit=unit, up=up)
    found = propose(tmp_path)
    assert (found.unit, found.up) == (unit, up)


def test_the_proposal_retargets_the_files_once_its_terms_are_filled_in(tmp_path: Path) -> None:
    folder = tmp_path / "Our Captures (2026)"
    write(folder, renamed(unreal))
    command.inspect(folder, write=True)
    text = (folder / "dataset.toml").read_text()
    for name, value in (("title", "Ours"), ("licence", "proprietary"), ("credit", "us"), ("tier", "commercial")):
        text = text.replace(f'{name} = ""', f'{name} = "{value}"')
    (folder / "dataset.toml").write_text(text)
    dataset = read_dataset(folder / "dataset.toml")
    assert dataset.name == "our-captures-2026"
    clip = read_bvh(folder / "walk.bvh")
    rig = dataset.rig_of(clip.skeleton.joint_names, "walk.bvh")
    joints = retarget(read_source(clip, rig, where="walk.bvh"), rig)
    expected = walker().joints
    np.testing.assert_allclose(np.ptp(joints[:, 0], axis=0), np.ptp(expected[:, 0], axis=0), atol=0.05)
    assert joints[..., 1].max() == pytest.approx(expected[..., 1].max(), abs=0.1)
    assert (folder / "index.csv").read_text() == "file,action,captions,source\nwalk.bvh,,,walk\n"


def test_what_is_there_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, renamed(mixamo))
    (tmp_path / "index.csv").write_text("Take,Label,File\nwalk,walking,walk.fbx.zip\n")
    command.inspect(tmp_path, as_json=True)
    shown = tomllib.loads(json.loads(capsys.readouterr().out)["dataset"])
    assert shown["columns"] == {"file": "{Take}", "action": "{Label}", "source": "{Take}"}
    command.inspect(tmp_path, write=True)
    assert (tmp_path / "index.csv").read_text().startswith("Take,")
    with pytest.raises(Conflict, match="already exists"):
        command.inspect(tmp_path, write=True)


def test_a_skeleton_that_does_not_rest_upright_gets_its_feet_from_the_motion(tmp_path: Path) -> None:
    names = renamed(mixamo)
    write(tmp_path, names)
    text = (tmp_path / "walk.bvh").read_text()
    shin = re.search(rf"JOINT {re.escape(names['L_knee'])}\s*\{{\s*OFFSET ([-\d. ]+)", text)
    assert shin is not None
    length = abs(float(shin[1].split()[1]))
    (tmp_path / "walk.bvh").write_text(text.replace(shin[1], f"0.0 {-0.7 * length} {0.7 * length}", 1))
    (rig,) = tomllib.loads(propose(tmp_path).toml())["rig"]
    assert rig["trunk"] == "positions"
    for foot in (rig["left_foot"], rig["right_foot"]):
        assert foot[0] > 0.9, "to the body's left"
    assert 0 < rig["sole_pitch"] < 60


def test_skeletons_without_a_rig_are_told_beside_the_others(tmp_path: Path) -> None:
    names = renamed(mixamo)
    write(tmp_path, names)
    nameless = {name: f"bone{number}" for number, name in enumerate(names)}
    write(tmp_path, nameless, file="nameless.bvh")
    (tmp_path / "broken.bvh").write_text("HIERARCHY\nnothing")
    found = propose(tmp_path)
    assert len(found.rigs) == 1
    assert any("no left ankle is recognised" in problem for problem in found.problems)
    assert any(problem.startswith("broken.bvh: ") for problem in found.problems)
    assert len(tomllib.loads(found.toml())["rig"]) == 1
    (tmp_path / "walk.bvh").unlink()
    with pytest.raises(InvalidFile, match="no rig is recognised"):
        propose(tmp_path)
    with pytest.raises(NotFound, match="no BVH files"):
        propose(tmp_path / "empty")
