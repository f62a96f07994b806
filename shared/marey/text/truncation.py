"""Token states of texts for models that were trained with fewer tokens than their text encoder reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.text.encoders import TextEncoder


def truncated_tokens(encoder: TextEncoder, texts: Sequence[str], limit: int) -> list[NDArray[np.float32]]:
    """Return the states (T, W) of each text, special tokens included, T at most `limit`.

    A longer text is cut behind the last token that fits and encoded again, as tokenizers truncate: the end token
    follows, and no state has read what is left out.
    """
    found = [encoding.tokens for encoding in encoder.encodings(texts)]
    return [
        states if len(states) <= limit else _cut(encoder, text, limit)
        for text, states in zip(texts, found, strict=True)
    ]


def _cut(encoder: TextEncoder, text: str, limit: int) -> NDArray[np.float32]:
    encoding = encoder.encode(text)
    special = sum(start == stop for start, stop in encoding.offsets)
    ends = [stop for start, stop in encoding.offsets if stop > start]
    for count in range(limit - special, 0, -1):  # once; but a cut word may become more tokens
        states = encoder.encode(text[: ends[count - 1]]).tokens
        if len(states) <= limit:
            return states
    return encoding.tokens[:limit]
