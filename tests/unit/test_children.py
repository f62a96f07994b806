"""Processes of a pool end with the command that started them, also where it is killed."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from tests.support.live_api import wait_until

STAY = """
import os, sys, time
from pathlib import Path

def stay(*_):
    (Path(sys.argv[1]) / str(os.getpid())).touch()
    time.sleep(600)
"""
POOLS = {
    "drawing": """
from marey.cli import drawing

if __name__ == "__main__":
    drawing._cores, drawing.draw = lambda: 2, stay
    with drawing.Drawers(100) as drawers:
        list(drawers._in_processes(drawers._pool, iter(range(8))))
""",
    "data prepare": """
from marey.data import prepare

prepare.retarget_file = stay
list(prepare._retarget_all([(str(number), b"") for number in range(64)], None, 2))
""",
    "data text": """
from marey.training import texts

class Pipeline:
    spec, parse = None, stay

    @classmethod
    def load(cls, *_, **__):
        return cls()

texts.TextPipeline = Pipeline
if __name__ == "__main__":
    with texts._readers(Pipeline(), 2, None) as (read, _):
        list(read([["a"]] * 8))
""",
}


@pytest.mark.parametrize("name", POOLS)
def test_processes_end_with_a_killed_parent(name: str, tmp_path: Path) -> None:
    script, begun = tmp_path / "script.py", tmp_path / "begun"
    script.write_text(STAY + POOLS[name], encoding="utf-8")
    begun.mkdir()
    parent = subprocess.Popen([sys.executable, script, begun])
    try:
        wait_until(lambda: len(list(begun.iterdir())) == 2, seconds=120)
    finally:
        parent.kill()
        parent.wait()
    children = [int(file.name) for file in begun.iterdir()]
    try:
        wait_until(lambda: not any(map(_runs, children)), seconds=30)
    finally:
        for child in filter(_runs, children):
            os.kill(child, signal.SIGKILL)


def _runs(process: int) -> bool:
    try:
        return psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
