"""What somebody types while a stream runs, or pipes in, and Ctrl-C."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
from typing import Any

from marey.core.errors import InvalidInput
from marey.items.prompts import check_prompt

WORDS = {"/pause": "pause", "/resume": "resume", "/stop": "stop"}
HELP = "Type what the person does next and press Enter; /pause, /resume, /stop; Ctrl-C stops, too."
BLOCK = 65536


def message_of(line: str) -> dict[str, str] | None:
    """The control message that a line asks for; None = an empty line.

    Raises:
        InvalidInput: a word that there is not, or no prompt.
    """
    text = line.strip()
    if not text:
        return None
    if text.startswith("/"):
        if text.lower() not in WORDS:
            raise InvalidInput(f"{text[:20]!r} is no word of a stream", hint=f"There are {', '.join(WORDS)}.")
        return {"kind": WORDS[text.lower()]}
    return {"kind": "steer", "prompt": check_prompt(text)}


class Lines:
    """The lines of stdin, as they come; its end is no line, and ends nothing.

    They are read from the descriptor: a thread that waits in Python's own `stdin` when the program ends brings it down.
    """

    def __init__(self) -> None:
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._descriptor = _stdin()
        self.typed = self._descriptor is not None and os.isatty(self._descriptor)
        if self._descriptor is not None:
            threading.Thread(target=self._read, args=(self._descriptor,), daemon=True).start()

    def take(self) -> list[str]:
        """The lines that came since the last call."""
        taken: list[str] = []
        while True:
            try:
                taken.append(self._lines.get_nowait())
            except queue.Empty:
                return taken

    def _read(self, descriptor: int) -> None:
        rest = b""
        while True:
            try:
                block = os.read(descriptor, BLOCK)
            except OSError:
                block = b""
            *lines, rest = (rest + block).split(b"\n") if block else (rest, b"")
            for line in lines:
                self._lines.put(line.decode("utf-8", "replace").removeprefix("\ufeff"))
            if not block:
                return


class Interrupts:
    """Counts Ctrl-C within the block. The first is for the stream, which is stopped; the second leaves at once."""

    def __init__(self) -> None:
        self.count = 0
        self._before: Any = None

    def __enter__(self) -> Interrupts:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # a shell that runs us in the background wants that
            self._before = signal.signal(signal.SIGINT, self._interrupted)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _interrupted(self, *_: object) -> None:
        self.count += 1
        if self.count > 1:
            raise KeyboardInterrupt


def _stdin() -> int | None:
    """The descriptor to read; None where there is none, or where it is a terminal that is not ours to read."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # closed, or something else in its place
        return None
    if os.isatty(descriptor) and hasattr(os, "tcgetpgrp"):
        try:
            if os.tcgetpgrp(descriptor) != os.getpgrp():
                return None  # a read from the background would stop the whole program
        except OSError:
            pass  # a terminal that does not control us
    return descriptor
