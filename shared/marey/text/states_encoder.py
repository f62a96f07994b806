"""Text encoders of `transformers` share this: CLIP, and T5 and DistilBERT, whose token states stay unchanged."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.nn.threads import one_thread
from marey.text.encoders import WIDTHS, Encoding, weights_sha256
from marey.text.pretrained import load_pretrained


class StatesEncoder:
    """Token states of a frozen encoder; pooled = their mean, special tokens included."""

    max_tokens: ClassVar[int] = 512
    """Tokens of a text that are read, special ones included."""

    def __init__(self, name: str, folder: Path, kind: Any, tokenizer: Any = None) -> None:
        """Load tokenizer and weights as classes of `transformers`.

        Args:
            kind: class of the weights.
            tokenizer: class of the tokenizer; None = the one that the folder names.

        Raises:
            InvalidFile: the folder cannot be loaded, or a weight is missing.
        """
        from transformers import AutoTokenizer

        self.name = name
        self.width = WIDTHS[name]
        self.sha256 = weights_sha256(folder)
        self._tokenizer: Any = load_pretrained(tokenizer or AutoTokenizer, folder)
        self._model: Any = load_pretrained(kind, folder, weights=True)

    @one_thread()
    @torch.inference_mode()
    def encode(self, text: str) -> Encoding:
        """Encode one text; tokens past `max_tokens` are left out."""
        inputs = self._tokenizer(
            text, truncation=True, max_length=self.max_tokens, return_offsets_mapping=True, return_tensors="pt"
        )
        offsets = tuple((int(a), int(b)) for a, b in inputs.pop("offset_mapping")[0].tolist())
        pooled, tokens = self._read(self._model(**inputs))
        return Encoding(pooled.numpy(), tokens.numpy(), offsets)

    def _read(self, output: Any) -> tuple[Tensor, Tensor]:
        """Return the pooled state (W,) and the token states (n, W) of what the network gives for one text."""
        tokens: Tensor = output.last_hidden_state[0]
        return tokens.mean(dim=0), tokens

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One by one: a product of other rows may round differently."""
        return [self.encode(text).pooled for text in texts]

    def encodings(self, texts: Sequence[str]) -> list[Encoding]:
        """One by one, as `pooled`."""
        return [self.encode(text) for text in texts]
