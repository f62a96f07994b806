"""The thread that makes frames: a step of the room each tick, its frames to Redis, messages obeyed in between."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

from marey.core import metrics
from marey.core.errors import MareyError, Unreachable
from marey.runtime.faults import as_problem
from marey.runtime.live.held import Held
from marey.runtime.live.port import LiveFrame, Room
from marey.runtime.logs import logger
from marey.streams import StreamState
from marey.streams.frames import encode_frame
from marey.streams.redis import LeaseLost
from marey.text.features import TextFeatures

log = logger(__name__)

CATCH_UP = 4
"""Frames a tick that a session makes beside the others' one, until it is where another worker left it."""
BEHIND_SECONDS = 0.5
"""Later than this, frames that were missed are not made faster: the clock is set anew."""
MOST_UNWRITTEN = 1200
"""Frames kept for a Redis that does not answer: as many as it would keep itself."""


@dataclass(frozen=True)
class Over:
    """A stream that the loop is through with, for the keeper to close; `problem`: it failed."""

    held: Held
    reason: str
    problem: MareyError | None = None


class LiveLoop:
    """Makes the frames of all streams of this worker, on the thread that calls `run`.

    Everything else is asked of it by `put`: a call is made between two frames, on its thread.

    Args:
        open_room: makes an empty room.
        over: told of each stream that has ended, failed or went to another worker.
        clock: seconds, monotonic.
    """

    def __init__(
        self,
        open_room: Callable[[], Room],
        over: Callable[[Over], None],
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._open_room = open_room
        self._over = over
        self._clock = clock
        self._calls: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()
        self._held: dict[int, Held] = {}
        self.room = open_room()
        self.ticked = clock()
        self._away: Unreachable | None = None
        """Why Redis did not take the frames of this tick: the other streams do not wait for it again."""
        self.finished = threading.Event()
        """Set when `run` has returned: nobody will show a frame any more."""

    def run(self, stopping: threading.Event) -> None:
        """Make frames until `stopping`."""
        due = self._clock()
        try:
            while not stopping.wait(max(0.0, due - self._clock())):
                self.tick()
                due += 1.0 / self.room.fps
                if self._clock() - due > BEHIND_SECONDS:
                    due = self._clock()
                    metrics.LIVE_LATE.inc()
        finally:
            self.finished.set()

    def tick(self) -> None:
        """Obey what was asked, then make one frame of every stream that plays."""
        self.ticked = self._clock()
        self._away = None
        while not self._calls.empty():
            self._calls.get()()
        for held in list(self._held.values()):
            while held.delayed and not held.behind:
                self._guarded(held, held.delayed.pop(0))
        metrics.LIVE_STREAMS.set(len(self._held))
        try:
            began, shown = time.perf_counter(), len(self._held)
            self._frames(self._step())
            if shown:
                metrics.LIVE_TICK_SECONDS.observe(time.perf_counter() - began)
        except Exception as error:
            log.exception("room_broke", streams=len(self._held))
            self._rebuild(error)

    # --- what is asked of it, from other threads ---

    def join(self, held: Held) -> None:
        """A stream to show."""
        self._calls.put(lambda: self._guarded(held, lambda: self._join(held)))

    def steer(self, held: Held, prompt: str, text: TextFeatures, control: str) -> None:
        """Another prompt."""
        self._calls.put(
            lambda: self._guarded(held, lambda: self._in_turn(held, lambda: self._steer(held, prompt, text, control)))
        )

    def switch(self, held: Held, state: StreamState, control: str) -> None:
        """Pause, or go on."""
        self._calls.put(
            lambda: self._guarded(held, lambda: self._in_turn(held, lambda: self._switch(held, state, control)))
        )

    def end(self, held: Held, reason: str) -> None:
        """Show one more frame, the last, and end."""
        self._calls.put(lambda: self._guarded(held, lambda: self._end(held, reason)))

    def leave(self, held: Held) -> None:
        """Forget a stream that is no longer ours."""
        self._calls.put(lambda: self._forget(held))

    # --- on its own thread ---

    def _guarded(self, held: Held, action: Callable[[], None]) -> None:
        """An error of one stream ends that stream alone."""
        if held.lost or (held.session is None and held.ending is not None):
            return
        try:
            action()
        except Exception as error:
            problem = as_problem(error)
            if problem is not error:
                log.exception("stream_failed", stream=str(held.row.id))
            self._close(held, "it could not go on", problem)

    def _in_turn(self, held: Held, message: Callable[[], None]) -> None:
        """Obey behind the frames that were shown already: what another worker showed under one prompt is not put on
        record under another."""
        if held.behind or held.delayed:
            held.delayed.append(message)
        else:
            message()

    def _join(self, held: Held) -> None:
        held.session = _entered(self.room, held)
        self._held[held.session] = held
        if held.state is StreamState.PAUSED:
            self.room.pause(held.session)

    def _steer(self, held: Held, prompt: str, text: TextFeatures, control: str) -> None:
        session = _session(held)
        paused = held.state is StreamState.PAUSED
        if paused:
            self.room.resume(session)
        self.room.steer(session, text)
        held.steered(prompt, text, control)
        if paused:
            self.room.pause(session)

    def _switch(self, held: Held, state: StreamState, control: str) -> None:
        if state is not held.state:
            session = _session(held)
            if state is StreamState.PAUSED:
                self.room.pause(session)
            else:
                self.room.resume(session)
        with held.lock:
            held.state, held.obeyed = state, control

    def _end(self, held: Held, reason: str) -> None:
        held.ending = reason
        if held.state is StreamState.PAUSED:  # it shows nothing more
            self._close(held, reason)

    def _step(self) -> dict[int, list[LiveFrame]]:
        made = {session: [frame] for session, frame in self.room.step().items()}
        for session, held in self._held.items():
            behind = held.lease.next_frame - len(held.tokens) - 1
            if session in made and behind > 0:
                made[session] += self.room.catch_up(session, min(CATCH_UP, behind))
        return made

    def _frames(self, made: dict[int, list[LiveFrame]]) -> None:
        for session, frames in made.items():
            held = self._held[session]
            for frame in frames:
                held.add(frame)
                if frame.frame.number >= held.lease.next_frame:
                    held.unwritten.append(frame.frame)
            if held.ending is None and len(held.tokens) >= held.row.max_frames:
                held.ending = "its time is over"
            if held.ending is not None and held.unwritten:
                held.unwritten[-1] = replace(held.unwritten[-1], last=True)
            self._write(held)
            if held.session is not None and held.ending is not None and (held.shown == len(held.tokens)):
                self._close(held, held.ending)

    def _write(self, held: Held) -> None:
        try:
            if self._away is None:
                held.frames.write(held.lease, held.unwritten)
        except Unreachable as error:
            self._away = error
        except LeaseLost:
            log.info("stream_lost", stream=str(held.row.id), fence=held.lease.fence)
            held.lost = True
            metrics.LIVE_LOST.inc()
            self._close(held, "another worker has it")
            return
        if self._away is not None:
            if len(held.unwritten) > MOST_UNWRITTEN:
                self._close(held, "Redis did not answer", self._away)
            return
        metrics.LIVE_FRAMES.inc(len(held.unwritten))
        held.unwritten.clear()
        held.shown = len(held.tokens)

    def _close(self, held: Held, reason: str, problem: MareyError | None = None) -> None:
        self._forget(held)
        held.ending = held.ending or reason
        self._over(Over(held, reason, problem))

    def _forget(self, held: Held) -> None:
        session, held.session = held.session, None
        if session is not None:
            del self._held[session]
            self.room.stop(session)

    def _rebuild(self, error: Exception) -> None:
        """A room that broke is left with all that is in it. Which stream broke it shows in a room of its own; that one
        has failed, the others go on.

        Raises: the error, where no stream did it.
        """
        streams, self._held = list(self._held.values()), {}
        for held in streams:
            held.session = None
        room, sound = self._open_room(), list[Held]()
        for held in streams:
            if self._sound(held, room):
                sound.append(held)
            else:
                room = self._open_room()
        if len(sound) == len(streams):
            raise error
        self.room = room
        for held in sound:
            self._join(held)

    def _sound(self, held: Held, room: Room) -> bool:
        """Whether a stream can make its next frame in an empty room, which is empty again where it can."""
        try:
            session = _entered(room, held)
            encode_frame(room.catch_up(session, 1)[0].frame)
            room.stop(session)
        except Exception as error:
            self._close(held, "it could not go on", as_problem(error))
            return False
        return True


def _entered(room: Room, held: Held) -> int:
    """The stream's session in a room, new or where it was."""
    prompt = len(held.prompts) - 1
    return room.start(held.text, held.row.seed, past=held.past, prompt=prompt, began=held.playing)


def _session(held: Held) -> int:
    assert held.session is not None
    return held.session
