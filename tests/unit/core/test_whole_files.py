"""Files that appear under their name when all of them is written."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from marey.core.whole_files import whole_file


def interrupted(path: Path, *, alone: bool) -> None:
    with whole_file(path, alone=alone) as part:
        part.write_text("half")
        raise KeyboardInterrupt


@pytest.mark.parametrize("options", [{}, {"alone": True}, {"durable": True}, {"private": True, "durable": True}])
def test_a_file_takes_its_name_when_it_is_whole(tmp_path: Path, options: dict[str, bool]) -> None:
    path = tmp_path / "a.json"
    path.write_text("before")
    with whole_file(path, **options) as part:
        part.write_text("after")
        assert path.read_text() == "before"
        assert part.parent == tmp_path
    assert path.read_text() == "after"
    assert [*tmp_path.iterdir()] == [path]


@pytest.mark.parametrize("alone", [False, True])
def test_nothing_is_left_of_a_file_that_fails(tmp_path: Path, alone: bool) -> None:
    path = tmp_path / "a.json"
    path.write_text("before")
    with pytest.raises(KeyboardInterrupt):
        interrupted(path, alone=alone)
    assert path.read_text() == "before"
    assert [*tmp_path.iterdir()] == [path]


def test_a_private_file_is_readable_by_its_owner_alone_from_the_beginning(tmp_path: Path) -> None:
    before = os.umask(0o022)
    try:
        modes = []
        for private in (True, False):
            path = tmp_path / f"{private}.key"
            with whole_file(path, private=private) as part:
                modes.append(stat.S_IMODE(part.stat().st_mode))
                with part.open("wb") as file:
                    file.write(b"secret")
            modes.append(stat.S_IMODE(path.stat().st_mode))
    finally:
        os.umask(before)
    assert modes == [0o600, 0o600, 0o644, 0o644]


def test_two_processes_write_parts_of_their_own_unless_one_is_alone(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    with whole_file(path) as one, whole_file(path) as other:
        assert one != other
        one.write_text("1")
        other.write_text("2")
    assert path.read_text() == "1"  # the last to end
    with whole_file(path, alone=True) as one:
        one.write_text("of a process that was killed")
        with whole_file(path, alone=True) as other:
            assert one == other
            assert other.read_bytes() == b""
        one.touch()


def test_the_part_of_a_file_with_a_long_name_can_be_written(tmp_path: Path) -> None:
    path = tmp_path / ("é" * 120 + ".npz")
    with whole_file(path) as part:
        part.write_bytes(b"x")
    assert path.read_bytes() == b"x"
