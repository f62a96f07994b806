"""`marey data`: from what was captured to a folder that training reads."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from marey.data.dataset import known_set
from marey.data.pack import JointsPack, PackClip
from tests.support.bodies import bower
from tests.support.marey import Marey


@pytest.fixture
def alone(tmp_path: Path) -> Marey:
    """The command line; these commands need no server."""
    return Marey(tmp_path / "home", tmp_path / "models")


def test_a_pack_is_prepared_and_inspected_where_the_archive_is_not(alone: Marey, tmp_path: Path) -> None:
    clip = PackClip("curtsy", "cmu", "bow", "", "train", 0, 0)  # no gesture is made on a bow, and dozens on a walk
    JointsPack.of([(clip, bower(3.0).astype(np.float32))], [known_set("cmu").terms]).save(tmp_path / "a.pack.npz")
    alone("data", "prepare", "pack", tmp_path / "a.pack.npz", "-o", tmp_path / "prepared").ok()
    assert "curtsy" in alone("data", "inspect", tmp_path / "prepared", "--clip", "curtsy").ok().out
    alone("data", "inspect", tmp_path / "prepared", "--write").refused(2, "--write", "this folder is prepared")
    (tmp_path / "take.bvh").touch()
    alone("data", "inspect", tmp_path, "--clip", "curtsy").refused(2, "--clip", "this folder is not prepared")


def test_unknown_sources_missing_archives_and_foreign_packs_are_told(alone: Marey, tmp_path: Path) -> None:
    output = tmp_path / "out"
    alone("data", "prepare", "amass", tmp_path, "-o", output).refused(2, "'amass'", "bandai-namco")
    alone("data", "prepare", "pack", "-o", output).refused(2, "SOURCE without its PATH")
    alone("data", "prepare", "pack", tmp_path / "none.npz", "-o", output).refused(3, "none.npz")
    (tmp_path / "text.npz").write_text("not a pack")
    alone("data", "prepare", "pack", tmp_path / "text.npz", "-o", output).refused(2, "text.npz")
    assert not output.exists()
