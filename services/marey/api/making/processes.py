"""The child processes that make files, and read rigs and poses: started when needed, two at most, ended when idle."""

from __future__ import annotations

import asyncio
import dataclasses
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import IO, Any, TypeVar

import structlog
from anyio import CapacityLimiter, to_thread

from marey.api.making.messages import read_message, write_message
from marey.core.errors import MareyError, TooLarge
from marey.exporters.making import FileRecipe
from marey.jobs import FailureReason

MOST = 2
"""Files that are made at a time: making is CPU-bound."""
FILE_SECONDS = 120
"""Of one file."""
MEMORY = 768 * 2**20
"""Bytes of memory of one process."""
IDLE_SECONDS = 60.0
Answer = TypeVar("Answer")

log = structlog.get_logger(__name__)


class MakingProcess:
    """One child process; one request at a time.

    Args:
        seconds: of one file.
        memory: bytes of its memory.
    """

    def __init__(self, seconds: int = FILE_SECONDS, memory: int = MEMORY) -> None:
        self._seconds = seconds
        # Settings hold secrets, and exporters need none.
        own = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
        self._process = subprocess.Popen(
            [sys.executable, "-m", "marey.api.making.child", str(seconds), str(memory)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**own, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"},
        )

    @property
    def alive(self) -> bool:
        """False after the process has ended: it takes no more requests."""
        return self._process.poll() is None

    def make(self, recipe: FileRecipe, npz: bytes, where: str, rig: bytes = b"") -> bytes | FailureReason:
        """Return the content of a file, or why it cannot be made. Blocks.

        Args:
            npz: the motion.
            where: its name in errors.
            rig: the file of the rig, where the recipe has one.
        """
        request = {"format": recipe.format, "options": recipe.chosen, "fps": recipe.fps, "where": where}
        request["rig"] = None if recipe.rig is None else dataclasses.asdict(recipe.rig)
        return self._ask({"task": "make", "npz": len(npz), **request}, npz + rig, "format")

    def report(self, name: str, format: str, rig_map: Any, data: bytes) -> dict[str, Any] | FailureReason:
        """Return what is found in a rig, or why it cannot be used. Blocks.

        Args:
            name: of the rig.
            format: ending of the file's name.
            rig_map: JSON value of the map of its joints; None = no map.
            data: the file.
        """
        request = {"task": "report", "name": name, "format": format, "map": rig_map}
        answer = self._ask(request, data, "body")
        return answer if isinstance(answer, FailureReason) else json.loads(answer)

    def poses(self, frames: Sequence[int], npz: bytes, where: str) -> list[dict[str, Any]] | FailureReason:
        """Return frames of a motion as poses (`marey.motion.keyframes.pose_of`), or why they cannot be read. Blocks.

        Args:
            npz: the motion.
            where: its name in errors.
        """
        answer = self._ask({"task": "poses", "frames": [*frames], "where": where}, npz, where)
        return answer if isinstance(answer, FailureReason) else json.loads(answer)

    def _ask(self, request: dict[str, Any], content: bytes, where: str) -> bytes | FailureReason:
        """Return the answer to a request; `where` names its field in the errors of a process that ends."""
        try:
            write_message(_pipe(self._process.stdin), request, content)
            answer, result = read_message(_pipe(self._process.stdout))
        except (OSError, EOFError, ValueError):  # it died, or was closed
            return self._ended(where)
        return FailureReason(**answer) if answer else result

    def close(self) -> None:
        """End the process, whatever it is doing."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                _pipe(pipe).close()

    def _ended(self, where: str) -> FailureReason:
        code = self._process.wait()
        if code == -signal.SIGALRM:
            return FailureReason.of(TooLarge(f"the file takes longer than {self._seconds} s to make", where=where))
        log.error("making_process_died", code=code)
        if code == -signal.SIGKILL:
            return FailureReason.of(TooLarge("the file takes more memory than this server gives", where=where))
        return FailureReason.of(MareyError("an internal error"))


def _pipe(pipe: IO[bytes] | None) -> IO[bytes]:
    assert pipe is not None
    return pipe


class MakingProcesses:
    """The processes of one API process; on the event loop."""

    def __init__(self) -> None:
        self._threads = CapacityLimiter(MOST)
        self._idle: list[MakingProcess] = []
        self._all: set[MakingProcess] = set()
        self._lock = threading.Lock()
        self._closed = False
        self._reaping: asyncio.TimerHandle | None = None

    async def make(self, recipe: FileRecipe, npz: bytes, where: str, rig: bytes = b"") -> bytes | FailureReason:
        """Return the content of a file, or why it cannot be made; waits for its turn."""
        return await self._run(lambda process: process.make(recipe, npz, where, rig))

    async def report(self, name: str, format: str, rig_map: Any, data: bytes) -> dict[str, Any] | FailureReason:
        """Return what is found in a rig, or why it cannot be used; waits for its turn."""
        return await self._run(lambda process: process.report(name, format, rig_map, data))

    async def poses(self, frames: Sequence[int], npz: bytes, where: str) -> list[dict[str, Any]] | FailureReason:
        """Return frames of a motion as poses, or why they cannot be read; waits for its turn."""
        return await self._run(lambda process: process.poses(frames, npz, where))

    async def _run(self, call: Callable[[MakingProcess], Answer]) -> Answer:
        answer = await to_thread.run_sync(self._call, call, limiter=self._threads)
        if self._reaping is not None:
            self._reaping.cancel()
        self._reaping = asyncio.get_running_loop().call_later(IDLE_SECONDS, self._reap)
        return answer

    def close(self) -> None:
        """End all processes; files in the making fail."""
        with self._lock:
            self._closed = True
            open_processes, self._all, self._idle = self._all, set(), []
        if self._reaping is not None:
            self._reaping.cancel()
        for process in open_processes:
            process.close()

    def _call(self, call: Callable[[MakingProcess], Answer]) -> Answer:
        process = self._take()
        answer = call(process)
        self._return(process)
        return answer

    def _take(self) -> MakingProcess:
        with self._lock:
            if self._closed:
                raise MareyError("the server is stopping")
            while self._idle:
                process = self._idle.pop()
                if process.alive:
                    return process
                self._all.discard(process)
            process = MakingProcess()
            self._all.add(process)
            return process

    def _return(self, process: MakingProcess) -> None:
        with self._lock:
            if process not in self._all:
                return
            if process.alive:
                self._idle.append(process)
            else:
                self._all.discard(process)
                process.close()

    def _reap(self) -> None:
        with self._lock:
            idle, self._idle = self._idle, []
            self._all.difference_update(idle)
        for process in idle:
            process.close()
