"""Sentence encoder `minilm`: all-MiniLM-L6-v2, 384-d (Reimers & Gurevych 2019, arXiv 1908.10084)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shared.text.encoders import WIDTHS, Encoding, weights_sha256
from shared.text.minilm import MAX_TOKENS, MiniLM
from shared.text.threads import one_thread


class MiniLMEncoder:
    """Mean of the last token states, normalised, as the model was trained; token states on the same scale."""

    name = "minilm"
    width = WIDTHS["minilm"]

    def __init__(self, folder: Path) -> None:
        self.sha256 = weights_sha256(folder)
        self._model = MiniLM(folder)

    @one_thread()
    def encode(self, text: str) -> Encoding:
        """Encode one text; tokens past 256 are left out."""
        encoded = self._model.tokenizer.encode(text)
        ids, offsets = encoded.ids, encoded.offsets
        if len(ids) > MAX_TOKENS:
            ids, offsets = [*ids[: MAX_TOKENS - 1], ids[-1]], [*offsets[: MAX_TOKENS - 1], (0, 0)]
        tokens: NDArray[np.float32] = self._model.states(ids)[-1].numpy()
        mean = tokens.mean(axis=0)
        norm = float(np.linalg.norm(mean))
        return Encoding(mean / norm, tokens / norm, tuple(offsets))
