"""Control messages from a client to the stream it watches."""

from __future__ import annotations

import time
from functools import partial
from uuid import UUID

from marey.api.auth import check_scope
from marey.api.context import Context
from marey.api.stream_hub import Hub
from marey.api.streams import service
from marey.api.streams.socket_writer import SocketWriter
from marey.core.errors import Busy, InvalidInput, MareyError, TooLarge
from marey.items.prompts import check_prompt
from marey.streams.control import StreamControl
from marey.tenants import ApiKey

MAX_BYTES = 8 * 1024
"""Maximum size of a message; a prompt has at most 2,000 characters."""
A_SECOND = 20
"""Maximum messages a second."""


class MessageRateLimit:
    """Token bucket of messages per second."""

    def __init__(self, a_second: int) -> None:
        self._a_second = a_second
        self._left = float(a_second)
        self._at = time.monotonic()

    def allows(self, now: float) -> bool:
        """Return True if one more message is allowed, and count it."""
        self._left = min(self._left + (now - self._at) * self._a_second, self._a_second)
        self._at = now
        if self._left < 1:
            return False
        self._left -= 1
        return True


class ControlMessages:
    """Receives the control messages of one client and forwards them, one after the other."""

    def __init__(self, writer: SocketWriter, hub: Hub, shared: Context, key: ApiKey, stream: UUID) -> None:
        self._writer, self._hub, self._shared, self._key, self._stream = writer, hub, shared, key, stream
        self._rate = MessageRateLimit(A_SECOND)

    async def forward(self) -> None:
        """Forward messages until the client disconnects or the server stops."""
        while (message := await self._writer.receive()) is not None:
            try:
                control = self._control(message)
                ask = partial(service.command, self._shared, self._key, self._stream, control)
                await self._hub.call(ask)
            except MareyError as error:
                await self._writer.send_error(error)

    def _control(self, message: bytes) -> StreamControl:
        """Parse and validate a message.

        Raises:
            Refused, Busy, TooLarge, InvalidInput: by the cause.
        """
        if not self._rate.allows(time.monotonic()):
            raise Busy(f"more than {A_SECOND} messages a second", hint="Send it again, later.", seconds=1)
        check_scope(self._key, "submit")
        if len(message) > MAX_BYTES:
            raise TooLarge(f"the message is over {MAX_BYTES // 1024} KiB", where="message")
        control = StreamControl.from_bytes(message)
        if control.pose is not None:
            raise InvalidInput(
                "a message has no pose", where="pose", hint="`POST /v1/streams/{id}/end` ends a stream on a pose."
            )
        if control.prompt is not None:
            control = StreamControl("steer", check_prompt(control.prompt, where="prompt"))
        return control
