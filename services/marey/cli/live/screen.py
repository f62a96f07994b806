"""Messages and the status line of a running stream, on stderr.

On a terminal the status line is above the input line, which stays untouched. Elsewhere there are only messages.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from marey.cli import console
from marey.core.characters import escape

if TYPE_CHECKING:
    from rich.text import Text

EVERY = 0.2
"""Seconds between two updates of the status line."""
UP, CLEAR_LINE, CLEAR_DOWN, SAVE, RESTORE = "\x1b[1A", "\x1b[2K", "\x1b[J", "\x1b7", "\x1b8"


class Screen:
    """stderr of `marey stream`.

    Attributes:
        live: True for a terminal, which has a status line.
    """

    def __init__(self) -> None:
        self._console = console.stderr()
        plain = self._console.is_dumb_terminal or self._console.legacy_windows
        self.live = self._console.is_terminal and not plain
        self._line: str | None = None
        self._drawn = 0.0

    def say(self, text: str, *, typed: str | None = None) -> None:
        """Print a message.

        Args:
            typed: the input line that it answers, which the terminal shows below the status line.
        """
        if not self.live:
            console.say(text)
            return
        rows = 0 if typed is None else 1 + len(typed) // max(1, self._console.width)
        self._erase(rows)
        self._write(f"{escape(text)}\n")
        if self._line is not None:
            self._write(f"{self._line}\n")

    def due(self) -> bool:
        """Return True if the status line exists and has to be updated."""
        return self.live and time.monotonic() - self._drawn >= EVERY

    def count(self, line: Text) -> None:
        """Draw the status line."""
        line.truncate(max(1, self._console.width - 1), overflow="ellipsis")
        with self._console.capture() as captured:
            self._console.print(line, end="")
        if self._line is None:
            self._write(f"\r{captured.get()}\n")
        else:
            self._write(f"{SAVE}{UP}\r{CLEAR_LINE}{captured.get()}{RESTORE}")
        self._line, self._drawn = captured.get(), time.monotonic()

    def close(self) -> None:
        """Remove the status line."""
        if self.live:
            self._erase(0)
        self._line = None

    def _erase(self, rows: int) -> None:
        """Erase the status line, `rows` more, and everything below."""
        if self._line is not None:
            self._write(f"{UP * (rows + 1)}\r{CLEAR_DOWN}")

    def _write(self, text: str) -> None:
        self._console.file.write(text)
        self._console.file.flush()
