"""One WebSocket client of a stream: frames as they are made, and changes of the stream's state.

The only state about frames is the number of the next one to send: every send is awaited, and frames that a client
does not read stay in Redis, or are skipped.
"""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import anyio
from anyio.abc import TaskGroup
from starlette.websockets import WebSocketDisconnect

from marey.api.context import Context
from marey.api.stream_hub import Hub
from marey.api.streams.backpressure import BLOCKED_SECONDS, BackpressurePause, LagTracker
from marey.api.streams.messages import ControlMessages
from marey.api.streams.schemas import BundleFacts, EndMessage, GapMessage, StreamDetailView, StreamMessage
from marey.api.streams.service import is_over
from marey.api.streams.socket_writer import SocketWriter
from marey.core.errors import MareyError, Unreachable
from marey.core.frame_layout import HEADER, LAST
from marey.db import transaction
from marey.streams import StreamPrompt, StreamRow, StreamState, get_stream, prompts_with_rewrites
from marey.streams.control import ControlQueue
from marey.streams.presence import REFRESH_SECONDS, ViewerPresence
from marey.streams.redis import FrameStream, Gap, StoredFrame
from marey.tenants import ApiKey, check_key

BATCH = 20
"""Frames per read: one second."""
IDLE_SECONDS, FLOW_SECONDS = 1.0, 2.0
"""Seconds between reads of the row: without frames or with unknown prompts, and with steady frames."""
LAST_SECONDS = 0.2
"""The same after the last frame: the row ends soon."""
HOLD_SECONDS = 0.25
MEASURE_SECONDS = 0.5
"""Seconds between checks of a client's lag: if this server is slow, more checks would make it worse."""
OUTAGE_SECONDS = 8.0
"""Maximum outage: a restarted Redis or Postgres is back by then."""
AGAIN_SECONDS = 0.5


@dataclass(frozen=True)
class SessionRequest:
    """A validated request to watch a stream.

    Attributes:
        row, prompts, made: state of the stream at the time of the request.
        first: number of the first requested frame.
        pauses: pause the stream when the client is slow, rather than skip frames.
    """

    key: ApiKey
    row: StreamRow
    prompts: Sequence[StreamPrompt]
    made: BundleFacts
    first: int
    pauses: bool


