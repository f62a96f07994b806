"""docs/reference/formats.md says how files are read: its examples run as they stand."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from marey.motion.clip import KEYS
from tests.support.walker import walker

PAGE = Path(__file__).resolve().parents[3] / "docs" / "reference" / "formats.md"


def examples() -> list[str]:
    return re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)


@pytest.mark.parametrize("marker", ["def multiply", "contact_sheet"])
def test_an_example_runs_as_it_stands(marker, tmp_path):
    (code,) = [example for example in examples() if marker in example]
    walker(turn=0.5, prompt="a test walk").save_npz(tmp_path / "walk.npz")
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    if marker == "def multiply":
        assert done.stdout == "a test walk (41, 22, 3) 20.0\n"
    else:
        assert {path.name for path in tmp_path.iterdir()} == {"walk.npz", "walk.png", "walk.html"}


def test_the_page_lists_the_keys_and_types_of_the_npz(tmp_path):
    page = PAGE.read_text(encoding="utf-8").split("\n## ")
    (section,) = [part for part in page if part.startswith("npz\n")]
    rows = dict(re.findall(r"^\| `(\w+)` \| (\w+) ", section, re.MULTILINE))
    assert tuple(rows) == KEYS
    walker().save_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz", allow_pickle=False) as file:
        kinds = {key: "str" if file[key].dtype.kind == "U" else file[key].dtype.name for key in file.files}
    assert kinds == rows
