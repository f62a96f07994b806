"""Plug-in distributions of `tests/plugins`, installed into a folder that processes of tests find."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from tests.support.marey import REPOSITORY
from tests.support.wheels import build_wheel

PLUGINS = REPOSITORY / "tests" / "plugins"


def install_plugin(name: str, folder: Path) -> dict[str, str]:
    """Build a plug-in's wheel and install it, alone, into a folder; returns the environment that makes it found."""
    target = folder / "installed"
    wheel = build_wheel(PLUGINS / name, folder / "wheels")
    command = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index", "--target", str(target), wheel]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return {"PYTHONPATH": os.pathsep.join([str(target), str(REPOSITORY)])}