class StreamSession:
    """Streams frames and messages to one client.

    Args:
        writer: connected to the client; the handshake is done.
        request: the validated request.
    """

    def __init__(self, writer: SocketWriter, hub: Hub, shared: Context, request: SessionRequest) -> None:
        self._writer, self._hub, self._shared, self._request = writer, hub, shared, request
        self._row, self._prompts = request.row, request.prompts
        self._told = self._standing()
        self._looked = time.monotonic()
        name = str(request.row.id)
        self._frames = FrameStream(hub.redis, name)
        self._presence = ViewerPresence(hub.redis, name)
        self._messages = ControlMessages(writer, hub, shared, request.key, request.row.id)
        self._pause = BackpressurePause(hub, ControlQueue(hub.redis, name))
        self._lag = LagTracker()
        self._at = request.first
        self._prompt = 0  # the highest number that a frame carried
        self._last = False
        self._sending: float | None = None  # start time of the current send
        self._measured = -MEASURE_SECONDS
        self._away: float | None = None  # start time of an outage of Redis or Postgres

    async def run(self) -> None:
        """Run until the stream ends, the client disconnects or the server stops."""
        tasks = [self._show, self._messages.forward, self._renew]
        if self._request.pauses:
            tasks.append(self._hold)
        try:
            async with anyio.create_task_group() as group:
                for task in tasks:
                    group.start_soon(_and_then_none, task, group)
        finally:
            with anyio.CancelScope(shield=True), suppress(Unreachable):
                await self._pause.release()  # no other session would resume it

    async def _show(self) -> None:
        await self._writer.send_message(StreamMessage(stream=self._detail()))
        while True:
            try:
                if await self._turn():
                    return
                self._away = None
            except Unreachable as error:
                if await self._give_up(error):
                    return
            except MareyError as error:
                await self._writer.refuse(error)
                return

    async def _turn(self) -> bool:
        """Wait for frames and send them, or refresh the state; return True when the stream has ended and everything is
        sent."""
        if is_over(self._row):
            await self._finish()
            return True
        found = await self._hub.wait(lambda: self._read(LAST_SECONDS if self._last else IDLE_SECONDS))
        if await self._pass_on(found) and len(found) < BATCH:
            self._lag.caught_up()
            await self._pause.release()
        if time.monotonic() - self._looked >= self._patience(bool(found)):
            await self._look()
        return False

    def _read(self, seconds: float) -> list[StoredFrame | Gap]:
        return self._frames.reader(self._at).read(count=BATCH, block_ms=round(1000 * seconds))

    async def _pass_on(self, found: Sequence[StoredFrame | Gap]) -> bool:
        """Send these frames and gaps; return False if the rest was skipped."""
        for each in found:
            if isinstance(each, Gap):
                await self._tell_gap(each)
                continue
            blocked = await self._send(each)
            self._at = each.number + 1
            _, _, flags, _, _, prompt, *_ = HEADER.unpack_from(each.data)
            self._prompt, self._last = max(self._prompt, prompt), bool(flags & LAST)
            if blocked and not self._request.pauses and await self._skip():
                return False
        return True

    async def _send(self, frame: StoredFrame) -> bool:
        """Send a frame; return True if that had to wait."""
        self._sending = time.monotonic()
        try:
            await self._writer.send(frame.data)
            return time.monotonic() - self._sending > BLOCKED_SECONDS
        finally:
            self._sending = None

    async def _skip(self) -> bool:
        """Skip to the newest frame, if the client falls behind."""
        if time.monotonic() - self._measured < MEASURE_SECONDS:
            return False
        self._measured = time.monotonic()
        if not self._lag.is_falling_behind(await self._behind()):
            return False
        reader = self._frames.reader(self._at)
        missed = await self._hub.call(reader.skip)
        self._lag.caught_up()
        if missed is not None:
            await self._tell_gap(missed)
        return missed is not None

    async def _tell_gap(self, gap: Gap) -> None:
        await self._writer.send_message(GapMessage(first=gap.first, count=gap.count))
        self._at = gap.first + gap.count

    async def _behind(self) -> int:
        """Return the number of available frames that the client lacks."""
        return (await self._hub.call(self._frames.bounds))[1] - self._at

    def _patience(self, flowing: bool) -> float:
        """Return the seconds between two reads of the row; a little less than a read waits, since its clock is
        another."""
        if self._last:
            return 0.0
        settled = self._row.state is StreamState.LIVE and self._prompt < len(self._prompts)
        return FLOW_SECONDS if flowing and settled else 0.9 * IDLE_SECONDS

    async def _look(self) -> None:
        """Read the stream's state, and send it if it changed."""
        self._row, self._prompts = await self._hub.call(self._stand)
        self._looked = time.monotonic()
        if self._standing() != self._told and not is_over(self._row):
            await self._writer.send_message(StreamMessage(stream=self._detail()))
            self._told = self._standing()

    def _stand(self) -> tuple[StreamRow, Sequence[StreamPrompt]]:
        """Read the row, and the prompts if there may be new ones: frames carry a number that is not known here."""
        with transaction(self._shared.engine) as conn:
            check_key(conn, self._request.key.id)  # the key may be revoked, expired or suspended by now
            row = get_stream(conn, self._row.tenant, self._row.id)
            known = self._prompt < len(self._prompts) and not is_over(row)
            return row, self._prompts if known else prompts_with_rewrites(conn, row.id)

    async def _finish(self) -> None:
        """Send the rest of an ended stream."""
        while found := await self._hub.wait(lambda: self._read(0)):
            await self._pass_on(found)
        if self._at < self._row.frames:  # frames expire an hour after the end
            await self._tell_gap(Gap(self._at, self._row.frames - self._at))
        await self._writer.send_message(EndMessage(stream=self._detail()))
        await self._writer.close(1000)

    async def _give_up(self, error: Unreachable) -> bool:
        """Report an outage once, and wait a little; return True, with the socket closed, when it lasts too long."""
        now = time.monotonic()
        if self._away is None:
            self._away = now
            await self._writer.send_error(error)
        if now - self._away > OUTAGE_SECONDS:
            await self._writer.refuse(error)
            return True
        await anyio.sleep(AGAIN_SECONDS)
        return False

    async def _renew(self) -> None:
        """Refresh the viewer's presence while this runs."""
        while True:
            with suppress(Unreachable):  # reported by `_show`
                await self._hub.call(self._presence.refresh)
            await anyio.sleep(REFRESH_SECONDS)

    async def _hold(self) -> None:
        """Pause the stream while the client blocks sends and falls behind; `_turn` resumes it."""
        while True:
            await anyio.sleep(HOLD_SECONDS)
            since = self._sending
            if since is None or time.monotonic() - since < BLOCKED_SECONDS or self._row.state is not StreamState.LIVE:
                continue
            with suppress(Unreachable):  # reported by `_show`
                if self._lag.is_falling_behind(await self._behind()):
                    await self._pause.engage()

    def _standing(self) -> tuple[object, ...]:
        """Return the state whose changes the client receives."""
        return self._row.state, self._row.position, self._row.waits_for, tuple(self._prompts)

    def _detail(self) -> StreamDetailView:
        return StreamDetailView.detail(self._row, self._request.made, self._prompts)


async def _and_then_none(task: Callable[[], Awaitable[None]], group: TaskGroup) -> None:
    """Run a task and then cancel its group: the session ends with any of its tasks."""
    with suppress(WebSocketDisconnect):
        await task()
    group.cancel_scope.cancel()
