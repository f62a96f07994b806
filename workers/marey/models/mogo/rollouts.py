"""Motions that the model itself generates, as pasts of steered training motions (ours).

A steered session continues the model's own motion, not a captured one: an action that is long over, or an error. A
model trained on captures alone has never seen such a past; rollouts train it on the states that it reaches itself (Ross
et al. 2011, "A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning": DAgger).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.streaming import StreamBatch
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.motions import fingerprint
from marey.training.sentences import SentenceData

SESSIONS = 32
LEAST, MOST = 12, 130
"""Frames after which a rollout is steered: actions are over after 40 to 110, and a stream continues."""


@dataclass(frozen=True)
class Rollout:
    """Motion of one session under one prompt."""

    clip: int  # whose caption was the prompt
    tokens: Tensor  # (n, V) int64
    features: NDArray[np.float32]  # (n, D)


class Rollouts:
    """Sessions of a model in training, drawn as a stream draws them."""

    def __init__(self, model: RQHCTransformer, tokenizer: Tokenizer, captions: SentenceData, seed: int = 0) -> None:
        """Draw with `model` as it is now, from `captions` of single actions."""
        self.fingerprint = fingerprint(model)
        self._packed, self._tokenizer, self._captions = PackedModel(model), tokenizer, captions
        self._rng = np.random.default_rng(seed)

    @torch.inference_mode()
    def draw(self, clips: Sequence[int], most: int) -> Iterator[Rollout]:
        """Run one session per clip, prompted by one of the clip's captions, for up to `most` frames; yield them as they
        finish."""
        network = self._packed.network
        sentences = self._captions.sentences(self._captions.choose(np.asarray(clips), self._rng))
        frames = self._rng.integers(min(LEAST, most), min(MOST, most) + 1, len(clips)).tolist()
        streams, waiting = StreamBatch(self._packed, min(SESSIONS, len(clips))), list(range(len(clips)))[::-1]
        playing: dict[int, tuple[int, list[Tensor]]] = {}  # session to its clip and what it showed
        while waiting or playing:
            while waiting and len(playing) < streams.capacity:
                row = waiting.pop()
                lasts = network.natural_frames(sentences[row : row + 1])
                playing[streams.start(sentences[row], row, lasts=lasts)] = row, []
            for session, column in streams.step().items():
                row, columns = playing[session]
                columns.append(column)
                if len(columns) == frames[row]:
                    streams.stop(session)
                    del playing[session]
                    yield self._rollout(clips[row], torch.stack(columns))

    def _rollout(self, clip: int, tokens: Tensor) -> Rollout:
        return Rollout(clip, tokens, self._tokenizer.decode(tokens[None])[0].cpu().numpy())
