"""The console script. Importing this module costs nothing, so that Ctrl-C is heeded while all else is imported."""

from __future__ import annotations

import os
import signal
import sys
from types import FrameType

CODE = 130
"""`console.INTERRUPTED`, which cannot be imported before the imports that this is for."""


def run() -> None:
    """Import the command line and run it. Ctrl-C during the imports ends the process with one line and no traceback."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:  # else a shell runs this in the background, and ignores Ctrl-C
        signal.signal(signal.SIGINT, _interrupted)
    from marey.cli import main

    signal.signal(signal.SIGINT, before)
    main.run()


def _interrupted(_number: int, _frame: FrameType | None) -> None:
    """End at once: an exception within an import may be taken for a missing module."""
    sys.stdout.flush()
    os.write(2, b"marey: interrupted\n")
    os._exit(CODE)
