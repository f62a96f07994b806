"""The processes that draw."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

LEAVE = """
from marey.cli import drawing

def large(_: object) -> drawing.Pixels:
    return (1, 1), bytes(1 << 26)

if __name__ == "__main__":
    drawing._cores = lambda: 2
    drawing.draw = large
    with drawing.Drawers(100) as drawers:
        for _ in zip(range(2), drawers._in_processes(drawers._pool, iter(range(100)))):
            pass
    print("left")
"""


def test_a_command_that_leaves_while_pictures_are_sent_ends(tmp_path: Path) -> None:
    """A process terminated while it sends would leave the command waiting for the rest of its picture."""
    (tmp_path / "leave.py").write_text(LEAVE, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, tmp_path / "leave.py"], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (0, "left\n"), done.stderr
