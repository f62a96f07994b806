"""One `marey serve` for all tests of this folder, none of which breaks it; it ends with the last of them.

The tests run in one process, also where others run beside it: see `pytest_xdist_make_scheduler`.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from tests.support.marey import Marey, Serving, serving, tiny_models


@pytest.fixture(scope="package")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models with random weights, and a small trained evaluator."""
    from marey.evaluator.assembly import assemble
    from marey.evaluator.config import TINY as SMALL
    from marey.evaluator.train import train_stage
    from marey.training.budget import Budget
    from marey.training.staging import TrainOptions
    from tests.support.prepared import write_prepared

    folder = tmp_path_factory.mktemp("served")
    models = tiny_models(folder / "models")
    data, run = write_prepared(folder / "data", 240, ("walks", "runs", "waves", "bows")), folder / "run"
    train_stage("tmr", TrainOptions(data, run, SMALL, Budget(steps=2), device="cpu", bf16=False, quiet=True))
    assemble(data, run, models / "judge", SMALL)
    return models


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


@pytest.fixture
def marey(served: tuple[Marey, Serving]) -> Marey:
    """The command line, with a server that runs."""
    return served[0]


@pytest.fixture
def elsewhere(marey: Marey, tmp_path: Path) -> Marey:
    """The command line of another machine: it knows the server by URL and key alone."""
    from marey.client.server_address import read_server

    server = read_server(marey.home)
    assert server is not None
    environment = {"MAREY_SERVER": server.url, "MAREY_KEY": server.key}
    return replace(marey, home=tmp_path / "elsewhere", environment=environment)
