"""The mechanism of every registry: entry points are found, loaded and refused in one way."""

from __future__ import annotations

from itertools import count
from pathlib import Path
from typing import Any

import pytest

from marey.core.errors import PluginError
from marey.exporters.registry import EXPORTERS
from marey.registry import PlugIns
from marey.registry.models import MODELS
from marey.registry.training import TRAININGS
from tests.support.plugins import installed, write_distribution

NUMBERS = count()
REGISTRIES = pytest.mark.parametrize("registry", [MODELS, TRAININGS, EXPORTERS], ids=lambda each: each.group)


def plugin(folder: Path, registry: PlugIns[Any], source: str, name: str = "toy") -> str:
    """Write a plug-in of one module that binds `FOUND`; the name of its package."""
    module = f"toy_{next(NUMBERS)}"  # a module of one name is imported once a process
    entries = f"[{registry.group}]\n{name} = {module}:FOUND\n"
    write_distribution(folder, module, {module: source}, entries)
    return module


@REGISTRIES
@pytest.mark.parametrize(
    ("source", "message"),
    [
        ("import nowhere_at_all", "cannot be loaded: ModuleNotFoundError: No module named 'nowhere_at_all'"),
        ("FOUND = 1 / 0", "cannot be loaded: ZeroDivisionError"),
        ("FOUND = 'toy'", "is not the .* of the name 'toy'"),
    ],
)
def test_a_plugin_that_is_wrong_is_refused_with_its_package(
    registry: PlugIns[Any], tmp_path: Path, source: str, message: str
) -> None:
    package = plugin(tmp_path, registry, source)
    others = registry.names()
    with installed(tmp_path):
        assert registry.names() == tuple(sorted([*others, "toy"]))
        with pytest.raises(PluginError, match=message) as raised:
            registry.find("toy")
        assert raised.value.where == f"{registry.group}: toy = {package}:FOUND ({package})"
        assert registry.owner("toy") == package
        assert all(registry.find(name) is not None for name in others)
        with pytest.raises(PluginError, match=message):
            registry.all()


@REGISTRIES
def test_two_packages_cannot_register_one_name(registry: PlugIns[Any], tmp_path: Path) -> None:
    first, second = (plugin(tmp_path, registry, "FOUND = 1") for _ in range(2))
    with installed(tmp_path), pytest.raises(PluginError, match="two packages register 'toy'") as raised:
        registry.names()
    assert first in raised.value.message
    assert second in raised.value.message


@REGISTRIES
def test_what_is_not_installed_is_not_found(registry: PlugIns[Any]) -> None:
    assert registry.find("nowhere") is None
    assert registry.names()
