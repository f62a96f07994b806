"""The thread that makes frames: one step of the session pool per tick, frames to Redis, messages applied in between."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from marey.core import metrics
from marey.core.errors import MareyError, Unreachable
from marey.motion.live_ending import LiveEnding
from marey.runtime.faults import as_problem
from marey.runtime.live.leased_stream import LeasedStream
from marey.runtime.live.port import LiveFrame, SessionPool
from marey.runtime.logs import logger
from marey.streams import StreamState
from marey.streams.frames import Frame, encode_frame
from marey.streams.redis import LeaseLost
from marey.text.features import TextFeatures

log = logger(__name__)

CATCH_UP = 4
"""Extra frames per tick for a session that replays frames of another worker."""
BEHIND_SECONDS = 0.5
"""Beyond this delay missed frames are not caught up: the clock is reset."""
ENDING_SECONDS = 1.0
"""Seconds in which a stream passes into the pose that it ends on."""
MOST_UNWRITTEN = 1200
"""Frames buffered while Redis does not answer: as many as Redis keeps."""


@dataclass(frozen=True)
class StreamFinished:
    """A stream that the loop has ended, for the supervisor to close; `problem`: it failed."""

    leased: LeasedStream
    reason: str
    problem: MareyError | None = None


class LiveLoop:
    """Makes the frames of all streams of this worker, on the thread that calls `run`.

    All other methods queue a call, which runs on that thread between two frames.

    Args:
        open_pool: returns an empty pool.
        over: called with each stream that has ended, failed or lost its lease.
        clock: seconds, monotonic.
    """

    def __init__(
        self,
        open_pool: Callable[[], SessionPool],
        over: Callable[[StreamFinished], None],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._open_pool = open_pool
        self._over = over
        self._clock = clock
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._leased: dict[int, LeasedStream] = {}
        self.pool = open_pool()
        self.ticked = clock()
        self._away: Unreachable | None = None
        """Redis outage in this tick: the other streams do not wait for it again."""
        self.finished = threading.Event()
        """Set when `run` has returned: no more frames will be shown."""

    def run(self, stopping: threading.Event) -> None:
        """Make frames until `stopping`."""
        due = self._clock()
        try:
            while not stopping.wait(max(0.0, due - self._clock())):
                self.tick()
                due += 1.0 / self.pool.fps
                if self._clock() - due > BEHIND_SECONDS:
                    due = self._clock()
                    metrics.LIVE_LATE.inc()
        finally:
            self.finished.set()

    def tick(self) -> None:
        """Apply queued calls, then make one frame of every playing stream."""
        self.ticked = self._clock()
        self._away = None
        while not self._calls.empty():
            self._calls.get()()
        for leased in list(self._leased.values()):
            while leased.delayed and not leased.behind:
                self._guarded(leased, leased.delayed.pop(0))
        metrics.LIVE_STREAMS.set(len(self._leased))
        try:
            began, shown = time.perf_counter(), len(self._leased)
            self._frames(self._step())
            if shown:
                metrics.LIVE_TICK_SECONDS.observe(time.perf_counter() - began)
        except Exception as error:
            log.exception("room_broke", streams=len(self._leased))
            self._rebuild(error)

    # --- called from other threads ---

    def join(self, leased: LeasedStream) -> None:
        """Start a stream."""
        self._calls.put(lambda: self._guarded(leased, lambda: self._join(leased)))

    def steer(self, leased: LeasedStream, prompt: str, text: TextFeatures, control: str) -> None:
        """Set another prompt."""
        self._calls.put(
            lambda: self._guarded(
                leased, lambda: self._in_turn(leased, lambda: self._steer(leased, prompt, text, control))
            )
        )

    def switch(self, leased: LeasedStream, state: StreamState, control: str) -> None:
        """Pause or resume a stream."""
        self._calls.put(
            lambda: self._guarded(leased, lambda: self._in_turn(leased, lambda: self._switch(leased, state, control)))
        )

    def end(self, leased: LeasedStream, reason: str, pose: Mapping[str, Any] | None = None) -> None:
        """Show one more frame, the last, and end; with a pose, show the frames on the way to it first."""
        if pose is None:
            self._calls.put(lambda: self._guarded(leased, lambda: self._end(leased, reason)))
        else:
            self._calls.put(
                lambda: self._guarded(leased, lambda: self._in_turn(leased, lambda: self._pass(leased, reason, pose)))
            )

    def drop(self, leased: LeasedStream) -> None:
        """Drop a stream whose lease is lost."""
        self._calls.put(lambda: self._forget(leased))

    # --- on the loop's thread ---

    def _guarded(self, leased: LeasedStream, action: Callable[[], None]) -> None:
        """Run an action; an error ends this stream alone."""
        if leased.lost or (leased.session is None and leased.ending is not None):
            return
        try:
            action()
        except Exception as error:
            problem = as_problem(error)
            if problem is not error:
                log.exception("stream_failed", stream=str(leased.row.id))
            self._close(leased, "the stream failed", problem)

    def _in_turn(self, leased: LeasedStream, message: Callable[[], None]) -> None:
        """Apply a message after replayed frames: frames that another worker showed under one prompt are not recorded
        under another."""
        if leased.behind or leased.delayed:
            leased.delayed.append(message)
        else:
            message()

    def _join(self, leased: LeasedStream) -> None:
        leased.session = _entered(self.pool, leased)
        self._leased[leased.session] = leased
        if leased.state is StreamState.PAUSED:
            self.pool.pause(leased.session)

    def _steer(self, leased: LeasedStream, prompt: str, text: TextFeatures, control: str) -> None:
        session = _session(leased)
        paused = leased.state is StreamState.PAUSED
        if paused:
            self.pool.resume(session)
        self.pool.steer(session, text)
        leased.steered(prompt, text, control)
        if paused:
            self.pool.pause(session)

    def _switch(self, leased: LeasedStream, state: StreamState, control: str) -> None:
        if state is not leased.state:
            session = _session(leased)
            if state is StreamState.PAUSED:
                self.pool.pause(session)
            else:
                self.pool.resume(session)
        with leased.lock:
            leased.state, leased.applied = state, control

    def _end(self, leased: LeasedStream, reason: str) -> None:
        leased.ending, leased.passing = reason, None
        if leased.state is StreamState.PAUSED:  # it shows no more frames
            self._close(leased, reason)

    def _pass(self, leased: LeasedStream, reason: str, pose: Mapping[str, Any]) -> None:
        """Begin to pass into a pose; a second pose has no effect."""
        if leased.ending is not None:
            return
        if leased.state is StreamState.PAUSED:
            self.pool.resume(_session(leased))
            leased.state = StreamState.LIVE
        turns = np.asarray(pose["joint_rotations"], np.float64)
        frames = max(round(ENDING_SECONDS * self.pool.fps), 1)
        leased.passing = LiveEnding(self.pool.skeleton, turns, pose.get("root_height"), len(leased.tokens), frames)
        leased.ending, leased.pose = reason, pose

    def _step(self) -> dict[int, list[LiveFrame]]:
        made = {session: [frame] for session, frame in self.pool.step().items()}
        for session, leased in self._leased.items():
            behind = leased.lease.next_frame - len(leased.tokens) - 1
            if session in made and behind > 0:
                made[session] += self.pool.catch_up(session, min(CATCH_UP, behind))
        return made

    def _frames(self, made: dict[int, list[LiveFrame]]) -> None:
        for session, frames in made.items():
            leased = self._leased[session]
            for frame in frames:
                leased.add(frame)
                if frame.frame.number >= leased.lease.next_frame:
                    leased.unwritten.append(_passed(leased, frame.frame))
            if leased.ending is None and len(leased.tokens) >= leased.row.max_frames:
                leased.ending = "its maximum length is reached"
            if leased.is_over and leased.unwritten:
                leased.unwritten[-1] = replace(leased.unwritten[-1], last=True)
            self._write(leased)
            if leased.session is not None and leased.is_over and (leased.shown == len(leased.tokens)):
                self._close(leased, str(leased.ending))

    def _write(self, leased: LeasedStream) -> None:
        try:
            if self._away is None:
                leased.frames.write(leased.lease, leased.unwritten)
        except Unreachable as error:
            self._away = error
        except LeaseLost:
            log.info("stream_lost", stream=str(leased.row.id), fence=leased.lease.fence)
            leased.lost = True
            metrics.LIVE_LOST.inc()
            self._close(leased, "another worker has it")
            return
        if self._away is not None:
            if len(leased.unwritten) > MOST_UNWRITTEN:
                self._close(leased, "Redis did not answer", self._away)
            return
        metrics.LIVE_FRAMES.inc(len(leased.unwritten))
        leased.unwritten.clear()
        leased.shown = len(leased.tokens)

    def _close(self, leased: LeasedStream, reason: str, problem: MareyError | None = None) -> None:
        self._forget(leased)
        leased.ending = leased.ending or reason
        self._over(StreamFinished(leased, reason, problem))

    def _forget(self, leased: LeasedStream) -> None:
        session, leased.session = leased.session, None
        if session is not None:
            del self._leased[session]
            self.pool.stop(session)

    def _rebuild(self, error: Exception) -> None:
        """Replace a failed session pool. Each stream is tried in an empty pool: the one that breaks it fails, the
        others continue.

        Raises: the error, if no stream caused it.
        """
        streams, self._leased = list(self._leased.values()), {}
        for leased in streams:
            leased.session = None
        pool, sound = self._open_pool(), list[LeasedStream]()
        for leased in streams:
            if self._sound(leased, pool):
                sound.append(leased)
            else:
                pool = self._open_pool()
        if len(sound) == len(streams):
            raise error
        self.pool = pool
        for leased in sound:
            self._join(leased)

    def _sound(self, leased: LeasedStream, pool: SessionPool) -> bool:
        """Return True if a stream can make its next frame in an empty pool, which is empty again afterwards."""
        try:
            session = _entered(pool, leased)
            encode_frame(pool.catch_up(session, 1)[0].frame)
            pool.stop(session)
        except Exception as error:
            self._close(leased, "the stream failed", as_problem(error))
            return False
        return True


def _entered(pool: SessionPool, leased: LeasedStream) -> int:
    """Start or resume the stream's session in a pool; return it."""
    prompt = len(leased.prompts) - 1
    return pool.start(leased.text, leased.row.seed, past=leased.past, prompt=prompt, began=leased.playing)


def _passed(leased: LeasedStream, frame: Frame) -> Frame:
    """Return a frame on its way to the pose that the stream ends on; the frame itself if it ends on none."""
    if leased.passing is None:
        return frame
    rotations, root = leased.passing.passed(frame.number, frame.rotations, frame.root)
    return replace(frame, rotations=rotations.astype(np.float32), root=root.astype(np.float32))


def _session(leased: LeasedStream) -> int:
    assert leased.session is not None
    return leased.session
