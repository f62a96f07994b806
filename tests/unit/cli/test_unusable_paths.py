"""Paths that the file system refuses, and files that never end: an error of one line, no traceback, no wait."""

from __future__ import annotations

import os
import resource
from pathlib import Path

import pytest
from typer.testing import CliRunner

from marey.cli import console
from marey.cli.main import app
from marey.core.errors import InvalidFile, NotFound
from marey.motion.files import read_limited
from tests.support.walker import walker

LONG = "z" * 300


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    walker(seconds=0.5).save_npz(tmp_path / "walk.npz")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "words",
    [
        f"convert walk.npz {LONG}.bvh",
        f"render {LONG}.npz -o sheet.png",
        f"render walk.npz -o {LONG}.png",
        f"edit walk.npz --mirror -o {LONG}.npz",
        f"edit walk.npz --mirror -o {LONG}",
        f"stream walk -o {LONG}.bvh",
        "edit walk.npz --mirror -o walk.npz/mirrored.npz",
        "edit walk.npz --mirror -o walk.npz/a/b.npz",
    ],
)
def test_a_path_that_the_file_system_refuses_is_told_in_a_line(folder: Path, words: str) -> None:
    ran = CliRunner().invoke(app, words.split())
    assert ran.exit_code == 2, ran.output
    assert ran.output.startswith("marey: ")
    assert len(ran.output.splitlines()) == 1
    assert "too long" in ran.output or "directory" in ran.output or "exists" in ran.output
    assert [path.name for path in folder.iterdir()] == ["walk.npz"]


def test_a_full_disk_is_told_in_a_line_where_a_library_writes(folder: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        words = "data segment walk.npz -o cut --shortest 0.1 --longest 0.2"
        ran = CliRunner().invoke(app, words.split())
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (ran.exit_code, ran.output) == (2, "marey: a file cannot be written: File too large\n")
    assert [path.name for path in folder.iterdir()] == ["walk.npz"]


def test_a_pipe_or_a_device_is_no_motion(folder: Path) -> None:
    os.mkfifo(folder / "pipe.bvh")
    (folder / "endless.bvh").symlink_to("/dev/zero")
    for name in ("pipe.bvh", "endless.bvh"):
        ran = CliRunner().invoke(app, ["convert", name, "x.npz"])
        assert (ran.exit_code, ran.output) == (2, f"marey: {name}: is not a regular file\n")
        with pytest.raises(InvalidFile, match="regular file"):
            read_limited(folder / name, 100)
    with pytest.raises(NotFound):
        read_limited(Path("a\0b"), 100)


def test_a_file_is_named_as_it_is_where_the_working_directory_was_removed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert console.home_relative("/a/b") == "/a/b"
