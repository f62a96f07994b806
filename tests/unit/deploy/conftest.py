"""Secrets as `deploy/make-secrets` draws them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from tests.support.marey import REPOSITORY


@pytest.fixture(scope="session")
def secrets_folder(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A folder of drawn secrets."""
    folder = tmp_path_factory.mktemp("deploy") / "secrets"
    subprocess.run([REPOSITORY / "deploy" / "make-secrets", folder], check=True)
    return str(folder)


@pytest.fixture(scope="session")
def secrets(secrets_folder: str) -> dict[str, str]:
    """Content of the secret files, by name."""
    return {path.name: path.read_text() for path in Path(secrets_folder).iterdir()}
