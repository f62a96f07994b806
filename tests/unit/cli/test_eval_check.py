"""`marey eval check`: the quality of motion files, and the actions that they show."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from marey.cli.commands.evaluations import app
from marey.cli.roles.checking import check_file
from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.pose import solve_pose
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import FPS, walker


def write(path: Path, lift: float = 0.0) -> Path:
    joints = walker(5.0)
    joints[30:70, :, 1] += lift
    pose = solve_pose(joints, HUMANML3D, fps=FPS)
    contacts = np.zeros((len(joints), 4), bool)
    MotionClip.of(pose.skeleton, pose.rotations, pose.root, contacts, FPS).save_npz(path)
    return path


def test_a_walk_passes_and_a_floating_one_exits_with_6(tmp_path: Path) -> None:
    good, bad = write(tmp_path / "good.npz"), write(tmp_path / "bad.npz", lift=0.3)
    passed = CliRunner().invoke(app, ["check", str(good), "--expect", "walk", "--json"])
    assert passed.exit_code == 0
    record = json.loads(passed.stdout)
    assert (record["quality"]["ok"], record["shows"]) == (True, True)
    assert record["quality"]["match"]["value"] >= 0.5
    failed = CliRunner().invoke(app, ["check", str(good), str(bad)])
    assert failed.exit_code == 6
    assert "bad.npz: floating" in failed.stdout
    assert "match" not in failed.stdout
    assert CliRunner().invoke(app, ["check", str(good), "--expect", "walk; then lie"]).exit_code == 6


def test_an_unknown_action_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="unknown action 'fly'"):
        check_file(write(tmp_path / "walk.npz"), "walk; then fly")
