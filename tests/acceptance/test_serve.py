"""`marey serve` as a whole: what it starts, what it starts again, and that nothing of it is left."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from marey.client.health import is_healthy
from marey.embedded import socket_folder
from tests.support.marey import START_SECONDS, Marey, Serving, serving

COUNT = 40


def slow_items() -> list[dict[str, object]]:
    """Items that are made four at a time, for the settings of a batch are the same: batches to kill in between."""
    return [
        {"prompt": f"a person walks {n} steps", "seconds": 9, "settings": {"steps": 20, "guidance": 1 + n // 4}}
        for n in range(COUNT)
    ]


def wait_for(what: Callable[[], object], seconds: float = 60) -> None:
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.1)


def open_to_others(home: Path) -> list[str]:
    """List the files of a home that another user could read if its folder were open."""
    paths = [home, *(path for path in home.rglob("*") if not path.is_socket())]
    return [str(path) for path in paths if path.lstat().st_mode & 0o077]


def deep(home: Path) -> Path:
    """A home whose path is too long for a socket in it."""
    home = home.joinpath(*["a-rather-long-name"] * 6)
    home.parent.mkdir(parents=True)
    return home


def kill_outright(server: Serving) -> None:
    """SIGKILL, after which every process that it started, and theirs, must end."""
    family = psutil.Process(server.process.pid).children(recursive=True)
    assert len(family) >= 6
    os.kill(server.process.pid, signal.SIGKILL)
    server.process.wait()
    _, alive = psutil.wait_procs(family, timeout=45)
    assert alive == []


@pytest.fixture
def alone(models: Path, short_home: Path) -> Marey:
    """The command line of a server that a test may break."""
    return Marey(short_home, models)


def test_what_dies_is_started_again_and_nothing_outlives_a_killed_server_even_in_a_deep_folder(alone: Marey) -> None:
    """With the smallest worker: the tests below kill one that makes motions, and start the server again."""
    alone = replace(alone, home=deep(alone.home), environment={"MAREY_LIVE_SLOTS": "0"})
    opened = (alone.home, alone.home / "logs", alone.home / "logs" / "api.log")
    opened[1].mkdir(parents=True)
    opened[2].touch()
    for path in opened:
        path.chmod(0o755)  # a home that was open before
    with serving(alone, "--with", "hgm3") as server:
        job = alone.submit("a person waves", "--seconds", 2)
        before = server.children()
        assert before.keys() == {"postgres", "valkey-server", "api", "scheduler", "text", "worker"}
        for kind in ("scheduler", "postgres", "valkey-server"):  # a child, and what the children need
            before[kind].kill()
        for kind in ("scheduler", "postgres", "valkey-server"):
            wait_for(lambda kind=kind: _is_back(server.children, kind, before[kind].pid), START_SECONDS)
        with alone.client() as client:
            wait_for(lambda: is_healthy(f"{client.server.url}/readyz", timeout=2), START_SECONDS)
        assert [each["id"] for each in alone.jobs()] == [job]
        assert open_to_others(alone.home) == []
        kill_outright(server)
    alone("jobs", "list").refused(4, "does not answer")
    shutil.rmtree(socket_folder(alone.home))


@pytest.mark.slow
def test_whatever_is_killed_every_prompt_of_a_job_becomes_one_motion(alone: Marey) -> None:
    with serving(alone) as server:
        job = alone.submit("-f", "-", stdin="\n".join(map(json.dumps, slow_items())))
        with alone.client() as client:

            def succeeded() -> int:
                return client.get(f"/v1/jobs/{job}")["counters"]["succeeded"]

            for kind in ("worker child", "scheduler", "api", "text", "postgres", "valkey-server", "worker"):
                children = server.children()
                victim = children["worker"].children()[0] if kind == "worker child" else children[kind]
                victim.kill()
                wait_for(lambda kind=kind, old=victim.pid: _is_back(server.children, kind, old))
            alone("jobs", "wait", job, "--timeout", 90, timeout=120).ok()
            assert succeeded() == COUNT
            motions = list(client.pages(f"/v1/jobs/{job}/motions"))
            assert len({motion["item"] for motion in motions}) == len(motions) == COUNT


@pytest.mark.slow
def test_a_killed_server_leaves_no_process_and_makes_its_motions_once_it_is_started_again(alone: Marey) -> None:
    with serving(alone) as server:
        job = alone.submit("a person waves", "--seconds", 2)
        kill_outright(server)
    with serving(alone) as server:
        assert alone("jobs", "wait", job, "--timeout", 60).code == 0
        server.stop()
        assert not (alone.home / "server.json").exists()


def _is_back(children: Callable[[], dict[str, psutil.Process]], kind: str, old: int) -> bool:
    """Return True if another process has taken over from the killed one."""
    now = children()
    if kind != "worker child":
        return kind in now and now[kind].pid != old
    found = now["worker"].children() if "worker" in now else []
    return any(child.pid != old for child in found)
