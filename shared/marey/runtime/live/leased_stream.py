"""A stream under this worker's lease: the loop adds to it and the supervisor records it."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from marey.motion.live_ending import LiveEnding
from marey.runtime.live.parsing import PromptParsing
from marey.runtime.live.port import LiveFrame, Tokens
from marey.streams import StreamChunk, StreamRow, StreamState
from marey.streams.actions import ActionStart
from marey.streams.control import ControlQueue, StreamControl
from marey.streams.frames import Frame
from marey.streams.presence import ViewerPresence
from marey.streams.redis import FrameStream, Lease
from marey.streams.rewrites import PromptRewrite
from marey.text.features import TextFeatures


@dataclass(eq=False)
class LeasedStream:
    """State of one stream.

    Attributes:
        text: features of the prompt in force.
        first_text: features of the first prompt.
        session: its id in the pool; None before it joined and after it left.
        read: id of the last read message; `applied`: of the last applied one.
        received: messages to apply, each with its id, in order; `parsing`: parsing of the first, if that is a steer.
        actions: starts of actions, of all prompts; `recorded_actions`: number of recorded ones.
        unwritten: frames to write to Redis.
        delayed: messages to apply after the replay of frames that another worker showed.
        reads: rewrites of prompts that are not recorded yet.
        shown: number of frames in Redis, including earlier ones: no token beyond them is recorded.
        recorded: number of recorded frames; `recorded_prompts`: of recorded prompts.
        ending: reason of its end; None while it continues.
        pose: that it ends on, as `StreamControl.pose`; None = it ends at once.
        passing: how its last frames pass into that pose; None = they do not, or it continues.
        seen: time of the last viewer, by the monotonic clock; `moved`: time when it was last not paused.
        lost: True if another worker has it.
    """

    row: StreamRow
    frames: FrameStream
    controls: ControlQueue
    presence: ViewerPresence
    lease: Lease
    text: TextFeatures
    first_text: TextFeatures
    tokens: list[Tokens]
    prompts: list[tuple[int, str]]
    seen: float
    moved: float
    read: str
    applied: str
    shown: int
    recorded: int
    recorded_prompts: int
    actions: list[ActionStart]
    reads: list[PromptRewrite]
    session: int | None = None
    received: deque[tuple[str, StreamControl]] = field(default_factory=deque[tuple[str, StreamControl]])
    parsing: PromptParsing | None = None
    unwritten: list[Frame] = field(default_factory=list[Frame])
    delayed: list[Callable[[], None]] = field(default_factory=list[Callable[[], None]])
    state: StreamState = StreamState.LIVE
    recorded_state: StreamState = StreamState.LIVE
    recorded_control: str = ""
    recorded_actions: int = 0
    ending: str | None = None
    pose: Mapping[str, Any] | None = field(default=None, repr=False)
    passing: LiveEnding | None = None
    lost: bool = False
    lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        self.state = self.recorded_state = self.row.state
        self.recorded_control = self.row.control
        self.recorded_actions = len(self.actions)

    @property
    def is_over(self) -> bool:
        """True once all frames are made that it is to have."""
        return self.ending is not None and (self.passing is None or len(self.tokens) > self.passing.last)

    @property
    def past(self) -> Tokens | None:
        """(n, V) tokens of every frame so far; None before the first."""
        return np.stack(self.tokens) if self.tokens else None

    @property
    def behind(self) -> bool:
        """True while it replays frames that another worker has shown."""
        return self.state is StreamState.LIVE and len(self.tokens) < self.lease.next_frame

    @property
    def playing(self) -> ActionStart | None:
        """Start of the current action of the prompt in force; None before the first frame of that prompt."""
        return self.actions[-1] if self.actions and self.actions[-1].frame >= self.prompts[-1][0] else None

    def add(self, made: LiveFrame) -> None:
        """Append a frame."""
        with self.lock:
            if self.playing is None or self.playing.action != made.action:
                self.actions.append(ActionStart(len(self.tokens), made.action))
            self.tokens.append(made.tokens)

    def steered(self, prompt: str, text: TextFeatures, control: str) -> None:
        """Set the prompt in force from the next frame on."""
        with self.lock:
            self.prompts.append((len(self.tokens), prompt))
            self.reads.append(PromptRewrite(text.rewritten, text.not_rewritten))
            self.text, self.applied = text, control

    def chunk(self) -> StreamChunk | None:
        """Return shown but unrecorded frames and changes; None if there are none."""
        with self.lock:
            stop = min(self.shown, len(self.tokens))
            tokens = self.tokens[self.recorded : stop]
            prompts = [(frame, text) for frame, text in self.prompts[self.recorded_prompts :] if frame < stop]
            actions = [action for action in self.actions[self.recorded_actions :] if action.frame < stop]
            changed = self.state is not self.recorded_state
            if not tokens and not changed:
                return None
            content = np.stack(tokens).astype("<i2").tobytes() if tokens else b""
            # A successor reads the message again whose prompt waits for its first frame.
            waits = len(self.prompts) > self.recorded_prompts + len(prompts)
            control = self.recorded_control if waits else self.applied
            state = self.state if changed else None
            reads = self.reads[: len(prompts)]
            return StreamChunk(self.recorded, len(tokens), content, prompts, control, state, actions, reads)

    def wrote(self, chunk: StreamChunk) -> None:
        """Mark a chunk as recorded."""
        with self.lock:
            self.recorded_control = chunk.control
            self.recorded += chunk.frames
            self.recorded_prompts += len(chunk.prompts)
            del self.reads[: len(chunk.prompts)]
            self.recorded_actions += len(chunk.actions)
            self.recorded_state = chunk.state or self.recorded_state
