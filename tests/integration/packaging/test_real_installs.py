"""Extras as pip installs them from the package index, and the distributions of bundles with the trained weights."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import pytest

from marey.bundles import Bundle
from marey.bundles.places import distributions
from marey.core import defaults
from marey.motion.io.bvh_write import write_bvh
from marey.registry import get_model
from tests.support.marey import REPOSITORY
from tests.support.models import GENERATORS
from tests.support.releases import installed_release
from tests.support.walker import walker
from tests.support.wheels import build_wheel, install_from_index, this_wheel

pytestmark = pytest.mark.slow

SECONDS = 1800.0
COMMANDS = {
    "motion": ("render", "walk.bvh", "-o", "walk.png"),
    "server": ("models", "list", "--local", "--json"),
    "worker": ("generate", "a person walks", "--seconds", "2", "-o", "made", "--json"),
}
"""A command that imports what an extra brings."""


@pytest.fixture(scope="module")
def bundles(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Both wheels of bundles, with the trained weights."""
    folder = tmp_path_factory.mktemp("bundles")
    return [build_wheel(REPOSITORY / "models" / "packages" / name, folder / name) for name in ("open", "starter")]


def test_wheels_of_bundles_hold_the_trained_weights(bundles: list[Path], tmp_path: Path) -> None:
    for wheel in bundles:
        zipfile.ZipFile(wheel).extractall(tmp_path)
    found = {path.parent.name: path.parent for path in tmp_path.glob("marey_bundles_*/*/manifest.json")}
    assert set(found) == set(distributions())
    for name, path in found.items():
        assert Bundle.open(path).reference == Bundle.open(REPOSITORY / "models" / name).reference


@pytest.mark.parametrize("extra", COMMANDS)
def test_an_extra_brings_what_its_commands_import(
    extra: str, bundles: list[Path], tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    requirements = [f"{this_wheel(tmp_path_factory)}[{extra}]", *map(str, bundles)]
    made = install_from_index(tmp_path / "environment", requirements, seconds=SECONDS)
    marey = installed_release(made, {"MAREY_HOME": str(tmp_path / "home")}, tmp_path)
    write_bvh(tmp_path / "walk.bvh", walker())
    printed = marey.run(*COMMANDS[extra])
    if extra == "motion":
        assert (tmp_path / "walk.png").read_bytes().startswith(b"\x89PNG")
    if extra == "server":
        assert [json.loads(line)["name"] for line in printed.splitlines()] == list(GENERATORS)
    if extra == "worker":
        assert (
            json.loads(printed)["bundle"]
            == Bundle.open(REPOSITORY / "models" / next(iter(get_model(defaults.MODEL).bundles))).reference
        )
