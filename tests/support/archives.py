"""The real capture archives, where there are any: MAREY_DATA, or ../shared/data beside the repository."""

from __future__ import annotations

import os
import tarfile
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


def archive(name: str) -> Path:
    """Path of an archive; skips the test, with the reason, where it is not there."""
    folder = Path(os.environ.get("MAREY_DATA", REPOSITORY.parent / "shared" / "data"))
    if not (folder / name).is_file():
        pytest.skip(f"no {name} in {folder} (name the folder of the capture archives in MAREY_DATA)")
    return folder / name


def first_files(name: str, count: int) -> dict[str, bytes]:
    """The first BVH files of an archive by their names; reads no further than that."""
    found: dict[str, bytes] = {}
    with tarfile.open(archive(name), "r|*") as tar:
        for member in tar:
            if member.name.endswith(".bvh") and (file := tar.extractfile(member)):
                found[Path(member.name).stem] = file.read()
                if len(found) == count:
                    break
    return found
