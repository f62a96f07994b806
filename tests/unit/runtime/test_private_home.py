"""A home is its user's alone, also where it was open before."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest

from marey.core.errors import InvalidInput
from marey.core.private_home import is_open, make_private, open_private
from marey.runtime.status import WorkerStatus, status_file, write_status


def modes(home: Path) -> dict[str, str]:
    return {str(path.relative_to(home)): oct(stat.S_IMODE(path.lstat().st_mode)) for path in home.rglob("*")}


@pytest.fixture
def opened(tmp_path: Path) -> Path:
    """A home as an earlier release left it, in a folder that another program made."""
    home = tmp_path / "home"
    for name in ("logs", "run", "assets/ab", "postgres"):
        (home / name).mkdir(parents=True)
    for name in ("logs/api.log", "server.json", "webhook.key", "lock", "assets/ab/x.npz", "run/worker-1.json"):
        (home / name).write_text("x")
    for path in (home, *home.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    return home


def test_a_home_that_is_there_is_closed_with_all_that_is_in_it(opened: Path) -> None:
    warnings = make_private(opened)
    assert warnings[0] == f"{opened} was open to other users (mode 0755); it is closed now"
    assert stat.S_IMODE(opened.stat().st_mode) == 0o700
    found = modes(opened)
    for name in ("logs", "run", "assets", "postgres"):
        assert found[name] == "0o700"
    for name in ("logs/api.log", "server.json", "webhook.key", "lock", "run/worker-1.json"):
        assert found[name] == "0o600"
    assert make_private(opened) == []
    assert not is_open(opened)


def test_a_home_that_is_made_is_closed_whatever_the_umask(tmp_path: Path) -> None:
    before = os.umask(0)
    try:
        assert make_private(tmp_path / "a" / "home") == []
        with open_private(tmp_path / "a" / "home" / "x.log", "ab") as stream:
            stream.write(b"x")
        write_status(tmp_path / "a" / "home", "w", WorkerStatus(pid=7, ready=True, tick_age=0.0, written=0.0))
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "a" / "home").stat().st_mode) == 0o700
    assert set(modes(tmp_path / "a" / "home").values()) == {"0o600", "0o700"}
    assert stat.S_IMODE(status_file(tmp_path / "a" / "home", "w").stat().st_mode) == 0o600


def test_a_link_is_not_followed(opened: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir(mode=0o755)
    (opened / "logs" / "link").symlink_to(other)
    make_private(opened)
    assert stat.S_IMODE(other.stat().st_mode) == 0o755


def test_a_home_behind_a_link_is_closed(opened: Path, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(opened)
    make_private(tmp_path / "link")
    assert stat.S_IMODE(opened.stat().st_mode) == 0o700


def test_another_users_home_is_refused(opened: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: opened.stat().st_uid + 1)
    with pytest.raises(InvalidInput, match="belongs to the user") as refused:
        make_private(opened)
    assert "chown" in str(refused.value)
    assert is_open(opened)


def test_a_home_that_cannot_be_closed_is_refused(opened: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "chmod", lambda *_: None)  # as file systems without permissions do
    with pytest.raises(InvalidInput, match="file system"):
        make_private(opened)


def test_a_file_is_no_home(tmp_path: Path) -> None:
    (tmp_path / "home").write_text("x")
    with pytest.raises(InvalidInput):
        make_private(tmp_path / "home")
