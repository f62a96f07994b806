"""Edits of stored motions on a whole server: submitted, made by the worker of their queue, fetched, reverted."""

from __future__ import annotations

import json
from pathlib import Path

from marey.motion.clip import load_npz
from tests.support.marey import Marey


def test_a_motion_is_edited_where_it_is_stored(elsewhere: Marey, tmp_path: Path) -> None:
    job = elsewhere.submit("a person waves with the left hand", "--seconds", 2, "--tag", "shot=010")
    elsewhere("jobs", "wait", job, "--timeout", 90).ok()
    edited = elsewhere("motions", "edit", f"{job}:0", "--trim", "0.5:1.5", "--mirror", "--timeout", 60).ok()
    motion = edited.out.strip()
    (row,) = map(json.loads, elsewhere("motions", "list", "--job", "last", "--json").ok().out.splitlines())
    assert (row["id"], row["prompt"], row["tags"]) == (motion, "a person waves with the right hand", ["shot=010"])
    elsewhere("motions", "file", motion, "npz", "-o", tmp_path / "edit.npz").ok()
    clip = load_npz(tmp_path / "edit.npz")
    assert clip.seconds < 1.2
    assert [op["op"] for op in clip.manifest["edited_from"]["ops"]] == ["trim", "mirror"]
    joined = elsewhere("motions", "edit", motion, "--concat", f"{job}:0", "--split", "f5").ok()
    assert len(joined.out.split()) == 2
    assert elsewhere("motions", "revert", motion).ok().out.strip() == row["edited_from"][0]
    elsewhere("motions", "edit", motion, "--trim", "60:").refused(6, "is after the end of the motion")
