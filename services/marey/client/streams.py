"""Live streams: motion frame by frame while it is made, steered by prompts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from marey.client.frames import Frame, read_frame
from marey.client.problems import NOT_OURS, error_of_problem
from marey.client.recording import Recording
from marey.client.resources import Resource, identifier
from marey.client.results import HINT
from marey.client.stream_socket import Link, Message
from marey.client.transport import Transport
from marey.client.types.streams import Stream, StreamDetail
from marey.core.errors import InvalidInput, ItemsFailed, MareyError, Unreachable
from marey.items.constraints import read_pose
from marey.items.item import read_items
from marey.items.prompts import check_prompt
from marey.motion.keyframes import PoseFiles

WAIT = 0.2
"""Seconds of one wait for messages."""
Slow = Literal["skip", "pause"]
Command = Literal["steer", "pause", "resume", "stop"]


@dataclass(frozen=True, kw_only=True)
class StreamChanged:
    """A new description of the stream: its state, position, what it waits for, or prompts.

    Attributes:
        stream: the whole description.
    """

    stream: StreamDetail


@dataclass(frozen=True, kw_only=True)
class FramesMissing:
    """Frames that do not arrive any more.

    Attributes:
        first: number of the first of them.
        count: how many, one after the other.
    """

    first: int
    count: int


@dataclass(frozen=True, kw_only=True)
class StreamProblem:
    """A prompt or command that the server refuses, or a failure that it reports.

    Attributes:
        error: the problem as an error.
        raw: the problem as the server sent it.
    """

    error: MareyError
    raw: Mapping[str, Any]


StreamUpdate = Frame | StreamChanged | FramesMissing | StreamProblem
"""One of the things that `LiveStream.receive` returns."""


class LiveStream:
    """A stream that is followed: iterating gives its frames until it ends. Not safe to use from several threads.

    Leaving its block ends the stream if it has not ended.

    Attributes:
        stream: the last description by the server: state, prompts, skeleton.
        missing: number of frames that did not arrive.
    """

    def __init__(
        self, transport: Transport, stream: StreamDetail, *, slow: Slow = "skip", recording: Recording | None = None
    ) -> None:
        self.stream = stream
        self.missing = 0
        self._transport = transport
        self._link = Link(transport.server, stream.id, slow=slow)
        self._messages: deque[Message] = deque()
        self._updates: deque[StreamUpdate] = deque()
        self._recording = recording
        self._ended = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if not self._ended:
                self._transport.delete(f"/v1/streams/{identifier(self.stream)}")
        except MareyError:
            if kind is None:
                raise
        finally:
            self.close()

    def __iter__(self) -> Iterator[Frame]:
        """Iterate over the frames as they arrive, each once and in order; missing frames are left out.

        A connection that breaks is opened again, and continues with the next frame.

        Raises:
            ItemsFailed: the stream failed; after its last frame.
            InvalidInput, Refused, Busy: the server refuses a prompt or a command. Iterating again continues.
            Unreachable: the connection broke and could not be opened again for three minutes.
        """
        while not self._ended:
            update = self.receive(WAIT)
            if isinstance(update, Frame):
                yield update
            elif isinstance(update, StreamProblem) and not isinstance(update.error, Unreachable):
                raise update.error  # the server repeats by itself what it could not reach
        failure = self.failure()
        if failure is not None:
            raise failure

    @property
    def has_ended(self) -> bool:
        """True once the server has said that the stream has ended."""
        return self._ended

    @property
    def connected(self) -> bool:
        """True while the connection is open; `receive` opens it."""
        return self._link.connected

    @property
    def connections(self) -> int:
        """Number of connections that were opened so far."""
        return self._link.sockets

    @property
    def buffered(self) -> int:
        """Number of frames that have arrived and were not returned yet."""
        return sum(isinstance(message, bytes) for message in self._messages)

    @property
    def recorded(self) -> Path | None:
        """The absolute path of the recording; None without a recording, or while it has no frame."""
        return None if self._recording is None else self._recording.path

    def receive(self, wait: float = WAIT) -> StreamUpdate | None:
        """Return the next update; None if nothing arrives. For programs that do other work between frames.

        A connection that breaks is opened again, and continues with the next frame.

        Args:
            wait: seconds to wait at most.

        Raises:
            InvalidInput: a message cannot be read, or the recording cannot be written.
            Unauthenticated, Refused, NotFound: the server refuses the connection.
            Unreachable: the connection broke and could not be opened again for three minutes.
        """
        if not (self._updates or self._messages):
            self._messages.extend(self._link.receive(wait))
        while self._messages and not self._updates:
            self._read(self._messages.popleft())
        return self._updates.popleft() if self._updates else None

    def try_send(self, kind: Command, prompt: str | None = None) -> bool:
        """Send a command without waiting; return False if the connection is not open.

        Args:
            kind: steer, pause, resume or stop.
            prompt: the next action, for steer.
        """
        return self._link.send({"kind": kind} if prompt is None else {"kind": kind, "prompt": prompt})

    def steer(self, prompt: str) -> None:
        """Set the next action of the person.

        Raises:
            InvalidInput: the text cannot be a prompt.
            Unreachable: the stream could not be reached for three minutes.
        """
        self._send("steer", check_prompt(prompt))

    def pause(self) -> None:
        """Pause the stream; it generates no frames until `resume`.

        Raises:
            Unreachable: as `steer`.
        """
        self._send("pause")

    def resume(self) -> None:
        """Resume a paused stream.

        Raises:
            Unreachable: as `steer`.
        """
        self._send("resume")

    def stop(self, pose: Mapping[str, Any] | None = None) -> None:
        """Ask the stream to end; iterating gives the frames up to its end.

        Args:
            pose: of the last frame; see `Streams.end`.

        Raises:
            Unreachable: as `steer`.
            InvalidInput, NotFound, Conflict: as `Streams.end` with a pose.
        """
        if pose is None:
            self._send("stop")
        else:
            _end_on(self._transport, self.stream, pose)

    def failure(self) -> ItemsFailed | None:
        """Return the error of a stream that failed; None for any other state."""
        if self.stream.state != "failed":
            return None
        problem = self.stream.error
        return ItemsFailed(
            (problem and problem.message) or self.stream.reason or "the stream failed, and the server gives no reason",
            where=f"stream {self.stream.id}",
            hint=problem and problem.hint,
        )

    def record(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the frames from now on to a BVH file. Needs the extra `motion`.

        The file is complete at every moment, and row n is frame n: missing frames are interpolated.

        Args:
            path: the file, which ends in `.bvh`.
            overwrite: replace an existing file.

        Raises:
            InvalidInput: another ending, a folder that cannot be written, or numpy is not installed.
            Conflict: the file exists.
        """
        self._recording = Recording(Path(path), overwrite=overwrite)

    def close(self) -> None:
        """Close the connection and the recording; the server ends a stream without viewers after a minute."""
        self._link.__exit__()
        if self._recording is not None:
            self._recording.close()

    def _read(self, message: Message) -> None:
        """Turn a message of the server into updates."""
        if isinstance(message, bytes):
            self._read_frame(message)
            return
        kind = message["type"]
        try:
            if kind in ("stream", "end"):
                self.stream = StreamDetail.of({**self.stream.raw, **message["stream"]})
                self._ended = self._ended or kind == "end"
                self._updates.append(StreamChanged(stream=self.stream))
            elif kind == "gap":
                self._skip_to(int(message["first"]) + int(message["count"]))
            elif kind == "error":
                problem = message["problem"]
                error = error_of_problem(problem, int(problem.get("status", 422)))
                self._updates.append(StreamProblem(error=error, raw=problem))
        except NOT_OURS as error:
            raise InvalidInput(f"the message {kind!r} lacks something: {error!r}", where="stream", hint=HINT) from error

    def _read_frame(self, data: bytes) -> None:
        skeleton = self.stream.skeleton
        frame = read_frame(data, joints=None if skeleton is None else len(skeleton.names))
        if frame.number < self._link.next:
            return  # sent a second time
        self._skip_to(frame.number)
        self._link.next = frame.number + 1
        if self._recording is not None:
            self._recording.add(frame, self.stream)
        self._updates.append(frame)

    def _skip_to(self, number: int) -> None:
        """Count the frames before `number` that have not arrived as missing."""
        first, count = self._link.next, number - self._link.next
        if count > 0:
            self._link.next = number
            self.missing += count
            self._updates.append(FramesMissing(first=first, count=count))

    def _send(self, kind: Command, prompt: str | None = None) -> None:
        """Send through the open connection; open it first if it is not open yet, or broke."""
        while not self._ended and not self.try_send(kind, prompt):
            self._messages.extend(self._link.receive(WAIT))


