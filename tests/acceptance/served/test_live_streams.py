"""Live streams through the real server: the command line, a kill -9 of the worker that shows them, the clip."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from uuid import UUID

import pytest
import sqlalchemy as sa
from websockets.sync.client import ClientConnection

from marey.db import create_engine
from marey.motion.io.bvh import read_bvh
from marey.streams import stream_actions
from marey.streams.actions import ActionStart
from marey.streams.frames import Frame, decode_frame
from tests.support.marey import Marey, serving, socket_of

PATIENCE = 90.0
ACTS = "walk forward, then wave with the right hand"


@pytest.fixture
def alone(models: Path, short_home: Path) -> Marey:
    """The command line of a server that a test may break."""
    return Marey(short_home, models)


def wait_for(what: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not what():
        assert time.monotonic() < deadline, "it did not happen in time"
        time.sleep(0.1)


def actions_of(engine: sa.Engine, stream: str) -> list[ActionStart]:
    with engine.connect() as conn:
        return stream_actions(conn, UUID(stream))


def frames_until(socket: ClientConnection, enough: Callable[[list[Frame]], bool]) -> list[Frame]:
    frames: list[Frame] = []
    while not enough(frames):
        message = socket.recv(timeout=PATIENCE)
        if isinstance(message, bytes):
            frames.append(decode_frame(message))
        else:
            assert json.loads(message)["type"] not in ("gap", "error", "end"), message
    return frames


@pytest.mark.slow
def test_a_stream_goes_on_after_a_kill_of_the_worker_that_shows_it(alone: Marey) -> None:
    with serving(alone) as server, alone.client() as client:
        stream: dict[str, Any] = client.post_once("/v1/streams", {"prompt": ACTS, "seed": 7})
        with socket_of(alone, stream["id"]) as socket:
            worker = server.children()["live"]
            engine = create_engine(worker.environ()["MAREY_DATABASE_URL"])
            before = frames_until(
                socket, lambda found: len(found) % 20 == 0 and len(actions_of(engine, stream["id"])) == 2
            )
            actions = actions_of(engine, stream["id"])
            worker.kill()
            socket.send(json.dumps({"kind": "steer", "prompt": "a person waves"}))
            after = frames_until(socket, lambda found: bool(found) and found[-1].prompt == 1)
            socket.send(json.dumps({"kind": "stop"}))
            last = frames_until(socket, lambda found: bool(found) and found[-1].last)
        shown = [frame.number for frame in (*before, *after, *last)]
        assert shown == list(range(len(shown)))
        wait_for(lambda: client.get(f"/v1/streams/{stream['id']}")["state"] == "ended")
        ended = client.get(f"/v1/streams/{stream['id']}")
        assert ended["frames"] == len(shown)
        steered = next(frame.number for frame in after if frame.prompt == 1)
        assert actions_of(engine, stream["id"]) == [*actions, ActionStart(steered, 0)]  # none began again
        engine.dispose()
        assert [prompt["prompt"] for prompt in ended["prompts"]] == [ACTS, "a person waves"]
        alone("jobs", "wait", ended["job"], "--timeout", 90, timeout=120).ok()
        (motion,) = client.pages(f"/v1/jobs/{ended['job']}/motions")
        assert motion["frames"] == len(shown)


def test_a_stream_on_the_command_line_leaves_a_bvh_and_a_motion(marey: Marey, tmp_path: Path) -> None:
    file = tmp_path / "clip.bvh"
    ran = marey(
        *("stream", "a person walks", "--seconds", 3, "--seed", 5, "-o", file, "--fetch", tmp_path / "clips", "--json"),
        stdin="a person waves\n",
    ).ok()
    (result,) = [line for line in ran.lines if "stream" in line and "job" in line]
    assert (result["state"], result["frames"], result["gaps"]) == ("ended", 60, 0)
    assert len(read_bvh(file).rotations) == 60
    assert {path.suffix for path in (tmp_path / "clips").rglob("*") if path.is_file()} >= {".bvh", ".npz"}
