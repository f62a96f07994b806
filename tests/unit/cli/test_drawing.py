"""The processes that draw."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from marey.cli import drawing

LEAVE = """
from marey.cli import drawing

def large(_: object) -> drawing.Pixels:
    return (1, 1), bytes(1 << 26)

if __name__ == "__main__":
    drawing._cores = lambda: 2
    drawing.draw = large
    with drawing.Drawers(100) as drawers:
        for _ in zip(range(2), drawers._in_processes(drawers._pool, iter(range(100)))):
            pass
    print("left")
"""


def test_a_command_that_leaves_while_pictures_are_sent_ends(tmp_path: Path) -> None:
    """A process terminated while it sends would leave the command waiting for the rest of its picture."""
    (tmp_path / "leave.py").write_text(LEAVE, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, tmp_path / "leave.py"], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (0, "left\n"), done.stderr


def test_an_interrupt_that_another_thread_takes_waits_until_a_process_is_started() -> None:
    """Python answers a signal in the main thread, whichever thread it was sent to, and whatever that one's mask is."""
    done, going = list[str](), threading.Event()
    other = threading.Thread(target=going.wait)
    other.start()

    def start() -> None:
        with drawing._without_interrupts():
            signal.pthread_kill(other.ident or 0, signal.SIGINT)
            for _ in range(100):  # the handler would have run between two of these
                time.sleep(0.001)
            done.append("started")
        done.append("went on")

    try:
        with pytest.raises(KeyboardInterrupt):
            start()
    finally:
        going.set()
        other.join()
    assert done == ["started"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
