"""Control messages of clients to a running stream: from any API process to the worker that holds the stream.

Messages are kept in a Redis stream of their own and survive the worker: its successor reads on from the last message
that the stream's row names.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, cast, get_args

import redis

from marey.core.documents import RepeatedKeyError, json_problem, unique_object
from marey.core.errors import InvalidInput
from marey.streams.redis import BLOCK_MS, KEEP_MS, reached, stream_entries, stream_key

Kind = Literal["steer", "pause", "resume", "stop"]
KINDS: tuple[str, ...] = get_args(Kind)
START = "0-0"
KEPT_MESSAGES = 1000  # far more than a person sends while a worker is replaced
FIELD = b"m"


@dataclass(frozen=True)
class StreamControl:
    """One control message.

    Attributes:
        prompt: the new text of a steer; others have none.
        pose: that a stop ends on: fields of a pose keyframe, without its frame, and with `joint_rotations` in the order
            of the skeleton; None = it ends at once.
    """

    kind: Kind
    prompt: str | None = None
    pose: Mapping[str, Any] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            message = f"unknown control message `{self.kind}`; known: {', '.join(KINDS)}"
            raise InvalidInput(message, where="stream control")
        if (self.kind == "steer") != bool(self.prompt):
            raise InvalidInput("a steer needs a prompt, and other messages have none", where="stream control")
        if self.pose is not None and self.kind != "stop":
            raise InvalidInput("only a stop has a pose", where="stream control")

    def to_bytes(self) -> bytes:
        """Encode as JSON."""
        given = {"kind": self.kind, "prompt": self.prompt, "pose": self.pose and dict(self.pose)}
        return json.dumps({name: each for name, each in given.items() if each is not None}, ensure_ascii=False).encode()

    @classmethod
    def from_bytes(cls, data: bytes) -> StreamControl:
        """Decode a message.

        Raises:
            InvalidInput: unknown to this release.
        """
        try:
            message = json.loads(data, object_pairs_hook=unique_object)
        except RepeatedKeyError as error:
            raise InvalidInput(json_problem(error), where="stream control") from error
        except (ValueError, RecursionError) as error:
            raise InvalidInput("not JSON", where="stream control") from error
        if not isinstance(message, dict) or not set(cast("dict[str, Any]", message)) <= {"kind", "prompt", "pose"}:
            raise InvalidInput("not an object with `kind` and, for a steer, `prompt`", where="stream control")
        found = cast("dict[str, Any]", message)
        kind, prompt, pose = found.get("kind"), found.get("prompt"), found.get("pose")
        if not isinstance(kind, str) or not isinstance(prompt, str | None):
            raise InvalidInput("`kind` and `prompt` are texts", where="stream control")
        if not isinstance(pose, dict | None):
            raise InvalidInput("`pose` is not an object", where="stream control")
        return cls(cast("Kind", kind), prompt, cast("dict[str, Any] | None", pose))


class ControlQueue:
    """Control messages of one stream.

    Args:
        client: as for `FrameStream`.
        stream: its id.
    """

    def __init__(self, client: redis.Redis, stream: str) -> None:
        self.stream = stream
        self.key = stream_key(stream, "control")
        self._redis: Any = client

    def send(self, control: StreamControl) -> str:
        """Append a message; return its id. Ids grow."""
        with reached(self.stream), self._redis.pipeline() as pipe:
            pipe.xadd(self.key, {FIELD: control.to_bytes()}, maxlen=KEPT_MESSAGES, approximate=False)
            pipe.pexpire(self.key, KEEP_MS)
            return pipe.execute()[0].decode()

    def read(self, after: str = START, *, block_ms: int = 0) -> list[tuple[str, StreamControl | InvalidInput]]:
        """Return all messages after the one with this id, oldest first, each with its own id.

        A message unknown to this release is returned as an error: a worker that stopped at it would never get past
        it.

        Args:
            after: id of the last applied message.
            block_ms: time to wait if there is none, at most 1 s; 0 does not wait.
        """
        block = min(block_ms, BLOCK_MS) if block_ms > 0 else None
        with reached(self.stream):
            answer = self._redis.xread({self.key: after}, block=block)
        found: list[tuple[str, StreamControl | InvalidInput]] = []
        for identity, fields in stream_entries(answer):
            try:
                message: StreamControl | InvalidInput = StreamControl.from_bytes(fields.get(FIELD, b""))
            except InvalidInput as error:
                message = error
            found.append((identity.decode(), message))
        return found
