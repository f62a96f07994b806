"""The thread beside the loop: takes streams, renews leases, reads messages, records tokens, closes streams."""

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
from marey.items.constraints import POSE_KEYFRAME
from marey.jobs import FailureReason, NewItem, WorkerHeartbeat, beat, retire
from marey.runtime.faults import as_problem, retry_unreachable
from marey.runtime.live.leased_stream import LeasedStream
from marey.runtime.live.loop import LiveLoop, StreamFinished
from marey.runtime.live.parsing import PromptParsing, StartingStream
from marey.runtime.live.port import Parse, SessionPool
from marey.runtime.logs import logger
from marey.runtime.metrics_endpoint import measure_gpu
from marey.streams import StreamPast, StreamRow, StreamState, add_chunk, end_stream, open_streams, take_stream
from marey.streams.control import ControlQueue, StreamControl
from marey.streams.notifier import StreamNotifier
from marey.streams.presence import ViewerPresence
from marey.streams.recording import StreamRecording
from marey.streams.redis import RENEW_SECONDS, FrameStream, Lease, LeaseLost
from marey.streams.rewrites import PromptRewrite

log = logger(__name__)

LISTEN_SECONDS = 0.05
TAKE_SECONDS = 0.5
RECORD_SECONDS = 1.0
READ_SECONDS = 0.1
"""Seconds to wait for a prompt at once, since most are parsed in milliseconds; later it is polled every
`LISTEN_SECONDS`."""
CLOSE_PATIENCE = 120.0
STALL_SECONDS = 10.0


