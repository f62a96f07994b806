"""Live sessions of one bundle: prompts in, finished frames out; all sessions advance together, one frame per step.

A session has three kinds of state, each with a row per session: keys and values of the transformer (`StreamBatch`), the
past of the causal decoder, and root, poses and feet of the body (`marey.motion.live`). To resume a session after
its worker died, its tokens, its prompts and the starts of their actions must be kept elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import choose_live_bundle
from marey.core.errors import InvalidBundle, InvalidInput
from marey.core.settings import settings as configuration
from marey.generation.port import Request
from marey.models.mogo.bundle import MODEL
from marey.models.mogo.generate import Generator, SamplingSettings
from marey.models.mogo.streaming import StreamBatch
from marey.models.mogo.tokenizer import DecoderState
from marey.motion.features import HeadingLayout
from marey.motion.live import LiveMotion, LiveState
from marey.nn.packed import is_small
from marey.runtime.live.port import LiveFrame, LiveModel
from marey.streams.actions import ActionStart
from marey.streams.frames import Frame
from marey.text.features import TextFeatures
from marey.text.graph import Node, SemanticGraph
from marey.text.keys import as_served
from marey.text.pipeline import TextPipeline

WARM_CALLS = 3
"""Compiled code records two calls and is captured in the third."""


@dataclass
class _Session:
    """Number of shown frames, number of the prompt in force, and the session's index among the streams."""

    shown: int
    prompt: int
    stream: int


@dataclass(frozen=True)
class _Paused:
    """Complete state of a session that is excluded from steps."""

    stream: dict[str, torch.Tensor]
    decoded: DecoderState
    body: LiveState


