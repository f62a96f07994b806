"""A prepared folder of swinging stick figures, and a generator of random tiny weights."""

from __future__ import annotations

import pytest
import torch

from marey.data.prepared import PreparedData
from marey.models.momaskpp.bundle import random_bundle
from marey.models.momaskpp.generate import Generator
from tests.support.prepared import write_prepared


@pytest.fixture(autouse=True, scope="session")
def _one_thread() -> None:
    torch.set_num_threads(1)


@pytest.fixture(scope="session")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    """The prepared folder, open."""
    return PreparedData.open(write_prepared(tmp_path_factory.mktemp("data") / "prepared"))


@pytest.fixture(scope="session")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    """A generator with random tiny weights."""
    return Generator.load(random_bundle(tmp_path_factory.mktemp("bundle") / "random-tiny"), device="cpu")
