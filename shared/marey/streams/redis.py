"""Frame streams on Redis: one worker writes, any number of API processes read, and readers can resume.

A stream has four keys, all in one hash slot: `frames` (a Redis stream of the last 1,200 frames, one minute at 20
fps; frame n has the id `{n+1}-0`, since 0-0 is invalid), `lease` (the writer; expires 1.5 s after its last
renewal), `fence` (the number of the newest lease) and `control` (`control.py`). All expire an hour after the
last write.

A writer holds the lease: the script that adds frames compares it atomically, so a worker that was frozen and wakes
up adds nothing after another one took the stream. A lease has a fencing number, for the rows in Postgres, and a
random token, for a Redis that lost its memory and restarts counting.

Every call raises `Unreachable` when Redis does not answer, is full or refuses the request.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

import re
import secrets
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, cast

import redis
from redis.exceptions import ConnectionError as NoConnection
from redis.exceptions import OutOfMemoryError, ReadOnlyError
from redis.exceptions import TimeoutError as TookTooLong

from marey.core.errors import Conflict, InvalidInput, Unreachable
from marey.streams.frames import Frame, encode_frame

LEASE_MS = 1500
RENEW_SECONDS = 0.4  # three renewals may fail before the lease is lost
KEPT_FRAMES = 1200
KEEP_MS = 3600 * 1000
BLOCK_MS = 1000  # a read waits no longer: well under the deadline of a call, and a stopping process must notice
FIELD = b"f"
STREAM_ID = re.compile(r"[A-Za-z0-9_-]{1,64}")

_ACQUIRE = """
if redis.call('EXISTS', KEYS[1]) == 1 then return {0, redis.call('PTTL', KEYS[1])} end
local fence = math.max(tonumber(redis.call('GET', KEYS[2]) or '0'), tonumber(ARGV[4])) + 1
fence = string.format('%.0f', fence)
redis.call('SET', KEYS[2], fence, 'PX', ARGV[3])
redis.call('SET', KEYS[1], fence .. ':' .. ARGV[1], 'PX', ARGV[2])
local last = redis.call('XREVRANGE', KEYS[3], '+', '-', 'COUNT', 1)
return {tonumber(fence), #last > 0 and tonumber(string.match(last[1][1], '^%d+')) or 0}
"""

_RENEW = """
if redis.call('GET', KEYS[1]) ~= ARGV[1] then return 0 end
return redis.call('PEXPIRE', KEYS[1], ARGV[2])
"""

_RELEASE = """
if redis.call('GET', KEYS[1]) ~= ARGV[1] then return 0 end
return redis.call('DEL', KEYS[1])
"""

# The id of the last frame gives the number of the next. A write whose answer was lost is repeated, by the client as it
# was and by the writer with the frames made since: what is stored already is left out. The last of it shows that these
# are the same frames.
_WRITE = """
if redis.call('GET', KEYS[1]) ~= ARGV[1] then return {'lost', 0} end
local first, count, stored = tonumber(ARGV[4]), #ARGV - 4, 0
local last = redis.call('XREVRANGE', KEYS[2], '+', '-', 'COUNT', 1)
if #last > 0 then
  local next = tonumber(string.match(last[1][1], '^%d+'))
  stored = next - first
  if stored < 0 or stored > count then return {'order', next} end
  if stored > 0 and last[1][2][2] ~= ARGV[4 + stored] then return {'order', next} end
end
for i = stored + 1, count do
  redis.call('XADD', KEYS[2], 'MAXLEN', '=', ARGV[2], string.format('%.0f-0', first + i), 'f', ARGV[4 + i])
end
redis.call('PEXPIRE', KEYS[2], ARGV[3])
redis.call('PEXPIRE', KEYS[3], ARGV[3])
return {'written', first + count}
"""


class LeaseLost(Conflict):
    """The lease expired, or another worker has the stream: write nothing more."""


@dataclass(frozen=True)
class Lease:
    """Exclusive right to write a stream.

    Attributes:
        fence: goes up with every lease of the stream.
        token: distinguishes two leases of the same number.
        next_frame: number of the stream's next frame; 0 if Redis has none.
    """

    fence: int
    token: str
    next_frame: int

    @property
    def value(self) -> str:
        """Value of the lease key."""
        return f"{self.fence}:{self.token}"


@dataclass(frozen=True)
class Gap:
    """Requested frames that no longer exist: `first` to `first + count - 1`."""

    first: int
    count: int


@dataclass(frozen=True)
class StoredFrame:
    """A frame in the encoding that clients receive."""

    number: int
    data: bytes


class FrameStream:
    """The frames of one stream.

    Args:
        client: returns bytes (`decode_responses` off), with timeouts (`marey.runtime.queue.redis_client`).
        stream: its id, 1 to 64 letters, digits, `_` and `-`.
        lease_ms, kept, keep_ms: duration of a lease, number of kept frames, lifetime of an idle stream.

    Raises:
        InvalidInput: an invalid id.
    """

    def __init__(
        self,
        client: redis.Redis,
        stream: str,
        *,
        lease_ms: int = LEASE_MS,
        kept: int = KEPT_FRAMES,
        keep_ms: int = KEEP_MS,
    ) -> None:
        self.stream = stream
        self.frames_key, self.lease_key, self.fence_key = (
            stream_key(stream, part) for part in ("frames", "lease", "fence")
        )
        self._redis: Any = client
        self._lease_ms, self._kept, self._keep_ms = lease_ms, kept, keep_ms
        self._acquire = self._redis.register_script(_ACQUIRE)
        self._renew = self._redis.register_script(_RENEW)
        self._release = self._redis.register_script(_RELEASE)
        self._write = self._redis.register_script(_WRITE)

    def acquire(self, *, above: int = 0) -> Lease | None:
        """Acquire the lease of the stream, if it is free.

        Args:
            above: highest known fencing number; the new one is higher.

        Returns:
            None while another lease is valid.
        """
        token = secrets.token_hex(8)
        with reached(self.stream):
            fence, following = self._acquire(
                keys=[self.lease_key, self.fence_key, self.frames_key],
                args=[token, self._lease_ms, self._keep_ms, above],
            )
        return Lease(fence, token, following) if fence else None

    def renew(self, lease: Lease) -> None:
        """Extend the lease by 1.5 s; call it every 0.4 s.

        Raises:
            LeaseLost: another worker has it, or it expired.
        """
        with reached(self.stream):
            kept = self._renew(keys=[self.lease_key], args=[lease.value, self._lease_ms])
        if not kept:
            raise self._lost(lease)

    def release(self, lease: Lease) -> bool:
        """Release the lease, so that another worker need not wait; return False if it was lost already."""
        with reached(self.stream):
            return bool(self._release(keys=[self.lease_key], args=[lease.value]))

    def write(self, lease: Lease, frames: Sequence[Frame]) -> None:
        """Append frames, all or none; of those that are stored already, the others. Idempotent.

        Raises:
            LeaseLost: another worker has it, or it expired.
            Conflict: the frames do not follow the last frame of the stream.
            InvalidInput: their numbers are not consecutive, or one cannot be encoded.
        """
        if not frames:
            return
        first = frames[0].number
        if [frame.number for frame in frames] != list(range(first, first + len(frames))):
            raise InvalidInput("the numbers of frames of one write go up by one", where=f"stream {self.stream}")
        data = [encode_frame(frame) for frame in frames]
        with reached(self.stream):
            answer, following = self._write(
                keys=[self.lease_key, self.frames_key, self.fence_key],
                args=[lease.value, self._kept, self._keep_ms, first, *data],
            )
        if answer == b"lost":
            raise self._lost(lease)
        if answer == b"order":
            raise Conflict(f"frame {first} does not follow; the next is {following}", where=f"stream {self.stream}")

    def bounds(self) -> tuple[int, int]:
        """Return the numbers of the oldest stored frame and of the next one; (0, 0) without frames."""
        with reached(self.stream):
            oldest = self._redis.xrange(self.frames_key, count=1)
            newest = self._redis.xrevrange(self.frames_key, count=1)
        return (_number(oldest[0][0]), _number(newest[0][0]) + 1) if oldest and newest else (0, 0)

    def drop(self) -> None:
        """Remove the stream, its lease and its messages."""
        with reached(self.stream):
            self._redis.delete(self.frames_key, self.lease_key, self.fence_key, stream_key(self.stream, "control"))

    def reader(self, at: int = 0) -> FrameReader:
        """Return a reader that starts at frame `at`, which may lie in the future."""
        return FrameReader(self._redis, self, at)

    def _lost(self, lease: Lease) -> LeaseLost:
        hint = "another worker has the stream"
        return LeaseLost(f"lease {lease.fence} has expired", where=f"stream {self.stream}", hint=hint)


class FrameReader:
    """One client's position in a stream: every frame once and in order, gaps reported with their size.

    Attributes:
        at: number of the next frame to read; a client sends it to resume.
    """

    def __init__(self, client: Any, stream: FrameStream, at: int) -> None:
        if at < 0:
            raise InvalidInput(f"frame {at}; frames are counted from 0", where=f"stream {stream.stream}")
        self.at = at
        self._redis = client
        self._stream = stream

    def read(self, *, count: int = 64, block_ms: int = 0) -> list[StoredFrame | Gap]:
        """Return the next frames, a gap before those that follow it.

        Args:
            count: maximum number of frames.
            block_ms: time to wait if there is none, at most 1 s; 0 does not wait.
        """
        block = min(block_ms, BLOCK_MS) if block_ms > 0 else None
        with reached(self._stream.stream):
            answer = self._redis.xread({self._stream.frames_key: f"{self.at}-0"}, count=count, block=block)
        found: list[StoredFrame | Gap] = []
        for identity, fields in stream_entries(answer):
            number = _number(identity)
            if number > self.at:
                found.append(Gap(self.at, number - self.at))
            found.append(StoredFrame(number, fields[FIELD]))
            self.at = number + 1
        return found

    def skip(self) -> Gap | None:
        """Skip to the newest frame, for a client that is too slow; return the gap, if any."""
        newest = max(self._stream.bounds()[1] - 1, self.at)
        missed = Gap(self.at, newest - self.at)
        self.at = newest
        return missed if missed.count else None


def stream_key(stream: str, part: str) -> str:
    """Return a key of a stream; the braces put all of them in one hash slot.

    Raises:
        InvalidInput: an invalid id.
    """
    if not STREAM_ID.fullmatch(stream):
        raise InvalidInput("the id of a stream is 1 to 64 letters, digits, `_` and `-`", where=repr(stream[:80]))
    return f"marey:stream:{{{stream}}}:{part}"


@contextmanager
def reached(stream: str) -> Generator[None]:
    """Convert redis-py's connection errors to `Unreachable`."""
    try:
        yield
    except (NoConnection, TookTooLong, OutOfMemoryError, ReadOnlyError) as error:
        hint = "Check that Redis runs and has memory left."
        raise Unreachable(
            f"Redis failed: {error}",
            where=f"stream {stream}",
            hint=hint,
            public="the frames of live streams cannot be reached",
        ) from error


def _number(identity: bytes) -> int:
    """Return the number of the frame with this id."""
    return int(identity.split(b"-")[0]) - 1


def stream_entries(answer: Any) -> list[tuple[bytes, dict[bytes, bytes]]]:
    """Return the entries of the single stream of an XREAD: pairs of key and list in RESP2, a mapping in RESP3."""
    if not answer:
        return []
    if isinstance(answer, dict):
        answer = [(key, batch) for key, batches in cast("dict[Any, Any]", answer).items() for batch in batches]
    return answer[0][1]
