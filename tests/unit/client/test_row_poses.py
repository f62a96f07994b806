"""Rows whose constraints name motion files."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import pytest

from marey.client.rows import read_rows
from marey.core.errors import InvalidInput
from tests.support.walker import walker


def row(file: Path) -> dict[str, Any]:
    pose = {"type": "pose_keyframe", "frame": 10, "motion": {"file": str(file), "frame": 3}}
    return {"prompt": "a person walks", "constraints": [pose]}


def test_a_file_is_read_into_the_row(tmp_path: Path) -> None:
    clip = walker(seconds=1)
    clip.save_npz(tmp_path / "pose.npz")
    (item,) = read_rows([row(tmp_path / "pose.npz")])
    (read,) = item.constraints or ()
    assert read["root_height"] == pytest.approx(float(clip.root[3, 1]))
    assert set(read["joint_rotations"]) == set(clip.skeleton.joint_names)


def test_a_missing_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "marey.motion.clip", None)
    reader = read_rows([row(tmp_path / "pose.npz")])
    assert [item.constraints for item in reader] == [None]
    with pytest.raises(InvalidInput) as refused:
        raise reader.error()
    assert "row 1: constraints.0.motion.file: this needs what the extra 'motion' installs" in str(refused.value)
    assert "pip install 'marey[motion]'" in str(refused.value)
