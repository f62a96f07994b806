"""A disk that takes no more in the middle of a file: told, and nothing half done is left under a name.

The limit is that of a process on the size of its files, so that real calls fail with real errors, in a child.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("resource", reason="Windows has no such limit")

LIMIT = 64 * 1024
CHILD = Path(__file__).with_name("full_disk_child.py")


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """Message of each attempt and the files it left; see the child."""
    folder = tmp_path_factory.mktemp("disk")
    ran = subprocess.run(
        [sys.executable, str(CHILD), str(folder), str(LIMIT)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    return json.loads(ran.stdout)


@pytest.mark.parametrize("what", ["put", "put_all", "fetch", "page", "npz", "manifest"])
def test_what_finds_no_room_is_told_with_its_place_and_leaves_no_file_under_its_name(
    outcomes: dict[str, dict[str, Any]], what: str
) -> None:
    found = outcomes[what]
    assert "File too large" in found["said"]
    assert found["kind"] == ("Unreachable" if what.startswith("put") else found["kind"])
    assert found["kind"] in ("Unreachable", "InvalidInput", "InvalidFile")
    assert found["left"] == (["clip.npz.part"] if what == "fetch" else [])  # a fetch goes on from there


def test_a_file_that_was_there_before_stays_as_it_was(outcomes: dict[str, dict[str, Any]]) -> None:
    assert outcomes["replaced"]["kind"] == "InvalidInput"
    assert outcomes["replaced"]["left"] == ["old.html"]
    assert outcomes["replaced"]["content"] == "old"


def test_a_fetch_goes_on_when_there_is_room(outcomes: dict[str, dict[str, Any]]) -> None:
    assert outcomes["fetched"] == {"left": ["clip.npz"], "whole": True, "asked": ["bytes=0-", f"bytes={LIMIT}-"]}


def test_a_bvh_that_grows_keeps_its_whole_rows(outcomes: dict[str, dict[str, Any]]) -> None:
    found = outcomes["stream"]
    assert (found["kind"], found["left"]) == ("InvalidInput", ["live.bvh"])
    assert "cannot be written" in found["said"]
    assert 1 < found["written"] == found["read"]


@pytest.mark.parametrize("what", ["prompts", "last prompts"])
def test_prompts_that_cannot_be_kept_until_they_are_sent_are_told(
    outcomes: dict[str, dict[str, Any]], what: str
) -> None:
    found = outcomes[what]
    assert (found["kind"], found["left"]) == ("Unreachable", [])
    assert "the prompts: cannot be kept: File too large" in found["said"]
    assert "TMPDIR" in found["said"]
