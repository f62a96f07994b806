"""Programs of others that open Marey's files, for tests/clients. None is a dependency; `make clients` installs them.

| variable | names |
|---|---|
| `MAREY_BPY_PYTHON` | a Python with `bpy`; without it, Blender on the path |
| `MAREY_UFBX_PYTHON` | a Python with `pufbx` |
| `MAREY_USD_PYTHON` | a Python with `usd-core` |
| `MAREY_THREE` | a folder with the npm packages `three`, `gltf-validator` and `@pixiv/three-vrm-animation` |

Tests whose program is missing are skipped; `tests/clients/conftest.py` fails them under `MAREY_REQUIRE_CLIENTS=1`.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

SCRIPTS = Path(__file__).resolve().parents[1] / "clients"


def blender_command(script: Path) -> list[str]:
    """The command that runs a script in Blender; its arguments follow. Skips the test where there is none."""
    if python := os.environ.get("MAREY_BPY_PYTHON"):
        return [python, str(script)]
    if importlib.util.find_spec("bpy"):
        return [sys.executable, str(script)]
    if program := shutil.which("blender"):
        return [program, "--background", "--factory-startup", "--python-exit-code", "1", "--python", str(script), "--"]
    return pytest.skip("there is no Blender here (name a Python that has `bpy` in MAREY_BPY_PYTHON)")


def blender(script: str, *arguments: object) -> None:
    """Run a script of tests/clients in Blender."""
    _run([*blender_command(SCRIPTS / script), *map(str, arguments)], 600)


def python(variable: str, script: str, *arguments: object) -> str:
    """Run a script of tests/clients in the Python that a variable names; return what it prints."""
    program = os.environ.get(variable)
    if not program:
        pytest.skip(f"{variable} names no Python")
    return _run([program, str(SCRIPTS / script), *map(str, arguments)], 600)


def node(script: str, package: str, *arguments: object) -> Any:
    """Run a script of tests/clients in Node with an npm package; return the JSON that it prints."""
    program, folder = shutil.which("node"), os.environ.get("MAREY_THREE")
    if program is None:
        pytest.skip("there is no Node here")
    if not folder or not (Path(folder) / "node_modules" / package).is_dir():
        pytest.skip(f"there is no {package} here (npm install {package}, and name that folder in MAREY_THREE)")
    return json.loads(_run([program, str(SCRIPTS / script), folder, *map(str, arguments)], 120, quiet=True))


def _run(command: list[str], seconds: float, *, quiet: bool = False) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds, check=False)
    assert done.returncode == 0, done.stderr
    assert not (quiet and done.stderr), done.stderr
    return done.stdout
