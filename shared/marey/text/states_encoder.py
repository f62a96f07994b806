"""Text encoders of `transformers` whose token states are read as they are, T5 and DistilBERT."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from marey.nn.threads import one_thread
from marey.text.encoders import WIDTHS, Encoding, weights_sha256
from marey.text.pretrained import load_pretrained

MAX_TOKENS = 512


class StatesEncoder:
    """Token states of a frozen encoder; pooled = their mean, special tokens included."""

    def __init__(self, name: str, folder: Path, kind: Any) -> None:
        """Load the tokenizer, and the weights as a class of `transformers`.

        Raises:
            InvalidFile: the folder cannot be loaded, or a weight is missing.
        """
        from transformers import AutoTokenizer

        self.name = name
        self.width = WIDTHS[name]
        self.sha256 = weights_sha256(folder)
        self._tokenizer: Any = load_pretrained(AutoTokenizer, folder)
        self._model: Any = load_pretrained(kind, folder, weights=True)

    @one_thread()
    @torch.inference_mode()
    def encode(self, text: str) -> Encoding:
        """Encode one text; tokens past 512 are left out."""
        inputs = self._tokenizer(
            text, truncation=True, max_length=MAX_TOKENS, return_offsets_mapping=True, return_tensors="pt"
        )
        offsets = tuple((int(a), int(b)) for a, b in inputs.pop("offset_mapping")[0].tolist())
        tokens = self._model(**inputs).last_hidden_state[0]
        return Encoding(tokens.mean(dim=0).numpy(), tokens.numpy(), offsets)

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One by one: a product of other rows may round differently."""
        return [self.encode(text).pooled for text in texts]

    def tokens(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One by one, as `pooled`."""
        return [self.encode(text).tokens for text in texts]
