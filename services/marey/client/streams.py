"""Live streams: motion frame by frame while it is made, steered by prompts."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from marey.client.frames import Frame, read_frame
from marey.client.link import Link, Message
from marey.client.recording import Recording
from marey.client.resources import Resource, identifier
from marey.client.results import HINT
from marey.client.transport import NOT_OURS, Transport, error_of_problem
from marey.client.types import Stream, StreamDetail
from marey.core.errors import InvalidInput, ItemsFailed, MareyError, Unreachable
from marey.items.item import read_items
from marey.items.prompts import check_prompt

WAIT = 0.2
"""Seconds of one wait for messages."""
Slow = Literal["skip", "pause"]


class LiveStream:
    """A stream that is followed: iterating gives its frames until it is over. Not for several threads.

    Leaving its block ends a stream that is not over.

    Attributes:
        stream: as the server described it last: state, prompts, skeleton.
        missing: frames that did not come.
    """

    def __init__(self, transport: Transport, stream: StreamDetail, *, slow: Slow = "skip") -> None:
        self.stream = stream
        self.missing = 0
        self._transport = transport
        self._link = Link(transport.server, stream.id, slow=slow)
        self._waiting: deque[Message] = deque()
        self._recording: Recording | None = None
        self._over = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if not self._over:
                self._transport.delete(f"/v1/streams/{identifier(self.stream)}")
        except MareyError:
            if kind is None:
                raise
        finally:
            self.close()

    def __iter__(self) -> Iterator[Frame]:
        """The frames as they come, each once and in order; those that are missing are left out.

        A connection that breaks is opened again, and goes on with the next frame.

        Raises:
            ItemsFailed: the stream failed; after its last frame.
            InvalidInput, Refused, Busy: the server refuses a prompt or a command. Iterating again goes on.
            Unreachable: the connection broke and could not be opened again for three minutes.
        """
        while not self._over:
            if not self._waiting:
                self._waiting.extend(self._link.receive(WAIT))
                continue
            message = self._waiting.popleft()
            if isinstance(message, bytes):
                frame = self._frame(message)
                if frame is not None:
                    yield frame
            else:
                self._take(message)
        if self.stream.state == "failed":
            problem = self.stream.error
            raise ItemsFailed(
                (problem and problem.message) or self.stream.reason or "it failed without a reason",
                where=f"stream {self.stream.id}",
                hint=problem and problem.hint,
            )

    def steer(self, prompt: str) -> None:
        """Say what the person does next.

        Raises:
            InvalidInput: this cannot be a prompt.
            Unreachable: the stream could not be reached for three minutes.
        """
        self._send({"kind": "steer", "prompt": check_prompt(prompt)})

    def pause(self) -> None:
        """Hold the stream; it makes no frames until `resume`."""
        self._send({"kind": "pause"})

    def resume(self) -> None:
        """Go on with a paused stream."""
        self._send({"kind": "resume"})

    def stop(self) -> None:
        """Ask the stream to end; iterating gives the frames up to its end."""
        self._send({"kind": "stop"})

    def record(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the frames that are iterated from now on to a BVH file. Needs the extra `motion`.

        The file is whole at every moment, and row n is frame n: missing frames are made of their neighbours.

        Raises:
            InvalidInput: not a `.bvh`, a folder that cannot be written, or numpy is not installed.
            Conflict: the file is there already.
        """
        self._recording = Recording(Path(path), overwrite=overwrite)

    def close(self) -> None:
        """Close the connection and the recording; the stream itself goes on until nobody watches it for a minute."""
        self._link.__exit__()
        recording, self._recording = self._recording, None
        if recording is not None:
            recording.close()

    def _frame(self, data: bytes) -> Frame | None:
        skeleton = self.stream.skeleton
        frame = read_frame(data, joints=None if skeleton is None else len(skeleton.names))
        if frame.number < self._link.next:
            return None  # sent a second time
        self._lost(frame.number)
        self._link.next = frame.number + 1
        if self._recording is not None:
            self._recording.add(data, self.stream.raw)
        return frame

    def _take(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        try:
            if kind in ("stream", "end"):
                self.stream = StreamDetail.of({**self.stream.raw, **message["stream"]})
                self._over = kind == "end"
            elif kind == "gap":
                self._lost(int(message["first"]) + int(message["count"]))
            elif kind == "error":
                problem = message["problem"]
                error = error_of_problem(problem, int(problem.get("status", 422)))
                if not isinstance(error, Unreachable):  # the server tries again by itself
                    raise error
        except NOT_OURS as error:
            raise InvalidInput(f"the message {kind!r} lacks something: {error!r}", where="stream", hint=HINT) from error

    def _lost(self, until: int) -> None:
        count = until - self._link.next
        if count > 0:
            self._link.next = until
            self.missing += count

    def _send(self, message: dict[str, str]) -> None:
        """Send through the open socket; one that is not open yet, or broke, is opened first."""
        while not self._over and not self._link.send(message):
            self._waiting.extend(self._link.receive(WAIT))


class Streams(Resource):
    """`client.streams`."""

    def open(
        self,
        prompt: str,
        *,
        model: str | None = None,
        seed: int | None = None,
        seconds: float | None = None,
        name: str | None = None,
        slow: Slow = "skip",
    ) -> LiveStream:
        """Begin a stream and follow it.

        Args:
            prompt: what the person does first.
            model: model, bundle or exact bundle; None = mogo.
            seed: None = drawn.
            seconds: after which it ends by itself; None = the server decides.
            name: of the stream and its clip.
            slow: where this side cannot keep up: `skip` frames, or `pause` the stream.

        Raises:
            InvalidItems, InvalidInput: the prompt or an argument cannot be used.
            NotFound, Refused, Busy, Unreachable: as the server says.
        """
        if seconds is not None and not (math.isfinite(seconds) and seconds > 0):
            raise InvalidInput(f"{seconds:g} seconds cannot be", where="seconds")
        values = {"prompt": prompt, "model": model, "seed": seed, "name": name}
        (item,) = read_items([(None, values)])
        body = item.as_json()
        del body["variants"]
        if seconds is not None:
            body["seconds"] = seconds
        begun = StreamDetail.of(self._transport.post_once("/v1/streams", body))
        return LiveStream(self._transport, begun, slow=slow)

    def follow(self, stream: Stream | str, *, slow: Slow = "skip") -> LiveStream:
        """Follow a stream that was begun elsewhere. Leaving its block ends it; `close` leaves it running."""
        return LiveStream(self._transport, self.get(stream), slow=slow)

    def list(self, *, is_open: bool | None = None, limit: int | None = None) -> Iterator[Stream]:
        """The streams, newest first.

        Args:
            is_open: only those that are not over, or only those that are.
            limit: at most so many; None = all.
        """
        return self._pages(Stream, "/v1/streams", limit, open=is_open)

    def get(self, stream: Stream | str) -> StreamDetail:
        """The stream as it stands now, with its prompts and skeleton."""
        return StreamDetail.of(self._transport.get(_path(stream)))

    def end(self, stream: Stream | str) -> StreamDetail:
        """End a stream."""
        self._transport.delete(_path(stream))
        return self.get(stream)


def _path(stream: Stream | str) -> str:
    return f"/v1/streams/{identifier(stream)}"
