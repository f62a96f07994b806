"""Words for people while a stream runs, and the line that counts, on stderr.

On a terminal the line that counts stands above the one that is typed in, which it leaves as it is. Anywhere else there
are only words, a line each.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from marey.cli import console
from marey.core.characters import escape

if TYPE_CHECKING:
    from rich.text import Text

EVERY = 0.2
"""Seconds between two pictures of the line."""
UP, CLEAR_LINE, CLEAR_DOWN, SAVE, RESTORE = "\x1b[1A", "\x1b[2K", "\x1b[J", "\x1b7", "\x1b8"


class Screen:
    """stderr of `marey stream`.

    Attributes:
        live: it is a terminal, with a line that counts.
    """

    def __init__(self) -> None:
        self._console = console.stderr()
        plain = self._console.is_dumb_terminal or self._console.legacy_windows
        self.live = self._console.is_terminal and not plain
        self._line: str | None = None
        self._drawn = 0.0

    def say(self, text: str, *, typed: str | None = None) -> None:
        """A line for people.

        Args:
            typed: it answers this line, which the terminal has just shown below the one that counts.
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
        """Whether there is a line that counts, and it is time for a new picture of it."""
        return self.live and time.monotonic() - self._drawn >= EVERY

    def count(self, line: Text) -> None:
        """Draw the line that counts."""
        line.truncate(max(1, self._console.width - 1), overflow="ellipsis")
        with self._console.capture() as captured:
            self._console.print(line, end="")
        if self._line is None:
            self._write(f"\r{captured.get()}\n")
        else:
            self._write(f"{SAVE}{UP}\r{CLEAR_LINE}{captured.get()}{RESTORE}")
        self._line, self._drawn = captured.get(), time.monotonic()

    def close(self) -> None:
        """Take the line away."""
        if self.live:
            self._erase(0)
        self._line = None

    def _erase(self, rows: int) -> None:
        """The line that counts, `rows` more, and all below."""
        if self._line is not None:
            self._write(f"{UP * (rows + 1)}\r{CLEAR_DOWN}")

    def _write(self, text: str) -> None:
        self._console.file.write(text)
        self._console.file.flush()
