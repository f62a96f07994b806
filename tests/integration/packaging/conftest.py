"""Fixtures of the tests that install wheels."""

from __future__ import annotations

import subprocess

import pytest

from tests.support.marey import REPOSITORY


@pytest.fixture(scope="session")
def checkout() -> list[str]:
    """Files that git tracks, or would."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=REPOSITORY, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"there is no history here: {done.stderr.strip()}")
    return sorted({name for name in done.stdout.splitlines() if (REPOSITORY / name).is_file()})
