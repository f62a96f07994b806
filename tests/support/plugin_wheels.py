"""Plug-in distributions of `tests/plugins`, installed into a folder that processes of tests find."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from tests.support.marey import REPOSITORY
from tests.support.wheels import build_wheel, install_into

PLUGINS = REPOSITORY / "tests" / "plugins"


def install_plugins(names: Iterable[str], folder: Path) -> dict[str, str]:
    """Build the wheels of plug-ins and install them, alone, into a folder; returns the environment that finds them."""
    target = folder / "installed"
    install_into(target, [build_wheel(PLUGINS / name, folder / "wheels" / name) for name in names])
    return {"PYTHONPATH": os.pathsep.join([str(target), str(REPOSITORY)])}
