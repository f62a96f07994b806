"""TMR's published evaluator (Petrovich et al. 2023): strings and raw features in, mean vectors out, compared by cosine.

Its networks are those of `marey.evaluator.model` at its sizes: all 263 features of a frame, one token a frame. Motions
are normalised with the statistics of its training data, which are not those of HumanML3D's `Mean.npy` and `Std.npy`.
It has never run with the public weights; a first check, once there are some, is in `marey.evaluator.tmr_import`.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from marey.evaluator.bundle import PUBLISHED
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.tmr import TMREvaluator

MODEL = PUBLISHED
ENCODER = "distilbert-base-uncased"
PUBLIC = EvaluatorConfig(
    name="public",
    inputs=263,
    max_frames=200,  # trained on clips of 2 to 10 s
    text_width=768,  # DistilBERT
)
"""The published configuration; the sizes of the networks come from the file beside the weights."""


class PublishedTMREvaluator(TMREvaluator):
    """A loaded bundle, as `marey models import tmr` writes it. Not thread-safe."""

    def _states(self, sentences: Sequence[str]) -> list[Tensor]:
        """Return the states (S, W) float32 of each sentence: ours are trained on float16, the published ones not."""
        return [torch.from_numpy(encoding.tokens) for encoding in self.encoder.encodings(sentences)]
