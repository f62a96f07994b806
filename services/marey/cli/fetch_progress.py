"""Progress of `marey fetch`."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Self

from marey.cli import console
from marey.client import FetchObserver


class FetchProgress(FetchObserver):
    """A progress bar of one fetch, and notes about its folder; a context manager.

    Attributes:
        left: notes about files of earlier fetches, to say after the bar has ended.
    """

    def __init__(self, job: str, folder: Path) -> None:
        self.left: list[str] = []
        self._job, self._folder = job, console.home_relative(folder)
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def waiting(self, folder: Path) -> None:
        console.say(f"{self._folder}: another fetch writes into this folder; waiting for its end.")

    def planned(self, total: int) -> None:
        self._bar = self._stack.enter_context(console.bar())
        self._task = self._bar.add_task("fetching", total=total)

    def fetched(self, path: Path) -> None:
        self._bar.advance(self._task)

    def interrupted(self, done: int, total: int) -> None:
        self._bar.stop()
        console.say(
            f"{self._folder}: {done} of {total} files are there, and in manifest.csv; the same command goes on."
        )

    def left_over(self, paths: Sequence[Path], *, removed: bool) -> None:
        state = "were removed." if removed else "are no longer part of the selection: --prune removes them."
        self.left.append(f"{self._folder}: {len(paths)} files of earlier fetches of job {self._job} {state}")
