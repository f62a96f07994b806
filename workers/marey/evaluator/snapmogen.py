"""SnapMoGen's published evaluator: strings and raw features in, mean vectors out, compared by cosine.

It has never run with the public weights; its networks are compared with numbers of the published classes. To compare
first, once there are weights: the row of real data on SnapMoGen's test split, R@1 .940, R@2 .976, R@3 .985, CLIP score
.837. Our FID is that of mean vectors, as all evaluators here have; the paper's is that of `raw`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from marey.evaluator.snapmogen_model import MAX_WORDS
from marey.evaluator.tmr import TMREvaluator
from marey.nn.packed import pack_linears
from marey.text.truncation import truncated_tokens


class SnapMoGenEvaluator(TMREvaluator):
    """A loaded bundle, as `marey models import snapmogen-evaluator` writes it. Not thread-safe."""

    def _pack(self) -> None:
        super()._pack()
        pack_linears(self.motion)  # the heads
        pack_linears(self.text)

    def _states(self, sentences: Sequence[str]) -> list[Tensor]:
        """Return the states (S, W) float32 of each sentence, S at most `MAX_WORDS`."""
        return [torch.from_numpy(states) for states in truncated_tokens(self.encoder, sentences, MAX_WORDS)]
