"""Committed files keep the rules of the repository."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MEBIBYTE = 2**20
MACHINE_PATH = re.compile(rb"(^|[^A-Za-z0-9_.])/(home|work|root|var/tmp|opt)/(?!marey\b)[A-Za-z]", re.MULTILINE)
BINARY = {".png", ".safetensors", ".npz", ".npy", ".gz", ".xz", ".glb", ".ico"}


@pytest.fixture(scope="module")
def tracked() -> list[Path]:
    listing = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=False)
    if listing.returncode:
        pytest.skip("not a git checkout")
    return [ROOT / name for name in listing.stdout.decode().split("\0") if name and (ROOT / name).is_file()]


def test_no_tracked_file_is_larger_than_a_shard(tracked: list[Path]) -> None:
    assert [str(path) for path in tracked if path.stat().st_size > 15 * MEBIBYTE] == []


def test_all_bundles_together_stay_under_their_bound(tracked: list[Path]) -> None:
    models = [path for path in tracked if path.is_relative_to(ROOT / "models")]
    assert sum(path.stat().st_size for path in models) < 72e6


def test_no_capture_data_is_tracked(tracked: list[Path]) -> None:
    assert [str(path) for path in tracked if path.suffix in {".npy", ".xz"}] == []


def test_no_tracked_text_names_a_folder_of_one_machine(tracked: list[Path]) -> None:
    texts = [path for path in tracked if path.suffix not in BINARY and path != Path(__file__)]
    # Containers have folders of their own; systemd units are installed in /opt/marey.
    texts = [path for path in texts if "docker" not in path.as_posix().lower()]
    assert [str(path) for path in texts if MACHINE_PATH.search(path.read_bytes())] == []
