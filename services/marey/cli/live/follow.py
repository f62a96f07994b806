"""Following one live stream from its beginning to its end."""

from __future__ import annotations

import time
from collections import deque
from typing import TYPE_CHECKING, Any

from marey.cli import console
from marey.cli.live.pace import Pace
from marey.cli.live.screen import Screen
from marey.cli.live.steering import HELP, Interrupts, Lines, message_of
from marey.client.frames import head_of
from marey.client.link import Link, Message
from marey.client.recording import Recording
from marey.core.errors import InvalidInput, ItemsFailed, MareyError

if TYPE_CHECKING:
    from rich.text import Text

TICK = 0.1
"""Seconds to wait for a message; what is typed goes out as late as that while no frames come."""
MESSAGE_SECONDS = 0.1
"""Between two messages that we send: a file that is piped in is not to be taken for a flood."""
OVER = ("ended", "failed")
STYLES = {"live": "bold green", "waiting": "yellow", "paused": "yellow"}


class Follower:
    """One stream: takes its messages, writes its frames, tells what happens, sends what is typed.

    Args:
        stream: as the server answered its beginning.
        recording: where frames go; None = nowhere.
        as_json: tell each event as a line of JSON on stdout, too.

    Attributes:
        stream: as the server described it last.
        frames: how many frames it has up to the last one that came; those that are missing count.
        missing: how many of them did not come.
    """

    def __init__(
        self, stream: dict[str, Any], link: Link, recording: Recording | None, interrupts: Interrupts, *, as_json: bool
    ) -> None:
        self.stream = stream
        self.frames = 0
        self.missing = 0
        self._link = link
        self._recording = recording
        self._interrupts = interrupts
        self._as_json = as_json
        self._screen = Screen()
        self._lines = Lines()
        self._pace = Pace(float(stream.get("fps") or 20.0))
        self._outbox: deque[dict[str, str]] = deque()
        self._sent = 0.0
        self._stopping = False
        self._stopped_on = 0  # the socket that took our stop
        self._broken_on: int | None = None  # how many sockets there had been when the last one was told to be broken
        self._told: tuple[str | None, int | None] = (None, None)  # state and position
        self._prompts = 0  # how many were told
        self._prompt = 0  # number of the one in force
        self._ended = False

    def run(self) -> None:
        """Follow the stream until it is over.

        Raises:
            MareyError: the server cannot be reached any more, or the file not be written; the stream is asked to stop.
            KeyboardInterrupt: the second Ctrl-C.
        """
        try:
            self._update(self.stream)
            if self._lines.typed:
                self._screen.say(HELP)
            while not self._ended:
                self._turn()
        except (MareyError, BrokenPipeError):
            self._link.send({"kind": "stop"})
            raise
        finally:
            self._screen.close()
            if self._recording is not None:
                self._recording.close()

    def result(self) -> dict[str, Any]:
        """The line of this stream."""
        path = self._recording.path if self._recording is not None else None
        return {
            "stream": self.stream["id"],
            "job": self.stream.get("job"),
            "state": self.stream["state"],
            "reason": self.stream.get("reason"),
            "frames": self.frames,
            "fps": self.stream.get("fps"),
            "gaps": self.missing,
            "prompts": self.stream.get("prompts") or [],
            "file": None if path is None else str(path),
        }

    def failure(self) -> ItemsFailed | None:
        """What the server says went wrong; None = nothing."""
        if self.stream["state"] != "failed":
            return None
        problem = self.stream.get("error") or {}
        message = problem.get("message") or self.stream.get("reason") or "it failed, and the server does not say why"
        return ItemsFailed(message, where=f"stream {self.stream['id']}", hint=problem.get("hint"))

    def _turn(self) -> None:
        self._send()
        messages = self._link.receive(TICK)
        if self._broken_on not in (None, self._link.sockets):
            self._broken_on = None
            self._screen.say("Connected again.")
        self._take(messages)
        if not (self._link.connected or self._ended) and self._broken_on is None:
            self._broken_on = self._link.sockets
            self._screen.say("No connection; trying again.")

    def _take(self, messages: list[Message]) -> None:
        left = sum(isinstance(message, bytes) for message in messages)
        for message in messages:
            if isinstance(message, bytes):
                left -= 1
                self._frame(message)
            else:
                self._message(message)
            if self._screen.due():
                self._screen.count(self._counter(left))
        if self._screen.due():
            self._screen.count(self._counter(0))

    def _frame(self, data: bytes) -> None:
        head = head_of(data)
        if head.number < self._link.next:
            return  # sent a second time
        self._lost(head.number)
        if self._recording is not None:
            self._recording.add(data, self.stream)
        self.frames = self._link.next = head.number + 1
        self._prompt = head.prompt
        self._pace.arrived(head.number, time.monotonic())

    def _message(self, message: dict[str, Any]) -> None:
        kind = message["type"]
        try:
            if kind in ("stream", "end"):
                self._update(message["stream"])
                self._ended = self._ended or kind == "end"
            elif kind == "gap":
                self._lost(int(message["first"]) + int(message["count"]))
            elif kind == "error":
                problem = message["problem"]
                detail = f"{problem.get('detail') or problem.get('title')}"
                self._event("error", f"The server says: {detail}", problem=problem)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InvalidInput(f"the server's message `{kind}` lacks something: {error!r}", where="stream") from error

    def _lost(self, until: int) -> None:
        """Frames from the next one on, up to the one before `until`, will not come."""
        first, count = self._link.next, until - self._link.next
        if count > 0:
            self._link.next = until
            self.missing += count
            self._event("gap", f"Missing: frames {first} to {until - 1}.", first=first, count=count)

    def _update(self, stream: dict[str, Any]) -> None:
        self.stream = {**self.stream, **stream}
        state, position, reason = (self.stream.get(name) for name in ("state", "position", "reason"))
        if state != "live":
            self._pace.rest()
        if (state, position) != self._told:
            known = self._screen.live and state == self._told[0]  # the line that counts shows a position that changes
            self._told = (state, position)
            before = f", {position} before it" if state == "waiting" and position is not None else ""
            text = f"The stream {'' if state in OVER else 'is '}{state}{before}{f': {reason}' if reason else ''}."
            self._event("state", None if known else text, state=state, position=position, reason=reason)
        prompts = self.stream.get("prompts") or []
        for prompt in prompts[self._prompts :]:
            text = f"From frame {prompt['frame']} on: {prompt['prompt']}{_read_as(prompt)}"
            fields = ("number", "frame", "prompt", "rewritten", "not_rewritten")
            self._event("prompt", text, **{name: prompt[name] for name in fields if name in prompt})
        self._prompts = max(self._prompts, len(prompts))

    def _send(self) -> None:
        """What was typed, in order, and a stop once for each socket: one that was on its way when it broke is lost."""
        for line in self._lines.take():
            self._typed(line)
        if self._interrupts.count and not self._stopping:
            self._stopping = True
            self._outbox.clear()
            self._screen.say("Stopping; Ctrl-C again leaves at once.")
        now, stop = time.monotonic(), self._stopping and self._stopped_on != self._link.sockets
        if now - self._sent < MESSAGE_SECONDS or not (self._outbox or stop):
            return
        self._sent = now
        if not self._link.send(self._outbox[0] if self._outbox else {"kind": "stop"}):
            return
        if self._outbox:
            self._outbox.popleft()
        else:
            self._stopped_on = self._link.sockets

    def _typed(self, line: str) -> None:
        said = f"› {line.strip()}"
        try:
            message = message_of(line)
        except InvalidInput as error:
            message, said = None, f"Not sent: {error}"
        if message is not None and message["kind"] == "stop":
            self._stopping = True
        elif message is not None:
            self._outbox.append(message)
        if self._lines.typed or said.startswith("Not"):
            self._screen.say(said, typed=line if self._lines.typed else None)

    def _event(self, kind: str, text: str | None, **fields: Any) -> None:
        if self._as_json:
            console.result_json({"type": kind, "stream": self.stream["id"], **fields})
        if text is not None:
            self._screen.say(text)

    def _counter(self, waiting: int) -> Text:
        from rich.text import Text

        now, state = time.monotonic(), str(self.stream["state"])
        position, latency = self.stream.get("position"), self._pace.latency(now)
        shown = f"{state}, {position} before it" if state == "waiting" and position is not None else state
        prompts = [p["prompt"] for p in self.stream.get("prompts") or [] if p["number"] == self._prompt]
        parts = [
            f"{self.frames} frames",
            f"{self._pace.fps(now):.1f} fps",
            "latency –" if latency is None else f"latency {1000 * latency:.0f} ms",
            f"buffered {waiting}",
            f"gaps {self.missing}",
            f"prompt {self._prompt}: {prompts[0] if prompts else '…'}",
        ]
        style = STYLES.get(state, "")
        if not self._link.connected:
            shown, style = "no connection", "bold red"
        return Text.assemble((shown, style), "  ", "  ".join(parts))


def _read_as(prompt: dict[str, Any]) -> str:
    """What a rewriter made of a prompt, where there is something to tell."""
    rewritten, reason = prompt.get("rewritten"), prompt.get("not_rewritten")
    if rewritten is not None and rewritten != prompt["prompt"]:
        return f" (read as: {rewritten})"
    return "" if reason is None else f" (read as it is: {reason})"
