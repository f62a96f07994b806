"""Timelines of prompts, through the real command line, server, queue and worker."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marey.motion.clip import load_npz
from tests.support.marey import Marey
from tests.support.models import NOT_KEEPING

TEXT = "0-2 a person walks forward; 2-4.5 a person waves; 6-17 a person runs"


def test_the_queue_makes_what_a_one_shot_makes(marey: Marey, offline: Marey, tmp_path: Path) -> None:
    queued = marey("submit", "--timeline", TEXT, "--seed", 7, "--fetch", tmp_path / "queued", "--json").ok().lines
    alone = offline("generate", "--timeline", TEXT, "--seed", 7, "-o", tmp_path / "alone", "--json").ok().lines
    assert (queued[0]["prompt"], queued[0]["frames"]) == (TEXT, 340)
    assert (queued[0]["quality"], queued[0]["scope"]) == (alone[0]["quality"], alone[0]["scope"])
    ours, theirs = (load_npz(line["files"]["npz"]) for line in (queued[0], alone[0]))
    np.testing.assert_array_equal(ours.features, theirs.features)
    assert ours.manifest["timeline"] == theirs.manifest["timeline"]
    assert ours.manifest["timeline"]["gaps"] == [{"start": 4.5, "end": 6.0}]


def test_a_sheet_of_a_timeline_is_drawn(offline: Marey, tmp_path: Path) -> None:
    made = offline("generate", "--timeline", TEXT, "--seed", 7, "-o", tmp_path, "--json").ok().lines
    for name in ("sheet.png", "player.html"):
        offline("render", made[0]["files"]["npz"], "-o", tmp_path / name).ok()
        assert (tmp_path / name).stat().st_size > 1000


def test_rows_that_overlap_are_refused(offline: Marey, tmp_path: Path) -> None:
    ran = offline("generate", "--timeline", "0-3 a person walks; 2-5 a person waves", "-o", tmp_path)
    ran.refused(2, "argument 1: timeline: row 1 (0-3) overlaps row 2 (2-5)")


def test_a_model_that_cannot_refuses_before_it_is_loaded(offline: Marey, tmp_path: Path) -> None:
    ran = offline("generate", "--timeline", TEXT, "--model", NOT_KEEPING, "-o", tmp_path)
    ran.refused(2, f"timeline: the model {NOT_KEEPING!r} cannot generate timelines")
    assert list(tmp_path.iterdir()) == []
