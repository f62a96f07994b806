"""Sentence encoder `minilm`: all-MiniLM-L6-v2, 384-d (Reimers & Gurevych 2019, arXiv 1908.10084)."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from torch import Tensor

from marey.bundles import Bundle
from marey.nn.threads import one_thread
from marey.text.encoders import WIDTHS, Encoding
from marey.text.minilm import MAX_TOKENS, MiniLM

MAX_TEXTS = 32
"""Texts of one pass: more gain nothing, and the longest take 100 MB."""


class MiniLMEncoder:
    """Mean of the last token states, normalised, as the model was trained; token states on the same scale."""

    name = "minilm"
    width = WIDTHS["minilm"]

    def __init__(self, bundle: Bundle) -> None:
        self.sha256 = bundle.weights_sha256
        self._model = MiniLM(bundle)

    def tuned(self, updates: Mapping[str, Tensor]) -> MiniLMEncoder:
        """Return this encoder with low-rank updates beside its matrices, which are shared (`MiniLM.tuned`)."""
        other = copy.copy(self)
        other._model = self._model.tuned(updates)
        return other

    @one_thread()
    def encode(self, text: str) -> Encoding:
        """Encode one text; tokens past 256 are left out."""
        ids, offsets = self._ids(text)
        return _encoding(self._model.last([ids])[0].numpy(), offsets)

    @one_thread()
    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """Encode texts, the tokens of many in one pass."""
        means = [tokens.mean(axis=0) for tokens in self._last([self._ids(text)[0] for text in texts])]
        return [mean / float(np.linalg.norm(mean)) for mean in means]

    @one_thread()
    def encodings(self, texts: Sequence[str]) -> list[Encoding]:
        """Encode texts, the tokens of many in one pass."""
        read = [self._ids(text) for text in texts]
        found = self._last([ids for ids, _ in read])
        return [_encoding(tokens, offsets) for tokens, (_, offsets) in zip(found, read, strict=True)]

    def _last(self, texts: Sequence[list[int]]) -> Iterator[NDArray[np.float32]]:
        for low in range(0, len(texts), MAX_TEXTS):
            yield from (tokens.numpy() for tokens in self._model.last(texts[low : low + MAX_TEXTS]))

    def _ids(self, text: str) -> tuple[list[int], list[tuple[int, int]]]:
        encoded = self._model.tokenizer.encode(text)
        if len(encoded.ids) <= MAX_TOKENS:
            return encoded.ids, encoded.offsets
        return [*encoded.ids[: MAX_TOKENS - 1], encoded.ids[-1]], [*encoded.offsets[: MAX_TOKENS - 1], (0, 0)]


def _encoding(tokens: NDArray[np.float32], offsets: Sequence[tuple[int, int]]) -> Encoding:
    """Return the encoding of a text from its last token states (T, W)."""
    mean = tokens.mean(axis=0)
    norm = float(np.linalg.norm(mean))
    return Encoding(mean / norm, tokens / norm, tuple(offsets))
