"""Runs of checks on the device of `tests.support.card`, which changes the whole process: each in one of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def run_check(module: str, check: str, folder: Path) -> None:
    """Run one of the checks of a module."""
    command = [sys.executable, "-m", module, check, str(folder)]
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
