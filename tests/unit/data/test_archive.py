from __future__ import annotations

import io
import tarfile
from collections import Counter
from pathlib import Path

import pytest

from marey.core.errors import InvalidFile, NotFound, TooLarge
from marey.data import archive
from marey.data.archive import bvh_files


def tar(path: Path, members: dict[str, bytes], *, links: dict[str, str] | None = None) -> Path:
    with tarfile.open(path, "w:xz") as out:
        for name, data in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(data)
            out.addfile(info, io.BytesIO(data))
        for name, target in (links or {}).items():
            info = tarfile.TarInfo(name)
            info.type, info.linkname = tarfile.SYMTYPE, target
            out.addfile(info)
    return path


def test_yields_the_stem_and_bytes_of_each_bvh_and_nothing_else(tmp_path):
    path = tar(tmp_path / "a.tar.xz", {"x/walk.bvh": b"HIERARCHY", "x/README.md": b"no", "x/RUN.BVH": b"two"})
    assert dict(bvh_files(path)) == {"walk": b"HIERARCHY", "RUN": b"two"}


def test_a_path_that_climbs_out_of_the_archive_is_only_a_name_and_writes_nothing(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    path = tar(inside / "a.tar.xz", {"../../evil.bvh": b"x", "/etc/absolute.bvh": b"y"})
    assert dict(bvh_files(path)) == {"evil": b"x", "absolute": b"y"}
    assert [p.name for p in tmp_path.rglob("*")] == ["inside", "a.tar.xz"]


def test_links_are_passed_over(tmp_path):
    path = tar(tmp_path / "a.tar.xz", {"a.bvh": b"x"}, links={"b.bvh": "/etc/passwd"})
    assert [name for name, _ in bvh_files(path)] == ["a"]


def test_members_without_motion_are_counted_by_kind(tmp_path):
    others = {"deep/a.TXT": b"1", "deep/b.txt": b"2", "README": b"3", "a.c3d": b"4"}
    path = tar(tmp_path / "a.tar.xz", {"deep/a.bvh": b"x", **others}, links={"b.bvh": "/etc/passwd"})
    passed_over = Counter({".txt": 1})
    assert [name for name, _ in bvh_files(path, passed_over)] == ["a"]
    assert passed_over == {".txt": 3, "without an ending": 1, ".c3d": 1, "links and devices": 1}


def test_a_folder_is_read_as_an_archive_is(tmp_path):
    (tmp_path / "deep").mkdir()
    (tmp_path / "deep" / "a.bvh").write_bytes(b"x")
    (tmp_path / "link.bvh").symlink_to("/etc/passwd")
    assert dict(bvh_files(tmp_path)) == {"a": b"x"}


def test_two_members_of_one_name_are_refused(tmp_path):
    path = tar(tmp_path / "a.tar.xz", {"one/a.bvh": b"x", "two/a.bvh": b"y"})
    with pytest.raises(InvalidFile, match=r"two files are called a\.bvh"):
        list(bvh_files(path))


def test_a_truncated_archive_is_refused(tmp_path):
    path = tar(tmp_path / "a.tar.xz", {f"{k}.bvh": bytes(range(256)) * 40 for k in range(20)})
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InvalidFile, match="not a readable archive"):
        list(bvh_files(path))


def test_what_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "a.tar.xz"
    path.write_bytes(b"PK\x03\x04 something else")
    with pytest.raises(InvalidFile, match="not a readable archive"):
        list(bvh_files(path))


def test_an_archive_without_bvh_is_refused(tmp_path):
    with pytest.raises(InvalidFile, match="holds no BVH file"):
        list(bvh_files(tar(tmp_path / "a.tar.xz", {"a.txt": b"x"})))


def test_a_missing_path_is_not_found(tmp_path):
    with pytest.raises(NotFound):
        list(bvh_files(tmp_path / "none"))


@pytest.mark.parametrize(
    ("name", "value"),
    [("MAX_FILE_BYTES", 10), ("MAX_TOTAL_BYTES", 30), ("MAX_FILES", 2)],
    ids=["file", "total", "files"],
)
def test_a_bomb_stops_at_each_bound(tmp_path, monkeypatch, name, value):
    monkeypatch.setattr(archive, name, value)
    path = tar(tmp_path / "a.tar.xz", {f"{k}.bvh": b"x" * 11 for k in range(4)})
    with pytest.raises(TooLarge):
        list(bvh_files(path))
