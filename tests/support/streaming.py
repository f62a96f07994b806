"""`marey stream` against a stand-in server: the command, in this process and as one of its own, and its file."""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from marey.cli.main import app
from marey.motion.io.bvh import read_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.skeleton import HUMANML3D
from tests.support.marey import COMMAND, REPOSITORY, Ran
from tests.support.stream_server import KEY, StreamServer

PROMPT = "a person walks"
SLOW = {"speed": 100.0, "frames": 100_000}
"""A stream that goes on until it is stopped."""


def environ(server: StreamServer, home: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
    return {**kept, "MAREY_HOME": str(home), "MAREY_SERVER": server.url, "MAREY_KEY": KEY, "OMP_NUM_THREADS": "1"}


def run(server: StreamServer, *arguments: object, prompt: str = PROMPT, key: str = KEY) -> Ran:
    """The command in this process, without stdin."""
    env = {"MAREY_SERVER": server.url, "MAREY_KEY": key}
    done = CliRunner().invoke(app, ["stream", prompt, *map(str, arguments)], env=env)
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    return Ran(done.exit_code, done.stdout, done.stderr)


@dataclass
class Running:
    """The command as a process of its own."""

    process: subprocess.Popen[bytes]
    events: list[dict[str, Any]] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    changed: threading.Condition = field(default_factory=threading.Condition)
    threads: list[threading.Thread] = field(default_factory=list)

    @classmethod
    def start(cls, server: StreamServer, home: Path, *arguments: object, **streams: Any) -> Running:
        streams = {
            "env": environ(server, home),
            "stdin": subprocess.PIPE,
            "stdout": subprocess.PIPE,
            "stderr": subprocess.PIPE,
            **streams,
        }
        command = [*COMMAND, "stream", PROMPT, "--json", *map(str, arguments)]
        running = cls(subprocess.Popen(command, cwd=REPOSITORY, **streams))
        running._follow(running.process.stdout, lambda line: running.events.append(json.loads(line)))
        if running.process.stderr is not None:
            running._follow(running.process.stderr, running.said.append)
        return running

    def _follow(self, stream: Any, take: Callable[[str], object]) -> None:
        def read() -> None:
            for line in stream:
                with self.changed:
                    take(line.decode())
                    self.changed.notify_all()

        self.threads.append(threading.Thread(target=read, daemon=True))
        self.threads[-1].start()

    def until(self, wanted: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
        """The first event that is so."""
        with self.changed:
            assert self.changed.wait_for(lambda: any(map(wanted, self.events)), 60), (self.events, self.said)
        return next(event for event in self.events if wanted(event))

    def until_said(self, text: str) -> None:
        with self.changed:
            assert self.changed.wait_for(lambda: any(text in line for line in self.said), 60), self.said

    def type(self, *lines: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write("".join(f"{line}\n" for line in lines).encode())
        self.process.stdin.flush()

    def wait(self) -> int:
        return self.process.wait(60)

    def end(self) -> dict[str, Any]:
        """Its last line; to be asked for when the process is over."""
        return self.until(lambda event: event["type"] == "end")


def is_live(event: dict[str, Any]) -> bool:
    return event["type"] == "state" and event["state"] == "live"


def frames_of(path: Path) -> int:
    return len(read_bvh(path, rest_frame="keep").root)


def check_frames(path: Path, server: StreamServer, frames: list[int]) -> None:
    """These frames of the file are those of the server, to a millimetre (frames are quantised)."""
    read = read_bvh(path, rest_frame="keep")
    order = [read.skeleton.joint_names.index(name) for name in HUMANML3D.joint_names]
    wanted = forward_kinematics(HUMANML3D, server.rotations, server.root)[frames]
    assert np.abs(read.joints()[frames][:, order] - wanted).max() < 1e-3
    assert read.fps == 20
    assert read.notes == ()
