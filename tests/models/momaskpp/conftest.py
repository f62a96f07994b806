"""A generator with random tiny weights."""

from __future__ import annotations

import pytest
import torch

from marey.models.momaskpp.bundle import random_bundle
from marey.models.momaskpp.generate import Generator


@pytest.fixture(scope="session")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    """A generator with random tiny weights, float32."""
    bundle = random_bundle(tmp_path_factory.mktemp("bundle") / "random-tiny")
    return Generator.load(bundle, device="cpu", dtype=torch.float32)
