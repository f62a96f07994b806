"""One `marey serve` for all acceptance tests that do not break it."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.marey import Marey, Serving, serving, tiny_models


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models with random weights."""
    return tiny_models(tmp_path_factory.mktemp("models"))


@pytest.fixture(scope="session")
def served(models: Path) -> Iterator[tuple[Marey, Serving]]:
    """The command line with a server, and the server."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    marey = Marey(home, models)
    with serving(marey) as server:
        yield marey, server
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture
def marey(served: tuple[Marey, Serving]) -> Marey:
    """The command line, with a server that runs."""
    return served[0]


@pytest.fixture
def offline(models: Path, tmp_path: Path) -> Marey:
    """The command line without a server."""
    return Marey(tmp_path / "home", models)


@pytest.fixture
def elsewhere(marey: Marey, tmp_path: Path) -> Marey:
    """The command line of another machine: it knows the server by URL and key alone."""
    from marey.client.place import read_server

    server = read_server(marey.home)
    assert server is not None
    environment = {"MAREY_SERVER": server.url, "MAREY_KEY": server.key}
    return replace(marey, home=tmp_path / "elsewhere", environment=environment)
