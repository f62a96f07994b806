"""Motion as the model itself makes it, to be left at any moment (ours).

A session that is steered shows what the model drew, not what was captured: an act that is long over, a slip. A model
that learned from captures alone has never seen that past; here it learns what to do from where it gets by itself
(Ross et al. 2011, "A Reduction of Imitation Learning and Structured Prediction to No-Regret Online Learning": DAgger).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from workers.mogo.model import RQHCTransformer
from workers.mogo.packed_model import PackedModel
from workers.mogo.streaming import Streams
from workers.mogo.tokenizer import Tokenizer
from workers.training.motions import fingerprint
from workers.training.sentences import SentenceData

SESSIONS = 32
LEAST, MOST = 12, 130
"""Frames after which a session is left: acts are over after 40 to 110, and a stream plays on."""


@dataclass(frozen=True)
class Rollout:
    """What a session showed of one prompt."""

    clip: int  # whose caption was the prompt
    tokens: Tensor  # (n, V) int64
    features: NDArray[np.float32]  # (n, D)


class Rollouts:
    """Sessions of a model that is being trained, as a stream would play them."""

    def __init__(self, model: RQHCTransformer, tokenizer: Tokenizer, captions: SentenceData, seed: int = 0) -> None:
        """Draw with `model` as it is now, from `captions` of single acts."""
        self.fingerprint = fingerprint(model)
        self._packed, self._tokenizer, self._captions = PackedModel(model), tokenizer, captions
        self._rng = np.random.default_rng(seed)

    @torch.inference_mode()
    def draw(self, clips: Sequence[int], most: int) -> Iterator[Rollout]:
        """A session for each clip, of `most` frames at most: one of its captions is the prompt."""
        chosen = self._captions.choose(np.asarray(clips), self._rng)
        for start in range(0, len(clips), SESSIONS):
            some = self._captions.sentences(chosen[start : start + SESSIONS])
            frames: NDArray[np.int64] = self._rng.integers(min(LEAST, most), min(MOST, most) + 1, len(some))
            for row, columns in enumerate(self._play(some, start, frames)):
                features = self._tokenizer.decode(columns[None])[0].cpu().numpy()
                yield Rollout(int(clips[start + row]), columns, features)

    def _play(self, sentences: Tensor, seed: int, frames: NDArray[np.int64]) -> list[Tensor]:
        """Columns (n, V) of each session, `frames` long."""
        streams = Streams(self._packed, len(sentences))
        lasts = self._packed.network.pace(self._packed.network.prompt.standardised(sentences)).tolist()
        names = [
            streams.start(sentence, seed + row, lasts=[last])
            for row, (sentence, last) in enumerate(zip(sentences, lasts, strict=True))
        ]
        columns: dict[int, list[Tensor]] = {name: [] for name in names}
        for _ in range(int(frames.max())):
            for name, column in streams.step().items():
                columns[name].append(column)
        return [torch.stack(columns[name][:count]) for name, count in zip(names, frames.tolist(), strict=True)]
