"""The command line and its models, for acceptance tests."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.marey import Marey, tiny_models


@pytest.fixture(scope="session")
def models(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Models with random weights."""
    return tiny_models(tmp_path_factory.mktemp("models"))


@pytest.fixture
def offline(models: Path, tmp_path: Path) -> Marey:
    """The command line without a server."""
    return Marey(tmp_path / "home", models)
