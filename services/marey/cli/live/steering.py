"""Input of `marey stream`: lines that are typed or piped in, and Ctrl-C."""

from __future__ import annotations

import os
import queue
import signal
import sys
import threading
from dataclasses import dataclass
from typing import Any, Literal

from marey.core.errors import InvalidInput
from marey.items.prompts import check_prompt

COMMANDS: dict[str, Literal["pause", "resume", "stop"]] = {"/pause": "pause", "/resume": "resume", "/stop": "stop"}
HELP = "Type what the person does next and press Enter; /pause, /resume, /stop; Ctrl-C stops, too."
BLOCK = 65536


@dataclass(frozen=True)
class Command:
    """A command to a stream; the prompt is that of `steer`."""

    kind: Literal["steer", "pause", "resume", "stop"]
    prompt: str | None = None


def command_of(line: str) -> Command | None:
    """Return the command that a line stands for; None = an empty line.

    Raises:
        InvalidInput: an unknown command, or text that cannot be a prompt.
    """
    text = line.strip()
    if not text:
        return None
    if text.startswith("/"):
        if text.lower() not in COMMANDS:
            raise InvalidInput(f"{text[:20]!r} is not a command", hint=f"Known: {', '.join(COMMANDS)}.")
        return Command(COMMANDS[text.lower()])
    return Command("steer", check_prompt(text))


class StdinLines:
    """The lines of stdin as they arrive; the end of stdin has no effect.

    They are read from the descriptor: a thread that waits in Python's own `stdin` at exit crashes the program.
    """

    def __init__(self) -> None:
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._descriptor = _stdin()
        self.typed = self._descriptor is not None and os.isatty(self._descriptor)
        if self._descriptor is not None:
            threading.Thread(target=self._read, args=(self._descriptor,), daemon=True).start()

    def take(self) -> list[str]:
        """Return the lines that arrived since the last call."""
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
    """Counts Ctrl-C within the block. The first stops the stream; the second raises `KeyboardInterrupt`."""

    def __init__(self) -> None:
        self.count = 0
        self._before: Any = None

    def __enter__(self) -> Interrupts:
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # set by a shell that runs this in the background
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
    """Return the descriptor to read; None without stdin, or for a terminal that another process group controls."""
    try:
        descriptor = sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # closed, or something else in its place
        return None
    if os.isatty(descriptor) and hasattr(os, "tcgetpgrp"):
        try:
            if os.tcgetpgrp(descriptor) != os.getpgrp():
                return None  # a read from the background would stop the whole program
        except OSError:
            pass  # not the controlling terminal
    return descriptor
