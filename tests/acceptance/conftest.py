"""One `marey serve` for all acceptance tests that do not break it; it ends with the last of them."""

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


@pytest.fixture(scope="package")
def served(models: Path) -> Iterator[tuple[Marey, Serving]]:
    """The command line with a server, and the server."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    marey = Marey(home, models)
    with serving(marey) as server:
        yield marey, server
        server.stop()
        assert not (home / "server.json").exists()
    shutil.rmtree(home, ignore_errors=True)


@pytest.fixture(scope="module")
def judged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Marey]:
    """A server with a small trained evaluator beside its models."""
    from marey.evaluator.assembly import assemble
    from marey.evaluator.config import TINY as SMALL
    from marey.evaluator.train import train_stage
    from marey.training.budget import Budget
    from marey.training.staging import TrainOptions
    from tests.support.prepared import write_prepared

    folder = tmp_path_factory.mktemp("judged")
    models = tiny_models(folder / "models")
    data, run = write_prepared(folder / "data", 240, ("walks", "runs", "waves", "bows")), folder / "run"
    train_stage("tmr", TrainOptions(data, run, SMALL, Budget(steps=2), device="cpu", bf16=False, quiet=True))
    assemble(data, run, models / "judge", SMALL)
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    marey = Marey(home, models)
    with serving(marey):
        yield marey
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
