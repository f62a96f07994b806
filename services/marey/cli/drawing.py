"""Drawing motions in child processes, one for each core, because drawing holds the interpreter lock."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from pathlib import Path
from typing import TYPE_CHECKING

from marey.core.children import end_with_parent
from marey.core.cores import cores
from marey.core.errors import MareyError

if TYPE_CHECKING:
    from PIL import Image

MOST_PROCESSES = 8
FEW = 12
"""Pictures that are drawn sooner in this process than in a child that has to start first."""
AHEAD = 4
"""Pictures of each process that are drawn before the first of them is taken: each waits in memory."""
THEME = "light"


@dataclass(frozen=True)
class Drawing:
    """A motion to draw.

    Attributes:
        path: its npz.
        columns: poses of a row of a contact sheet; None = a tile of an overview.
    """

    path: Path
    caption: str
    columns: int | None = None


Pixels = tuple[tuple[int, int], bytes]
"""Size and RGB of a picture."""


class Drawers:
    """Processes that draw; started when they are first needed, ended with the block, however it ends.

    Args:
        count: of the motions to come; a few are drawn in this process.
    """

    def __init__(self, count: int) -> None:
        self._processes = min(cores(), MOST_PROCESSES, count // FEW)
        self._pool: ProcessPoolExecutor | None = None
        if self._processes > 1:
            self._pool = ProcessPoolExecutor(self._processes, multiprocessing.get_context("spawn"), initializer=_begin)

    def __enter__(self) -> Drawers:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            # The few pictures that are begun are finished: a process that is terminated while it sends one leaves the
            # pool's thread, and with it the command, waiting for the rest for ever.
            self._pool.shutdown(cancel_futures=True)

    def draw(self, drawings: Iterable[Drawing]) -> Iterator[Image.Image]:
        """Draw motions, in their order.

        Raises:
            InvalidFile: one of them is not a motion.
            MareyError: a process was killed.
        """
        from PIL import Image

        for size, content in map(draw, drawings) if self._pool is None else self._in_processes(self._pool, drawings):
            yield Image.frombytes("RGB", size, content)

    def _in_processes(self, pool: ProcessPoolExecutor, drawings: Iterable[Drawing]) -> Iterator[Pixels]:
        waiting: deque[Future[Pixels]] = deque()
        resource_tracker.ensure_running()  # else the first submit starts it, which lets SIGINT through again
        try:
            for drawing in drawings:
                with _without_interrupts():  # a process is started when it is first needed, and inherits this
                    waiting.append(pool.submit(draw, drawing))
                if len(waiting) > AHEAD * self._processes:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        except BrokenProcessPool as error:
            raise MareyError(
                "a process that draws was killed; perhaps there was not enough memory",
                hint="Draw fewer motions: --limit, or --per-page.",
            ) from error


def draw(drawing: Drawing) -> Pixels:
    """Draw one motion."""
    from marey.motion.clip import load_npz
    from marey.viz.overview import draw_tile
    from marey.viz.paper import theme_named
    from marey.viz.render import draw_row
    from marey.viz.strip import chosen_frames

    clip, theme = load_npz(drawing.path), theme_named(THEME)
    if drawing.columns is None:
        image = draw_tile(clip, drawing.caption, theme=theme)
    else:
        frames = chosen_frames(clip, drawing.columns)
        image = draw_row(clip, drawing.caption, frames, columns=drawing.columns, theme=theme)
    return image.size, image.tobytes()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Let Ctrl-C, which every process of a terminal gets, wait: only the command itself answers it, afterwards.

    A process that is started meanwhile inherits the mask. The mask of this thread alone does not keep the handler from
    running in it: another thread, such as that of a progress bar, may take the signal.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    handler, waiting = signal.getsignal(signal.SIGINT), list[int]()
    answers = threading.current_thread() is threading.main_thread() and handler is not None
    if answers:
        signal.signal(signal.SIGINT, lambda number, _: waiting.append(number))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        if answers:
            signal.signal(signal.SIGINT, handler)
        if waiting:
            signal.raise_signal(signal.SIGINT)


def _begin() -> None:
    """Prepare a process that draws: it ends with the command, however that ends, and not by Ctrl-C of its own."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # there is a process for each core; numpy is loaded after this
    end_with_parent()
