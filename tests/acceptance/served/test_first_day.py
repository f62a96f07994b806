"""The tutorial of the first day, command by command, on a server with small models."""

from __future__ import annotations

import csv
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from tests.support.marey import Marey
from tests.support.pages import ROOT, blocks

PAGE = ROOT / "docs" / "tutorials" / "first-day.md"


def test_the_tutorial_runs_as_it_stands(marey: Marey, tmp_path: Path) -> None:
    steps = [block for block in blocks([PAGE]) if block.runs]
    assert len(steps) >= 5
    (shots,) = re.findall(r"```csv\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "shots.csv").write_text(shots, encoding="utf-8")
    folder = Path(sys.executable).parent
    assert shutil.which("marey", path=folder)
    environment = marey.environ() | {"PATH": f"{folder}{os.pathsep}{os.environ['PATH']}"}
    for step in steps:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", step.script],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 0, f"{step.page}:{step.line}\n{done.stdout}\n{done.stderr}"
    assert {path.suffix for path in (tmp_path / "first").iterdir()} == {".bvh", ".npz"}
    assert len(list((tmp_path / "clips").glob("*.npz"))) == 4
    with (tmp_path / "final" / "manifest.csv").open(encoding="utf-8", newline="") as file:
        kept = [row for row in csv.DictReader(file) if row["npz"]]
    assert [(row["name"], row["review"]) for row in kept] == [("enter", "kept"), ("greet", "kept")]
    assert {"first.png", "day1.html", "enter.bvh"} <= {path.name for path in tmp_path.iterdir()}
