"""Texts as one encoder encodes them, for several threads."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.text.encoders import Encoding, TextEncoder
from marey.text.kept_texts import KeptTexts
from marey.text.parsed import without_punctuation

KEPT_TEXTS = 8192
"""Sentence vectors that are kept: "a person" stands in half of all captions. 8192 x 768 x 4 B = 25 MB at most."""


class EncodedTexts:
    """Encodes one text, or many in few passes; the latest sentence vectors are kept."""

    def __init__(self, encoder: TextEncoder) -> None:
        self._encoder = encoder
        self._kept = KeptTexts[NDArray[np.float32]](KEPT_TEXTS)
        self._lock = threading.Lock()

    def encode(self, text: str) -> Encoding:
        """Encode one text."""
        with self._lock:
            return self._encoder.encode(text)

    def encodings(self, texts: Sequence[str]) -> list[Encoding]:
        """Encode texts in few passes."""
        with self._lock:
            return self._encoder.encodings(texts)

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """Return the sentence vectors (W,) of texts without the punctuation at their ends."""
        stripped = [without_punctuation(text) for text in texts]
        with self._lock:
            return self._kept.get(stripped, lambda missing: list(self._encoder.pooled(missing)))
