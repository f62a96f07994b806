"""Live sessions of one bundle: prompts in, finished frames out; all sessions move on together, one frame a step.

A session goes through three kinds of state, each with a row for every session: keys and values of the transformer
(`Streams`), the past of the causal decoder, and root, poses and feet of the body (`shared.motion.live`). What a session
must keep elsewhere, to go on after its worker died, are its tokens and prompts alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from shared.errors import InvalidBundle, InvalidInput
from shared.motion.features import HeadingLayout
from shared.motion.live import LiveMotion, LiveState
from shared.streams.frames import Frame
from shared.text.features import TextFeatures
from workers.generating.port import Request
from workers.mogo.generate import Generator, Settings
from workers.mogo.streaming import Streams
from workers.mogo.tokenizer import DecoderState


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What a step gives for a session."""

    frame: Frame
    tokens: NDArray[np.int16]
    """(V,): the column it was decoded from."""


@dataclass
class _Session:
    """Frames shown, and the number of the prompt in force."""

    shown: int
    prompt: int


class LiveRoom:
    """Sessions of one loaded bundle; they join, are steered and leave between frames. Not thread-safe."""

    def __init__(self, generator: Generator, capacity: int, settings: Settings | None = None) -> None:
        """Make room for `capacity` sessions, all drawn with the same settings.

        Raises:
            InvalidBundle: a layout whose root cannot be followed frame by frame.
            InvalidInput: settings out of range.
        """
        if not isinstance(generator.layout, HeadingLayout):
            where = str(generator.bundle.path)
            raise InvalidBundle(f"layout {generator.layout.name!r} has no live decoder", where=where)
        self.generator = generator
        inference = (settings or Settings()).inference(generator.config.inference)
        self.skeleton = generator.layout.skeleton
        self._streams = Streams(generator.transformer, capacity, inference, dtype=generator.dtype)
        self._motion = LiveMotion(generator.layout, self.skeleton)
        self._rows: list[int] = []  # the session in each row of the two states below
        self._decoded = generator.tokenizer.decoder.start(0)
        self._body = self._motion.start(0)
        self._sessions: dict[int, _Session] = {}

    def __len__(self) -> int:
        return len(self._rows)

    def start(self, text: TextFeatures, seed: int, *, past: NDArray[np.int16] | None = None, prompt: int = 0) -> int:
        """A new session, or one that another worker began.

        Args:
            text: of the prompt in force.
            seed: of its random numbers.
            past: (n, V) tokens of all its frames so far: it goes on behind them, continuous with what was shown.
            prompt: number of the prompt in force, counted from 0.

        Returns:
            the session's name in all other methods.

        Raises:
            InvalidInput: no room, features of another encoder, a seed out of range, or tokens that are none.
        """
        self.generator.limits.check(Request(text, seed))
        decoder = self.generator.tokenizer.decoder.start(1)
        body = self._motion.start(1)
        columns = None
        if past is not None and len(past):
            columns = self._columns(past)
            features, decoder = self.generator.tokenizer.decode_next(columns[None], decoder)
            body = self._motion.after(features[0].cpu().numpy())
        session = self._streams.start(self._sentence(text), seed, past=columns)
        self._rows.append(session)
        self._decoded = DecoderState.join((self._decoded, decoder))
        self._body = LiveState.join((self._body, body))
        self._sessions[session] = _Session(0 if columns is None else len(columns), prompt)
        return session

    def steer(self, session: int, text: TextFeatures) -> None:
        """Another prompt, in force from the next frame on.

        Raises:
            InvalidInput: no such session, or features of another encoder.
        """
        self.generator.limits.check(Request(text, 0))
        self._streams.steer(session, self._sentence(text))
        self._sessions[session].prompt += 1

    def stop(self, session: int) -> None:
        """Forget a session.

        Raises:
            InvalidInput: there is none of that name.
        """
        self._streams.stop(session)
        kept = [row for row, name in enumerate(self._rows) if name != session]
        self._rows = [self._rows[row] for row in kept]
        self._decoded = self._decoded.select(torch.tensor(kept, dtype=torch.long))
        self._body = self._body.take(kept)
        del self._sessions[session]

    @torch.inference_mode()
    def step(self) -> dict[int, LiveFrame]:
        """The next frame of every session."""
        drawn = self._streams.step()
        if not drawn:
            return {}
        columns = torch.stack([drawn[session] for session in self._rows])  # (S, V)
        features, self._decoded = self.generator.tokenizer.decode_next(columns[:, None], self._decoded)
        shown, self._body = self._motion.step(features[:, 0].cpu().numpy(), self._body)
        tokens = columns.cpu().numpy().astype(np.int16)
        frames: dict[int, LiveFrame] = {}
        for row, session in enumerate(self._rows):
            about = self._sessions[session]
            left, left_toe, right, right_toe = shown.contacts[row].tolist()
            stands = (left, left_toe, right, right_toe)
            frame = Frame(about.shown, shown.root[row], shown.rotations[row], stands, about.prompt)
            frames[session] = LiveFrame(frame, tokens[row])
            about.shown += 1
        return frames

    def _sentence(self, text: TextFeatures) -> torch.Tensor:
        return torch.from_numpy(text.sentence.astype(np.float32)).to(self.generator.device)

    def _columns(self, past: NDArray[np.int16]) -> torch.Tensor:
        config = self.generator.config.tokenizer
        if past.ndim != 2 or past.shape[1] != config.levels or past.min() < 0 or past.max() >= config.codes:
            wanted = f"(n, {config.levels}) codes from 0 to {config.codes - 1}"
            raise InvalidInput(f"the past of a session is {past.shape}, not {wanted}", where="past")
        return torch.from_numpy(past.astype(np.int64)).to(self.generator.device)