class Streams(Resource):
    """`client.streams`. Errors of all methods: NotFound, Refused, Unreachable."""

    def open(
        self,
        prompt: str,
        *,
        model: str | None = None,
        seed: int | None = None,
        seconds: float | None = None,
        name: str | None = None,
        slow: Slow = "skip",
        record: str | Path | None = None,
        overwrite: bool = False,
    ) -> LiveStream:
        """Begin a stream and follow it.

        Args:
            prompt: the first action of the person.
            model: model, bundle or exact bundle; None = the server's.
            seed: None = random.
            seconds: maximum length; None = the server's.
            name: of the stream and its clip.
            slow: policy if this client cannot keep up: `skip` frames, or `pause` the stream.
            record: a BVH file to write, as `LiveStream.record` does; it is checked before the stream begins.
            overwrite: replace an existing file.

        Raises:
            InvalidItems, InvalidInput: the prompt or an argument cannot be used.
            Conflict: the file exists.
            Busy: too many streams are open.
        """
        if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
            raise InvalidInput(f"{seconds:g} seconds is no length above 0", where="seconds", argument="seconds")
        values = {"prompt": prompt, "model": model, "seed": seed, "name": name}
        (item,) = read_items([(None, values)])
        body = item.as_json()
        del body["variants"]
        if seconds is not None:
            body["seconds"] = seconds
        recording = None if record is None else Recording(Path(record), overwrite=overwrite)
        begun = StreamDetail.of(self._transport.post_once("/v1/streams", body))
        return LiveStream(self._transport, begun, slow=slow, recording=recording)

    def follow(self, stream: Stream | str, *, slow: Slow = "skip") -> LiveStream:
        """Follow a stream that was begun elsewhere. Leaving its block ends it; `close` leaves it running.

        Args:
            slow: policy if this client cannot keep up: `skip` frames, or `pause` the stream.
        """
        return LiveStream(self._transport, self.get(stream), slow=slow)

    def list(self, *, is_open: bool | None = None, limit: int | None = None) -> Iterator[Stream]:
        """Iterate over the streams, newest first.

        Args:
            is_open: True = only those that have not ended, False = only those that have; None = all.
            limit: the largest number of streams; None = all.
        """
        return self._pages(Stream, "/v1/streams", limit, open=is_open)

    def get(self, stream: Stream | str) -> StreamDetail:
        """Return the current state of a stream, with its prompts and skeleton."""
        return StreamDetail.of(self._transport.get(_path(stream)))

    def end(self, stream: Stream | str, *, pose: Mapping[str, Any] | None = None) -> StreamDetail:
        """End a stream.

        Args:
            pose: into which its last second passes, as of a pose keyframe without its frame: `{"motion": {"id": …,
                "frame": 12}}` of a stored motion, `{"motion": {"file": "bow.npz", "frame": 12}}`, which is read here,
                or `joint_rotations` and `root_height`. None = it ends with the next frame.

        Raises:
            InvalidInput: a pose that cannot be read, or of another skeleton.
            Conflict: with a pose, and the stream has ended.
        """
        if pose is not None:
            return _end_on(self._transport, stream, pose)
        self._transport.delete(_path(stream))
        return self.get(stream)


def _end_on(transport: Transport, stream: Stream | str, pose: Mapping[str, Any]) -> StreamDetail:
    read = read_pose(pose, "pose")
    if "file" in read.get("motion", {}):
        (read,) = PoseFiles(Path()).fill([read])
    return StreamDetail.of(transport.post(f"{_path(stream)}/end", {"pose": read}))


def _path(stream: Stream | str) -> str:
    return f"/v1/streams/{identifier(stream)}"
