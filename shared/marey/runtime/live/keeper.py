"""The thread beside the frames: takes streams, renews what it holds, reads messages, writes tokens down, closes."""

from __future__ import annotations

import hashlib
import queue
import threading
import time
from collections.abc import Callable

import numpy as np
import redis
import sqlalchemy as sa

from marey.core import metrics
from marey.core.errors import InvalidInput, MareyError, Unreachable
from marey.db import transaction
from marey.jobs import NewItem, Problem, WorkerBeat, beat, retire
from marey.runtime.exposition import measure_gpu
from marey.runtime.faults import as_problem, patiently
from marey.runtime.live.held import Held
from marey.runtime.live.loop import LiveLoop, Over
from marey.runtime.live.port import Parse, Room
from marey.runtime.live.reading import Opening, Reading
from marey.runtime.logs import logger
from marey.streams import StreamPast, StreamRow, StreamState, add_chunk, end_stream, open_streams, take_stream
from marey.streams.bell import Bell
from marey.streams.control import Control, ControlQueue
from marey.streams.reads import ReadAs
from marey.streams.recording import Recording
from marey.streams.redis import RENEW_SECONDS, FrameStream, Lease, LeaseLost
from marey.streams.watch import Watch

log = logger(__name__)

LISTEN_SECONDS = 0.05
TAKE_SECONDS = 0.5
RECORD_SECONDS = 1.0
READ_SECONDS = 0.1
"""Prompts are mostly read in milliseconds: each is waited for so long, then looked for every `LISTEN_SECONDS`."""
CLOSE_PATIENCE = 120.0
STALL_SECONDS = 10.0
QUEUE = "live"
"""What live workers are called among the workers."""


