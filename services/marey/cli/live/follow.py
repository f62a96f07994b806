"""Following one live stream from its beginning to its end."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from marey.cli import console
from marey.cli.live.pace import Pace
from marey.cli.live.screen import Screen
from marey.cli.live.steering import HELP, Command, Interrupts, StdinLines, command_of
from marey.client import Frame, FramesMissing, StreamChanged, StreamProblem
from marey.core.errors import Conflict, InvalidInput, MareyError

if TYPE_CHECKING:
    from rich.text import Text

    from marey.client import LiveStream, StreamDetail, StreamPrompt

TICK = 0.1
"""Seconds to wait for an update; typed lines are sent with that delay while no frames arrive."""
MESSAGE_SECONDS = 0.1
"""Seconds between two messages, so that the server does not take a file piped into stdin for a flood."""
DEFAULT_FPS = 20.0
STYLES = {"live": "bold green", "waiting": "yellow", "paused": "yellow"}
PROMPT_FIELDS = ("number", "frame", "prompt", "rewritten", "not_rewritten", "warnings")


class Follower:
    """Follows a stream: reports its events, and sends what the user types.

    Args:
        live: the stream.
        pose: that the stream ends on when it is stopped; see `LiveStream.stop`.
        as_json: also print each event as a line of JSON on stdout.

    Attributes:
        frames: number of frames up to the last one that arrived, missing ones included.
    """

    def __init__(
        self, live: LiveStream, interrupts: Interrupts, *, pose: Mapping[str, Any] | None = None, as_json: bool
    ) -> None:
        self.frames = 0
        self._live = live
        self._interrupts = interrupts
        self._pose = pose
        self._as_json = as_json
        self._screen = Screen()
        self._lines = StdinLines()
        self._pace = Pace(live.stream.fps or DEFAULT_FPS)
        self._outbox: deque[Command] = deque()
        self._sent = 0.0
        self._stopping = False
        self._stopped_on = 0  # the connection that took the stop
        self._accepted = False  # the server has answered a stop on a pose
        self._broken_on: int | None = None  # number of connections when the last break was reported
        self._reported: tuple[str | None, int | None, str | None] = (None, None, None)  # state, position, waits_for
        self._prompts = 0  # how many were reported
        self._prompt = 0  # number of the current one

    def run(self) -> None:
        """Follow the stream until it has ended.

        Raises:
            MareyError: the server cannot be reached any more, or the file cannot be written; the stream is asked to
                stop.
            KeyboardInterrupt: the second Ctrl-C.
        """
        try:
            self._update(self._live.stream)
            if self._lines.typed:
                self._screen.say(HELP)
            while not self._live.has_ended:
                self._turn()
        except (MareyError, BrokenPipeError):
            self._live.try_send("stop")
            raise
        finally:
            self._screen.close()
            self._live.close()

    def result(self) -> dict[str, Any]:
        """Return the output line of the stream."""
        stream, path = self._live.stream.raw, self._live.recorded
        return {
            "stream": stream["id"],
            "job": stream.get("job"),
            "state": stream["state"],
            "reason": stream.get("reason"),
            "frames": self.frames,
            "fps": stream.get("fps"),
            "gaps": self._live.missing,
            "prompts": stream.get("prompts") or [],
            "file": None if path is None else str(path),
        }

    def _turn(self) -> None:
        self._send()
        update = self._live.receive(TICK)
        if self._broken_on not in (None, self._live.connections):
            self._broken_on = None
            self._screen.say("Connected again.")
        if isinstance(update, Frame):
            self.frames = update.number + 1
            self._prompt = update.prompt
            self._pace.arrived(update.number, time.monotonic())
        elif update is not None:
            self._report(update)
        if self._screen.due():
            self._screen.count(self._counter())
        ended = self._live.has_ended or self._live.stream.has_ended  # the server closes the connection of an ended one
        if update is None and not (self._live.connected or ended) and self._broken_on is None:
            self._broken_on = self._live.connections
            self._screen.say("No connection; trying again.")

    def _report(self, update: StreamChanged | FramesMissing | StreamProblem) -> None:
        if isinstance(update, StreamChanged):
            self._update(update.stream)
        elif isinstance(update, FramesMissing):
            first, count = update.first, update.count
            self._event("gap", f"Missing: frames {first} to {first + count - 1}.", first=first, count=count)
        else:
            self._event("error", f"The server says: {update.error.message}", problem=update.raw)

    def _update(self, stream: StreamDetail) -> None:
        state, position, reason = stream.state, stream.position, stream.reason
        if state != "live":
            self._pace.rest()
        if (state, position, stream.waits_for) != self._reported:
            # The status line shows a position that changes.
            known = self._screen.live and (state, stream.waits_for) == (self._reported[0], self._reported[2])
            self._reported = (state, position, stream.waits_for)
            before = f", {position} before it" if state == "waiting" and position is not None else ""
            text = f"The stream {'' if stream.has_ended else 'is '}{state}{before}{f': {reason}' if reason else ''}."
            if stream.waits_for == "worker":
                text += f"\nNo live worker has loaded {stream.bundle}, so it waits for one (`MAREY_LIVE_MODEL`)."
            fields = {"state": state, "position": position, "waits_for": stream.waits_for, "reason": reason}
            self._event("state", None if known else text, **fields)
        for prompt in stream.prompts[self._prompts :]:
            text = f"From frame {prompt.frame} on: {prompt.prompt}{_rewritten(prompt)}"
            text = "\n".join([text, *(f"Warning: {warning}" for warning in prompt.warnings)])
            self._event("prompt", text, **{name: prompt.raw[name] for name in PROMPT_FIELDS if name in prompt.raw})
        self._prompts = max(self._prompts, len(stream.prompts))

    def _send(self) -> None:
        """Send typed lines in order, and a stop once for each connection: one that broke may not have delivered it."""
        for line in self._lines.take():
            self._handle_line(line)
        if self._interrupts.count and not self._stopping:
            self._stopping = True
            self._outbox.clear()
            self._screen.say("Stopping; Ctrl-C again leaves at once.")
        now, stopped = time.monotonic(), self._accepted or self._stopped_on == self._live.connections
        stop = self._stopping and not stopped
        if now - self._sent < MESSAGE_SECONDS or not (self._outbox or stop):
            return
        self._sent = now
        if not self._outbox and self._pose is not None:
            self._stop_on(self._pose)
            return
        command = self._outbox[0] if self._outbox else Command("stop")
        if not self._live.try_send(command.kind, command.prompt):
            return
        if self._outbox:
            self._outbox.popleft()
        else:
            self._stopped_on = self._live.connections

    def _stop_on(self, pose: Mapping[str, Any]) -> None:
        """Send the stop with the pose, once for all connections: the answer says that the server has it."""
        self._pose, self._accepted = None, True
        with suppress(Conflict):  # it has ended by itself
            self._live.stop(pose)

    def _handle_line(self, line: str) -> None:
        shown = f"› {line.strip()}"
        try:
            command = command_of(line)
        except InvalidInput as error:
            command, shown = None, f"Not sent: {error}"
        if command is not None and command.kind == "stop":
            self._stopping = True
        elif command is not None:
            self._outbox.append(command)
        if self._lines.typed or shown.startswith("Not"):
            self._screen.say(shown, typed=line if self._lines.typed else None)

    def _event(self, kind: str, text: str | None, **fields: Any) -> None:
        if self._as_json:
            console.result_json({"type": kind, "stream": self._live.stream.id, **fields})
        if text is not None:
            self._screen.say(text)

    def _counter(self) -> Text:
        """Return the status line."""
        from rich.text import Text

        now, stream = time.monotonic(), self._live.stream
        state, position, latency = stream.state, stream.position, self._pace.latency(now)
        shown = f"{state}, {position} before it" if state == "waiting" and position is not None else state
        prompts = [prompt.prompt for prompt in stream.prompts if prompt.number == self._prompt]
        parts = [
            f"{self.frames} frames",
            f"{self._pace.fps(now):.1f} fps",
            "latency –" if latency is None else f"latency {1000 * latency:.0f} ms",
            f"buffered {self._live.buffered}",
            f"gaps {self._live.missing}",
            f"prompt {self._prompt}: {prompts[0] if prompts else '…'}",
        ]
        style = STYLES.get(state, "")
        if not self._live.connected:
            shown, style = "no connection", "bold red"
        return Text.assemble((shown, style), "  ", "  ".join(parts))


def _rewritten(prompt: StreamPrompt) -> str:
    """Describe the rewritten form of a prompt, if it differs."""
    if prompt.rewritten is not None and prompt.rewritten != prompt.prompt:
        return f" (read as: {prompt.rewritten})"
    return "" if prompt.not_rewritten is None else f" (read as it is: {prompt.not_rewritten})"
