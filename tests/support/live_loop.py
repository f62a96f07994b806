"""A live worker inside the test's process: the real loop and supervisor around a small session pool."""

from __future__ import annotations

import os
import threading
import time
import zlib
from collections.abc import Callable
from dataclasses import replace
from uuid import UUID

import numpy as np
import redis
import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db import transaction
from marey.jobs import WorkerHeartbeat
from marey.runtime.live.loop import LiveLoop
from marey.runtime.live.port import Parse, SessionPool
from marey.runtime.live.supervisor import StreamSupervisor
from marey.streams import NewStream, StreamRow, create_stream, get_stream, stream_actions, stream_prompts
from marey.streams.actions import ActionStart
from marey.streams.control import ControlQueue, StreamControl
from marey.streams.frames import Frame, decode_frame
from marey.streams.presence import ViewerPresence
from marey.streams.redis import FrameStream, Gap
from marey.streams.states import LIVE_QUEUE
from marey.tenants import create_key
from marey.text.features import TextFeatures
from tests.support.prepared import text_features

PATIENCE = 60.0


def parse(prompt: str) -> TextFeatures:
    """Features that differ with the prompt; ", then " stands between its acts."""
    if prompt == "refused":
        raise InvalidInput("this prompt cannot be read")
    text, *acts = (text_features(zlib.crc32(part.encode())) for part in (prompt, *prompt.split(", then ")))
    if len(acts) == 1:
        return text
    rows = np.concatenate([act.nodes[:1] for act in acts])
    return replace(text, actions=tuple(prompt.split(", then ")), action_rows=rows)


class LiveWorker:
    """One live worker; `kill` leaves everything as a SIGKILL would."""

    def __init__(
        self,
        engine: sa.Engine,
        client: redis.Redis,
        open_pool: Callable[[], SessionPool],
        *,
        idle_seconds: float = 600.0,
        paused_seconds: float = 600.0,
        parse: Parse = parse,
    ) -> None:
        self._stopping = threading.Event()
        self.loop = LiveLoop(open_pool, lambda over: self.supervisor.over(over))
        beat = WorkerHeartbeat(f"live-{id(self)}", LIVE_QUEUE, "test", os.getpid(), "cpu", self.loop.pool.bundle)
        self.supervisor = StreamSupervisor(
            engine, client, beat, parse, stopping=self._stopping,
            idle_seconds=idle_seconds, paused_seconds=paused_seconds,
        )  # fmt: skip
        self._thread = threading.Thread(target=self.loop.run, args=(self._stopping,), daemon=True)
        self.supervisor.serve(self.loop)
        self._thread.start()

    def stop(self) -> None:
        """As SIGTERM."""
        self._stopping.set()
        for thread in (self._thread, self.supervisor, self.supervisor.renewer):
            thread.join(PATIENCE)

    def kill(self) -> None:
        """Stop without writing or releasing anything."""
        self.supervisor._give_back = lambda: None  # pyright: ignore
        self.stop()


Start = Callable[..., LiveWorker]
"""Starts a worker."""


class Studio:
    """A client's view of streams."""

    def __init__(self, engine: sa.Engine, client: redis.Redis, model: str, bundle: str) -> None:
        self.engine, self.client, self.model, self.bundle = engine, client, model, bundle
        with transaction(engine) as conn:
            self.key = create_key(conn, "studio", ["submit"]).key

    def begin(self, prompt: str = "a person walks", *, seed: int = 1, max_frames: int = 10_000) -> UUID:
        """Begin a stream."""
        new = NewStream(self.key.tenant, self.key.id, prompt, self.model, self.bundle, seed, max_frames)
        with transaction(self.engine) as conn:
            return create_stream(conn, new, limit=100)

    def row(self, stream: UUID) -> StreamRow:
        """Its row."""
        with transaction(self.engine) as conn:
            return get_stream(conn, self.key.tenant, stream)

    def send(self, stream: UUID, control: StreamControl) -> None:
        """A message."""
        ControlQueue(self.client, str(stream)).send(control)

    def watch(self, stream: UUID) -> None:
        """Open a viewer."""
        ViewerPresence(self.client, str(stream)).refresh()

    def frames(self, stream: UUID) -> list[Frame | Gap]:
        """All that Redis has."""
        reader = FrameStream(self.client, str(stream)).reader()
        found: list[Frame | Gap] = []
        while batch := reader.read(count=500):
            found += [each if isinstance(each, Gap) else decode_frame(each.data, joints=22) for each in batch]
        return found

    def shown(self, stream: UUID) -> int:
        """How many frames there are."""
        return FrameStream(self.client, str(stream)).bounds()[1]

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait for something that must come."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"{what} did not come in {PATIENCE:g} s"
            time.sleep(0.05)


def whole(studio: Studio, stream: UUID) -> list[Frame]:
    """The frames of a stream, none missing."""
    frames = [frame for frame in studio.frames(stream) if isinstance(frame, Frame)]
    assert [frame.number for frame in frames] == list(range(len(frames)))
    return frames


def farthest_step(frames: list[Frame]) -> float:
    """Return the farthest way of the root between two frames, in metres."""
    roots = np.stack([frame.root for frame in frames])
    return float(np.linalg.norm(np.diff(roots, axis=0), axis=1).max())


def actions_of(studio: Studio, stream: UUID) -> list[ActionStart]:
    """The acts of a stream that have begun."""
    with transaction(studio.engine) as conn:
        return stream_actions(conn, stream)


def prompts_of(studio: Studio, stream: UUID) -> list[tuple[int, str]]:
    """The first frame and the words of each prompt of a stream."""
    with transaction(studio.engine) as conn:
        return stream_prompts(conn, stream)