class Keeper(threading.Thread):
    """Holds the streams of one live loop.

    Args:
        engine, client: Postgres and Redis.
        worker: this worker's row, renewed every second.
        parse: reads prompts, on several threads.
        idle_seconds: a stream that nobody watched for so long ends; `paused_seconds`, one that was paused for so long.
    """

    def __init__(
        self,
        engine: sa.Engine,
        client: redis.Redis,
        worker: WorkerBeat,
        parse: Parse,
        *,
        idle_seconds: float,
        paused_seconds: float,
        stopping: threading.Event,
    ) -> None:
        super().__init__(name="keeper", daemon=True)
        self._engine, self._redis = engine, client
        self._worker, self._parse = worker, parse
        self._idle_seconds, self._paused_seconds = idle_seconds, paused_seconds
        self._stopping = stopping
        self._over: queue.SimpleQueue[Over] = queue.SimpleQueue()
        self._bell = Bell(client)
        self._openings: dict[str, Opening] = {}
        self._held: dict[str, Held] = {}
        self._rounds = (
            _Round(self._open, LISTEN_SECONDS),
            _Round(self._listen, LISTEN_SECONDS),
            _Round(self._answer, LISTEN_SECONDS),
            _Round(self._take, TAKE_SECONDS),
            _Round(self._record, RECORD_SECONDS),
        )
        self.renewer = threading.Thread(target=self._renew_all, name="renewer", daemon=True)

    def serve(self, loop: LiveLoop) -> None:
        """Start, for this loop."""
        self._loop = loop
        self._room: Room = loop.room
        self.renewer.start()
        self.start()

    def over(self, what: Over) -> None:
        """The loop is through with a stream."""
        self._over.put(what)

    def run(self) -> None:
        while not self._stopping.wait(LISTEN_SECONDS / 2):
            while not self._over.empty():
                self._guarded(lambda over=self._over.get(): self._close(over))
            for turn in self._rounds:
                if turn.due():
                    self._guarded(turn.action)
        self._give_back()

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Unreachable as error:
            log.warning("outage", error=error.message)
        except Exception:
            log.exception("keeper_failed")  # without this thread nothing would be written down

    # --- leases ---

    def _renew_all(self) -> None:
        """On a thread of its own: a database that hangs must not cost a lease."""
        while not self._stopping.wait(RENEW_SECONDS):
            if time.monotonic() - self._loop.ticked > STALL_SECONDS:
                continue  # the loop hangs: let another worker have its streams
            for held in (*list(self._openings.values()), *list(self._held.values())):
                try:
                    held.frames.renew(held.lease)
                except LeaseLost:
                    self._lose(held)
                except Unreachable as error:
                    log.warning("not_renewed", stream=str(held.row.id), error=error.message)

    def _lose(self, held: Opening | Held) -> None:
        held.lost = True
        if isinstance(held, Held):
            self._held.pop(str(held.row.id), None)
            self._loop.leave(held)
        else:
            self._openings.pop(str(held.row.id), None)
        metrics.LIVE_LOST.inc()
        log.info("stream_lost", stream=str(held.row.id), fence=held.lease.fence)

    # --- taking ---

    def _answer(self) -> None:
        if self._bell.rang():
            self._take()

    def _is_full(self) -> bool:
        return len(self._openings) + len(self._held) >= self._room.capacity

    def _take(self) -> None:
        if self._is_full():
            return
        with transaction(self._engine) as conn:
            waiting = open_streams(conn, self._room.bundle)
        # Those that were live somewhere come first: somebody watches them.
        for row in sorted(waiting, key=lambda row: row.state is StreamState.WAITING):
            if self._is_full():
                return
            if str(row.id) not in self._held and str(row.id) not in self._openings:
                self._try(row)

    def _try(self, row: StreamRow) -> None:
        frames = FrameStream(self._redis, str(row.id))
        lease = frames.acquire(above=row.fence)
        if lease is None:
            return
        taken = False
        try:
            with transaction(self._engine) as conn:
                past = take_stream(conn, row.id, lease.fence, self._worker.id)
            if past is not None:
                self._begin(past, frames, lease)
                taken = True
        finally:
            if not taken:
                frames.release(lease)

    def _begin(self, past: StreamPast, frames: FrameStream, lease: Lease) -> None:
        prompts = [past.row.prompt, *(text for _, text in past.prompts[-1:])]
        opening = Opening(past, frames, lease, Reading(self._parse, list(dict.fromkeys(prompts))))
        self._openings[str(past.row.id)] = opening
        if opening.reading.is_done(READ_SECONDS):
            self._join(opening)

    def _open(self) -> None:
        for opening in list(self._openings.values()):
            if opening.reading.is_done():
                self._join(opening)

    def _join(self, opening: Opening) -> None:
        """Its prompts are read: it goes on."""
        past, row, frames, lease = opening.past, opening.row, opening.frames, opening.lease
        self._openings.pop(str(row.id), None)
        if opening.lost:
            return
        try:
            features = opening.reading.features()
        except MareyError as error:
            self._end(row, lease, "its prompt cannot be read", error)
            frames.release(lease)
            return
        tokens = np.frombuffer(past.tokens, "<i2").reshape(-1, self._room.levels)
        held = Held(
            row=row,
            frames=frames,
            controls=ControlQueue(self._redis, str(row.id)),
            watch=Watch(self._redis, str(row.id)),
            lease=lease,
            text=features[-1],
            opening=features[0],
            tokens=list(tokens),
            prompts=opening.prompts,
            seen=time.monotonic(),
            moved=time.monotonic(),
            read=row.control,
            obeyed=row.control,
            shown=len(tokens),
            recorded=len(tokens),
            recorded_prompts=len(past.prompts),
            acts=list(past.acts),
            reads=[] if past.prompts else [ReadAs(features[0].rewritten, features[0].not_rewritten)],
        )
        self._held[str(row.id)] = held
        self._loop.join(held)
        log.info("stream_taken", stream=str(row.id), fence=lease.fence, frames=len(tokens), shown=lease.next_frame)

    # --- messages ---

    def _listen(self) -> None:
        for held in list(self._held.values()):
            for identity, message in held.controls.read(held.read):
                held.read = identity
                if isinstance(message, InvalidInput):
                    log.warning("message_refused", stream=str(held.row.id), error=message.message)
                elif message.kind == "stop":
                    self._loop.end(held, "stopped")
                else:
                    held.heard.append((identity, message))
            while held.heard and self._obey(held, *held.heard[0]):
                held.heard.popleft()

    def _obey(self, held: Held, identity: str, message: Control) -> bool:
        """Pass a message on to the loop; False while its prompt is being read, and all behind it wait."""
        if message.prompt is None:
            state = StreamState.PAUSED if message.kind == "pause" else StreamState.LIVE
            self._loop.switch(held, state, identity)
            return True
        if held.reading is None:
            held.reading = Reading(self._parse, [message.prompt])
            held.reading.is_done(READ_SECONDS)
        if not held.reading.is_done():
            return False
        reading, held.reading = held.reading, None
        try:
            (text,) = reading.features()
        except MareyError as error:
            log.warning("prompt_refused", stream=str(held.row.id), error=error.message)
        else:
            self._loop.steer(held, message.prompt, text, identity)
        return True

    # --- writing down ---

    def _record(self) -> None:
        measure_gpu()
        with transaction(self._engine) as conn:
            beat(conn, self._worker)
        now = time.monotonic()
        for held in list(self._held.values()):
            reason = self._idles(held, now)
            if reason and held.ending is None:
                self._loop.end(held, reason)
            self._write(held)

    def _idles(self, held: Held, now: float) -> str:
        """Why a stream should give its slot to another; empty where it should not."""
        if held.watch.seen():
            held.seen = now
        if held.state is not StreamState.PAUSED:
            held.moved = now
        if now - held.seen > self._idle_seconds:
            return f"nobody watched for {self._idle_seconds:g} seconds"
        if now - held.moved > self._paused_seconds:
            return f"paused for {self._paused_seconds:g} seconds"
        return ""

    def _write(self, held: Held) -> None:
        chunk = held.chunk()
        if chunk is None:
            return
        with transaction(self._engine) as conn:
            ours = add_chunk(conn, held.row.id, held.lease.fence, chunk)
        if ours:
            held.wrote(chunk)
        else:
            self._lose(held)

    # --- the end ---

    def _close(self, over: Over) -> None:
        held = over.held
        self._held.pop(str(held.row.id), None)
        if held.lost:
            return
        patiently(lambda: self._write_last(over), seconds=CLOSE_PATIENCE, stopping=self._stopping)
        held.frames.release(held.lease)

    def _write_last(self, over: Over) -> None:
        held = over.held
        chunk = held.chunk()
        if chunk is not None:
            with transaction(self._engine) as conn:
                if not add_chunk(conn, held.row.id, held.lease.fence, chunk):
                    return
            held.wrote(chunk)
        clip = clip_of(held, self._room)
        self._end(held.row, held.lease, over.reason, over.problem, clip)

    def _end(
        self,
        row: StreamRow,
        lease: Lease,
        reason: str,
        error: MareyError | None,
        clip: tuple[NewItem, bytes] | None = None,
    ) -> None:
        problem = None if error is None else Problem.of(as_problem(error))
        with transaction(self._engine) as conn:
            end_stream(conn, row.id, lease.fence, reason, problem=problem, clip=clip)
        log.info("stream_ended", stream=str(row.id), reason=reason, failed=problem is not None, clip=clip is not None)

    def _give_back(self) -> None:
        """This worker stops: another goes on at once, behind the last frame that was shown."""
        self._loop.finished.wait(STALL_SECONDS)
        for opening in list(self._openings.values()):
            self._guarded(lambda opening=opening: _released(opening))
        for held in list(self._held.values()):
            self._guarded(lambda held=held: self._write(held))
            self._guarded(lambda held=held: _released(held))
        self._guarded(self._retire)

    def _retire(self) -> None:
        with transaction(self._engine) as conn:
            retire(conn, self._worker.id)


class _Round:
    """Something to do every so often."""

    def __init__(self, action: Callable[[], None], seconds: float) -> None:
        self.action = action
        self._seconds = seconds
        self._due = 0.0

    def due(self) -> bool:
        """Whether it is time; then the next time is set."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


def clip_of(held: Held, room: Room) -> tuple[NewItem, bytes] | None:
    """The item that makes the clip of a stream, and its recording; None for one that is too short."""
    row = held.row
    if held.recorded < max(1, room.min_frames):
        return None
    tokens = np.stack(held.tokens[: held.recorded])
    prompts = [(frame, text) for frame, text in held.prompts if frame < held.recorded]
    blob = Recording(str(row.id), tokens, prompts, held.opening).to_blob()
    key = f"stream-{row.id}"
    item = NewItem(
        index=0,
        prompt=row.prompt,
        name=row.name,
        model=row.model,
        bundle=row.bundle,
        batch_key=hashlib.sha256(f"{row.bundle}\nrecording".encode()).hexdigest(),
        text_key=key,
        text_batch_key=key,
        seed=row.seed,
    )
    return item, blob


def _released(held: Opening | Held) -> None:
    held.frames.release(held.lease)
