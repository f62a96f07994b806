"""Extras as pip installs them from the package index, and the distributions of bundles with the trained weights."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from marey.bundles import Bundle
from marey.bundles.places import DISTRIBUTIONS
from tests.support.marey import REPOSITORY
from tests.support.releases import Release, installed_release
from tests.support.wheels import build_wheel, make_environment, this_wheel

pytestmark = pytest.mark.slow

SECONDS = 1800.0
COMMANDS = {
    "motion": ("render", "--help"),
    "server": ("models", "list", "--local", "--json"),
    "worker": ("generate", "a person walks", "--seconds", "2", "-o", "made", "--json"),
}
"""A command that imports what an extra brings."""


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Both wheels of bundles, with the trained weights."""
    folder = tmp_path_factory.mktemp("bundles")
    return [build_wheel(REPOSITORY / "models" / "packages" / name, folder / name) for name in ("open", "starter")]


def install(folder: Path, *requirements: str) -> Release:
    """Install requirements in an environment of their own, with what they require."""
    made = make_environment(folder / "environment", [], borrow=False)
    command = [sys.executable, "-m", "pip", "--python", made.python, "install", "-q", *requirements]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS, check=False)
    assert done.returncode == 0, done.stderr
    return installed_release(made, {"MAREY_HOME": str(folder / "home")}, folder)


def test_wheels_of_bundles_hold_the_trained_weights(bundles: list[Path], tmp_path: Path) -> None:
    made = make_environment(tmp_path / "environment", bundles, borrow=False)
    found = {path.parent.name: path.parent for path in made.packages.glob("marey_bundles_*/*/manifest.json")}
    assert set(found) == set(DISTRIBUTIONS)
    for name, path in found.items():
        assert Bundle.open(path).reference == Bundle.open(REPOSITORY / "models" / name).reference


@pytest.mark.parametrize("extra", COMMANDS)
def test_an_extra_brings_what_its_commands_import(
    extra: str, bundles: list[Path], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    marey = install(tmp_path, f"{this_wheel(tmp_path_factory)}[{extra}]", *map(str, bundles))
    printed = marey.run(*COMMANDS[extra])
    if extra == "server":
        assert [json.loads(line)["name"] for line in printed.splitlines()] == ["hgm3-starter", "mogo-starter"]
    if extra == "worker":
        assert json.loads(printed)["bundle"] == Bundle.open(REPOSITORY / "models" / "hgm3-starter").reference