class StreamSupervisor(threading.Thread):
    """Manages the streams of one live loop.

    Args:
        engine, client: Postgres and Redis.
        worker: this worker's row, renewed every second.
        parse: parses prompts, on several threads.
        idle_seconds: time without a viewer until a stream ends; `paused_seconds`: time of pause until it ends.
    """

    def __init__(
        self,
        engine: sa.Engine,
        client: redis.Redis,
        worker: WorkerHeartbeat,
        parse: Parse,
        *,
        idle_seconds: float,
        paused_seconds: float,
        stopping: threading.Event,
    ) -> None:
        super().__init__(name="supervisor", daemon=True)
        self._engine, self._redis = engine, client
        self._worker, self._parse = worker, parse
        self._idle_seconds, self._paused_seconds = idle_seconds, paused_seconds
        self._stopping = stopping
        self._over: queue.SimpleQueue[StreamFinished] = queue.SimpleQueue()
        self._notifier = StreamNotifier(client)
        self._starting: dict[str, StartingStream] = {}
        self._leased: dict[str, LeasedStream] = {}
        self._rounds = (
            _Round(self._open, LISTEN_SECONDS),
            _Round(self._listen, LISTEN_SECONDS),
            _Round(self._answer, LISTEN_SECONDS),
            _Round(self._take, TAKE_SECONDS),
            _Round(self._record, RECORD_SECONDS),
        )
        self.renewer = threading.Thread(target=self._renew_all, name="renewer", daemon=True)

    def serve(self, loop: LiveLoop) -> None:
        """Start the threads for this loop."""
        self._loop = loop
        self._pool: SessionPool = loop.pool
        self.renewer.start()
        self.start()

    def over(self, what: StreamFinished) -> None:
        """Queue a finished stream for closing."""
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
            log.exception("keeper_failed")  # without this thread nothing would be recorded

    # --- leases ---

    def _renew_all(self) -> None:
        """Renew leases, on a thread of its own: a database that hangs must not cost a lease."""
        while not self._stopping.wait(RENEW_SECONDS):
            if time.monotonic() - self._loop.ticked > STALL_SECONDS:
                continue  # the loop hangs: let another worker take its streams
            for leased in (*list(self._starting.values()), *list(self._leased.values())):
                try:
                    leased.frames.renew(leased.lease)
                except LeaseLost:
                    self._lose(leased)
                except Unreachable as error:
                    log.warning("not_renewed", stream=str(leased.row.id), error=error.message)

    def _lose(self, leased: StartingStream | LeasedStream) -> None:
        leased.lost = True
        if isinstance(leased, LeasedStream):
            self._leased.pop(str(leased.row.id), None)
            self._loop.drop(leased)
        else:
            self._starting.pop(str(leased.row.id), None)
        metrics.LIVE_LOST.inc()
        log.info("stream_lost", stream=str(leased.row.id), fence=leased.lease.fence)

    # --- taking ---

    def _answer(self) -> None:
        if self._notifier.poll():
            self._take()

    def _is_full(self) -> bool:
        return len(self._starting) + len(self._leased) >= self._pool.capacity

    def _take(self) -> None:
        if self._is_full():
            return
        with transaction(self._engine) as conn:
            waiting = open_streams(conn, self._pool.bundle)
        # Interrupted live streams come first: they have viewers.
        for row in sorted(waiting, key=lambda row: row.state is StreamState.WAITING):
            if self._is_full():
                return
            if str(row.id) not in self._leased and str(row.id) not in self._starting:
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
        starting = StartingStream(past, frames, lease, PromptParsing(self._parse, list(dict.fromkeys(prompts))))
        self._starting[str(past.row.id)] = starting
        if starting.parsing.is_done(READ_SECONDS):
            self._join(starting)

    def _open(self) -> None:
        for starting in list(self._starting.values()):
            if starting.parsing.is_done():
                self._join(starting)

    def _join(self, starting: StartingStream) -> None:
        """Pass a stream on to the loop once its prompts are parsed."""
        past, row, frames, lease = starting.past, starting.row, starting.frames, starting.lease
        self._starting.pop(str(row.id), None)
        if starting.lost:
            return
        try:
            features = starting.parsing.features()
        except MareyError as error:
            self._end(row, lease, "its prompt cannot be parsed", error)
            frames.release(lease)
            return
        tokens = np.frombuffer(past.tokens, "<i2").reshape(-1, self._pool.levels)
        leased = LeasedStream(
            row=row,
            frames=frames,
            controls=ControlQueue(self._redis, str(row.id)),
            presence=ViewerPresence(self._redis, str(row.id)),
            lease=lease,
            text=features[-1],
            first_text=features[0],
            tokens=list(tokens),
            prompts=starting.prompts,
            seen=time.monotonic(),
            moved=time.monotonic(),
            read=row.control,
            applied=row.control,
            shown=len(tokens),
            recorded=len(tokens),
            recorded_prompts=len(past.prompts),
            actions=list(past.actions),
            reads=[] if past.prompts else [PromptRewrite(features[0].rewritten, features[0].not_rewritten)],
        )
        self._leased[str(row.id)] = leased
        self._loop.join(leased)
        log.info("stream_taken", stream=str(row.id), fence=lease.fence, frames=len(tokens), shown=lease.next_frame)

    # --- messages ---

    def _listen(self) -> None:
        for leased in list(self._leased.values()):
            for identity, message in leased.controls.read(leased.read):
                leased.read = identity
                if isinstance(message, InvalidInput):
                    log.warning("message_refused", stream=str(leased.row.id), error=message.message)
                elif message.kind == "stop":
                    self._loop.end(leased, "stopped" if message.pose is None else "stopped on a pose", message.pose)
                else:
                    leased.received.append((identity, message))
            while leased.received and self._apply(leased, *leased.received[0]):
                leased.received.popleft()

    def _apply(self, leased: LeasedStream, identity: str, message: StreamControl) -> bool:
        """Pass a message on to the loop; return False while its prompt is being parsed, and later messages wait."""
        if message.prompt is None:
            state = StreamState.PAUSED if message.kind == "pause" else StreamState.LIVE
            self._loop.switch(leased, state, identity)
            return True
        if leased.parsing is None:
            leased.parsing = PromptParsing(self._parse, [message.prompt])
            leased.parsing.is_done(READ_SECONDS)
        if not leased.parsing.is_done():
            return False
        parsing, leased.parsing = leased.parsing, None
        try:
            (text,) = parsing.features()
        except MareyError as error:
            log.warning("prompt_refused", stream=str(leased.row.id), error=error.message)
        else:
            self._loop.steer(leased, message.prompt, text, identity)
        return True

    # --- recording ---

    def _record(self) -> None:
        measure_gpu()
        with transaction(self._engine) as conn:
            beat(conn, self._worker)
        now = time.monotonic()
        for leased in list(self._leased.values()):
            reason = self._idles(leased, now)
            if reason and leased.ending is None:
                self._loop.end(leased, reason)
            self._write(leased)

    def _idles(self, leased: LeasedStream, now: float) -> str:
        """Return the reason why a stream should release its slot; empty if it should not."""
        if leased.presence.is_active():
            leased.seen = now
        if leased.state is not StreamState.PAUSED:
            leased.moved = now
        if now - leased.seen > self._idle_seconds:
            return f"no viewer for {self._idle_seconds:g} seconds"
        if now - leased.moved > self._paused_seconds:
            return f"paused for {self._paused_seconds:g} seconds"
        return ""

    def _write(self, leased: LeasedStream) -> None:
        chunk = leased.chunk()
        if chunk is None:
            return
        with transaction(self._engine) as conn:
            ours = add_chunk(conn, leased.row.id, leased.lease.fence, chunk)
        if ours:
            leased.wrote(chunk)
        else:
            self._lose(leased)

    # --- closing ---

    def _close(self, over: StreamFinished) -> None:
        leased = over.leased
        self._leased.pop(str(leased.row.id), None)
        if leased.lost:
            return
        retry_unreachable(lambda: self._write_last(over), seconds=CLOSE_PATIENCE, stopping=self._stopping)
        leased.frames.release(leased.lease)

    def _write_last(self, over: StreamFinished) -> None:
        leased = over.leased
        chunk = leased.chunk()
        if chunk is not None:
            with transaction(self._engine) as conn:
                if not add_chunk(conn, leased.row.id, leased.lease.fence, chunk):
                    return
            leased.wrote(chunk)
        clip = clip_of(leased, self._pool)
        self._end(leased.row, leased.lease, over.reason, over.problem, clip)

    def _end(
        self,
        row: StreamRow,
        lease: Lease,
        reason: str,
        error: MareyError | None,
        clip: tuple[NewItem, bytes] | None = None,
    ) -> None:
        problem = None if error is None else FailureReason.of(as_problem(error))
        with transaction(self._engine) as conn:
            end_stream(conn, row.id, lease.fence, reason, problem=problem, clip=clip)
        log.info("stream_ended", stream=str(row.id), reason=reason, failed=problem is not None, clip=clip is not None)

    def _give_back(self) -> None:
        """Release all streams when this worker stops: another one resumes at once, behind the last shown frame."""
        self._loop.finished.wait(STALL_SECONDS)
        for starting in list(self._starting.values()):
            self._guarded(lambda starting=starting: _released(starting))
        for leased in list(self._leased.values()):
            self._guarded(lambda leased=leased: self._write(leased))
            self._guarded(lambda leased=leased: _released(leased))
        self._guarded(self._retire)

    def _retire(self) -> None:
        with transaction(self._engine) as conn:
            retire(conn, self._worker.id)


