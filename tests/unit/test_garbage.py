"""Python collects no garbage while modules are imported, nor when a command ends."""

from __future__ import annotations

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from marey.core.garbage import no_collection
from marey.registry import resolve

ENDS = """
import atexit, gc, sys
from marey.cli.main import run

class Cycle:
    def __init__(self):
        self.own = self

    def __del__(self):
        print("collected")

gc.disable()
Cycle()
atexit.register(print, "ended")
sys.argv = ["marey", "--version"]
run()
"""


def test_blocks_may_overlap_and_the_last_state_is_that_of_the_first() -> None:
    first, second = no_collection(), no_collection()
    with first:
        assert not gc.isenabled()
        with pytest.raises(ZeroDivisionError), second:
            raise ZeroDivisionError
        assert not gc.isenabled()
    assert gc.isenabled()
    gc.disable()
    try:
        with no_collection():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_what_a_reference_names_is_imported_without_collection(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "imported_by_reference.py").write_text("import gc\n\nenabled = gc.isenabled()\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert resolve("imported_by_reference:enabled") is False
    assert gc.isenabled()


def test_a_command_ends_without_a_last_collection_and_with_all_that_is_registered_for_its_end() -> None:
    ran = subprocess.run([sys.executable, "-c", ENDS], capture_output=True, text=True, check=True)
    (version, *rest) = ran.stdout.splitlines()
    assert (version[:1].isdigit(), rest) == (True, ["ended"])
