"""Where the server is and which key it wants, from the environment."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from marey.client.server_address import Server, find_server
from marey.core.errors import InvalidFile, InvalidInput, Unauthenticated, Unreachable

URL = "https://marey.example.com"


@pytest.fixture(autouse=True)
def environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MAREY_SERVER", f"{URL}/")
    monkeypatch.delenv("MAREY_KEY", raising=False)
    monkeypatch.delenv("MAREY_KEY_FILE", raising=False)


def test_a_key_may_stand_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "key").write_text("marey_key\n")
    monkeypatch.setenv("MAREY_KEY_FILE", str(tmp_path / "key"))
    assert find_server() == Server(URL, "marey_key")


@pytest.mark.parametrize("content", [None, b"\xff\xfe"])
def test_a_file_that_holds_no_key_is_told_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: bytes | None
) -> None:
    path = tmp_path / "key"
    if content is not None:
        path.write_bytes(content)
    monkeypatch.setenv("MAREY_KEY_FILE", str(path))
    with pytest.raises(InvalidFile, match="cannot be read") as told:
        find_server()
    assert str(path) in str(told.value)


@pytest.mark.parametrize("key", ["marey_…", "mare\ny", "marey_1 2", "\x1b[2J"])
def test_what_no_header_can_hold_is_no_key(monkeypatch: pytest.MonkeyPatch, key: str) -> None:
    monkeypatch.setenv("MAREY_KEY", key)
    with pytest.raises(Unauthenticated, match="this is not an API key"):
        find_server()
    monkeypatch.setenv("MAREY_KEY", " marey_key\r\n")
    assert find_server().key == "marey_key"


@pytest.mark.parametrize(
    "url",
    [
        "http://",
        "https:///x",
        "ftp://a",
        "a:8400",
        "http://a b",
        "http://a\\b",
        "http://[::1",
        "http://a:99999",
        "http://k@a",
    ],
)
def test_what_is_no_address_is_told(monkeypatch: pytest.MonkeyPatch, url: str) -> None:
    monkeypatch.setenv("MAREY_KEY", "marey_key")
    monkeypatch.setenv("MAREY_SERVER", url)
    with pytest.raises(InvalidInput, match=r"^MAREY_SERVER (is .*, not a URL|holds a user or a password)"):
        find_server()
    for fine in ("http://[::1]:8400", "https://a.example/marey"):
        monkeypatch.setenv("MAREY_SERVER", fine)
        assert find_server().url == fine


def test_no_key_at_all_is_told_with_what_to_set(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(Unauthenticated, match="MAREY_KEY is empty"):
        find_server()
    (tmp_path / "key").write_text("")
    monkeypatch.setenv("MAREY_KEY_FILE", str(tmp_path / "key"))
    with pytest.raises(Unauthenticated, match="the file of MAREY_KEY_FILE is empty"):
        find_server()


def test_a_server_that_is_starting_is_told_from_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MAREY_SERVER")
    monkeypatch.setenv("MAREY_HOME", str(tmp_path))

    def message() -> str:
        with pytest.raises(Unreachable) as raised:
            find_server()
        return str(raised.value)

    assert "no server is running here" in message()
    (tmp_path / "lock").write_text(json.dumps({"pid": os.getpid()}))
    assert "the server here is starting, or stopping" in message()
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    for left in (json.dumps({"pid": ended.pid}), "", "[]", '{"pid": "x"}'):
        (tmp_path / "lock").write_text(left)
        assert "no server is running here" in message()