class _Round:
    """A periodic action."""

    def __init__(self, action: Callable[[], None], seconds: float) -> None:
        self.action = action
        self._seconds = seconds
        self._due = 0.0

    def due(self) -> bool:
        """Return True if the action is due, and schedule the next time."""
        now = time.monotonic()
        if now < self._due:
            return False
        self._due = now + self._seconds
        return True


def clip_of(leased: LeasedStream, pool: SessionPool) -> tuple[NewItem, bytes] | None:
    """Return the item that makes the clip of a stream, and its recording; None for a stream that is too short."""
    row = leased.row
    if leased.recorded < max(1, pool.min_frames):
        return None
    tokens = np.stack(leased.tokens[: leased.recorded])
    prompts = [(frame, text) for frame, text in leased.prompts if frame < leased.recorded]
    blob = StreamRecording(str(row.id), tokens, prompts, leased.first_text).to_blob()
    key = f"stream-{row.id}"
    reached = leased.passing is not None and leased.recorded == leased.passing.last + 1
    item = NewItem(
        index=0,
        prompt=row.prompt,
        name=row.name,
        constraints=[{"type": POSE_KEYFRAME, "frame": leased.recorded - 1, **leased.pose}]
        if reached and leased.pose is not None
        else None,
        model=row.model,
        bundle=row.bundle,
        batch_key=hashlib.sha256(f"{row.bundle}\nrecording".encode()).hexdigest(),
        text_key=key,
        text_batch_key=key,
        seed=row.seed,
    )
    return item, blob


def _released(leased: StartingStream | LeasedStream) -> None:
    leased.frames.release(leased.lease)