class LiveSessionPool:
    """Sessions of one loaded bundle; they join, are steered and leave between frames. Not thread-safe."""

    def __init__(self, generator: Generator, capacity: int, settings: SamplingSettings | None = None) -> None:
        """Allocate `capacity` sessions, all sampled with the same settings.

        Raises:
            InvalidBundle: a layout whose root cannot be computed frame by frame.
            InvalidInput: settings out of range.
        """
        if not isinstance(generator.layout, HeadingLayout):
            where = str(generator.bundle.path)
            raise InvalidBundle(f"layout {generator.layout.name!r} has no live decoder", where=where)
        self.generator = generator
        inference = (settings or SamplingSettings()).inference(generator.config.inference)
        self.capacity = capacity
        self._streams = StreamBatch(generator.packed(capacity), capacity, inference)
        self._streams.prepare()
        self._motion = LiveMotion(generator.layout)
        self.skeleton = self._motion.skeleton
        self._rows: list[int] = []  # session of each row of the two states below
        self._decoded = generator.tokenizer.decoder.start(0)
        self._body = self._motion.start(0)
        self._sessions: dict[int, _Session] = {}
        self._paused: dict[int, _Paused] = {}
        self._started = 0

    def __len__(self) -> int:
        return len(self._sessions)

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.generator.limits.fps

    @property
    def bundle(self) -> str:
        """The exact bundle."""
        return self.generator.bundle.reference

    @property
    def model(self) -> str:
        """The queue that makes clips of recordings."""
        return MODEL

    @property
    def min_frames(self) -> int:
        """Length of the shortest clip, in frames."""
        return self.generator.limits.min_frames

    @property
    def levels(self) -> int:
        """V, codes per frame."""
        return self.generator.config.tokenizer.levels

    def start(
        self,
        text: TextFeatures,
        seed: int,
        *,
        past: NDArray[np.int16] | None = None,
        prompt: int = 0,
        began: ActionStart | None = None,
    ) -> int:
        """Start a session, or resume one of another worker.

        Args:
            text: features of the prompt in force.
            seed: seed of its random numbers.
            past: (n, V) tokens of all its frames so far: it continues behind them without a jump.
            prompt: number of the prompt in force, counted from 0.
            began: its current action, with its start; None = the first one starts now.

        Returns:
            the id of the session for all other methods.

        Raises:
            InvalidInput: no free slot, features of another encoder, a seed out of range, invalid tokens, or an
                action that the prompt does not have.
        """
        self.generator.limits.check(Request(text, seed))
        if len(self) == self.capacity:  # paused ones keep their slot
            raise InvalidInput(f"all {self.capacity} sessions are taken", hint="Stop one first.")
        decoder = self.generator.tokenizer.decoder.start(1)
        body = self._motion.start(1)
        columns = None
        if past is not None and len(past):
            columns = self.generator.columns(past)
            features, decoder = self.generator.tokenizer.decode_next(columns[None], decoder)
            body = self._motion.after(features[0].cpu().numpy())
        actions, lasts = self.generator.actions(text)
        stream = self._streams.start(actions, seed, lasts=lasts, past=columns, began=began)
        self._started += 1
        self._sessions[self._started] = _Session(0 if columns is None else len(columns), prompt, stream)
        self._join(self._started, decoder, body)
        return self._started

    def steer(self, session: int, text: TextFeatures) -> None:
        """Set another prompt, in force from the next frame on.

        Raises:
            InvalidInput: no such session, it is paused, or features of another encoder.
        """
        self.generator.limits.check(Request(text, 0))
        about = self._playing(session)
        self._streams.steer(about.stream, *self.generator.actions(text))
        about.prompt += 1

    def stop(self, session: int) -> None:
        """Remove a session, paused or not.

        Raises:
            InvalidInput: unknown session.
        """
        if session not in self._paused:
            self._streams.stop(self._playing(session).stream)
            self._leave(session)
        self._paused.pop(session, None)
        del self._sessions[session]

    def pause(self, session: int) -> None:
        """Exclude a session from steps until `resume`; its slot stays reserved.

        Raises:
            InvalidInput: no such session, or it is paused.
        """
        about = self._playing(session)
        row = self._rows.index(session)
        decoded, body = self._decoded.select(torch.tensor([row])), self._body.take([row])
        self._paused[session] = _Paused(self._streams.save(about.stream), decoded, body)
        self._streams.stop(about.stream)
        self._leave(session)

    def resume(self, session: int) -> None:
        """Resume a paused session, with the same frames that it would have shown.

        Raises:
            InvalidInput: it is not paused.
        """
        if session not in self._paused:
            raise InvalidInput(f"session {session} is not paused")
        kept = self._paused.pop(session)
        self._sessions[session].stream = self._streams.resume(kept.stream)
        self._join(session, kept.decoded, kept.body)

    @torch.inference_mode()
    def catch_up(self, session: int, frames: int) -> list[LiveFrame]:
        """Return the next frames of one session alone, at once; the other sessions stand still meanwhile.

        Raises:
            InvalidInput: no such session, or it is paused.
        """
        stream = self._playing(session).stream
        row = self._rows.index(session)
        decoded, body = self._decoded.select(torch.tensor([row])), self._body.take([row])
        self._leave(session)
        others = self._rows, self._decoded, self._body
        self._rows, self._decoded, self._body = [session], decoded, body
        made = [self._shown(self._streams.step(stream))[session] for _ in range(frames)]
        decoded, body = self._decoded, self._body
        self._rows, self._decoded, self._body = others
        self._join(session, decoded, body)
        return made

    @torch.inference_mode()
    def step(self) -> dict[int, LiveFrame]:
        """Return the next frame of every session that is not paused."""
        drawn = self._streams.step()
        return self._shown(drawn) if drawn else {}

    def _shown(self, drawn: Mapping[int, torch.Tensor]) -> dict[int, LiveFrame]:
        """Return frames of the columns that were drawn for the sessions in the rows."""
        columns = torch.stack([drawn[self._sessions[session].stream] for session in self._rows])  # (S, V)
        features, self._decoded = self.generator.tokenizer.decode_next(columns[:, None], self._decoded)
        shown, self._body = self._motion.step(features[:, 0].cpu().numpy(), self._body)
        tokens = columns.cpu().numpy().astype(np.int16)
        frames: dict[int, LiveFrame] = {}
        for row, session in enumerate(self._rows):
            about = self._sessions[session]
            left, left_toe, right, right_toe = shown.contacts[row].tolist()
            stands = (left, left_toe, right, right_toe)
            frame = Frame(about.shown, shown.root[row], shown.rotations[row], stands, about.prompt)
            frames[session] = LiveFrame(frame, tokens[row], self._streams.action(about.stream))
            about.shown += 1
        return frames

    def _playing(self, session: int) -> _Session:
        if session not in self._sessions:
            raise InvalidInput(f"unknown session {session}", hint="It was stopped, or never started.")
        if session in self._paused:
            raise InvalidInput(f"session {session} is paused", hint="Resume it first.")
        return self._sessions[session]

    def _join(self, session: int, decoded: DecoderState, body: LiveState) -> None:
        self._rows.append(session)
        self._decoded = DecoderState.join((self._decoded, decoded))
        self._body = LiveState.join((self._body, body))

    def _leave(self, session: int) -> None:
        kept = [row for row, name in enumerate(self._rows) if name != session]
        self._rows = [self._rows[row] for row in kept]
        self._decoded = self._decoded.select(torch.tensor(kept, dtype=torch.long))
        self._body = self._body.take(kept)


def create_live_model() -> LiveModel:
    """Load the live model of `marey worker mogo`: see `choose_live_bundle`.

    Raises:
        NotFound, InvalidBundle, Refused: there is none, a broken one, or one whose terms the settings refuse.
    """
    chosen = configuration()
    bundle = choose_live_bundle(MODEL, config=chosen)
    if bundle.manifest.text is None:
        raise InvalidBundle("it does not read prompts", where=str(bundle.path))
    generator = Generator.load(bundle, device=chosen.device, threads=chosen.threads)
    if is_small(generator.transformer):
        torch.set_num_threads(1)  # two threads wait for each other longer than they work, the more so on a busy machine
    pipeline = TextPipeline.load(as_served(bundle.manifest.text))
    return LiveModel(
        open_pool=lambda slots: _warm(LiveSessionPool(generator, slots), pipeline),
        parse=lambda prompt: pipeline.features([prompt])[0],
        device=str(generator.device),
    )


def _warm(pool: LiveSessionPool, pipeline: TextPipeline) -> LiveSessionPool:
    """Run the pool once, so that its first frames do not wait for torch's one-time work. No rewriter is called: it may
    cost money."""
    words = ("a", "person", "stands")
    graph = SemanticGraph(" ".join(words), words, (Node(0, "motion", " ".join(words), (0, 1, 2)),), ())
    session = pool.start(TextFeatures(graph.text, graph.text, graph, pipeline.encode(graph)), 0)
    for _ in range(WARM_CALLS):
        pipeline.labeller.label([words])
        pool.step()
    pool.stop(session)
    return pool
