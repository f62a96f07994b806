"""Text encoders `t5-base` and `t5-v1_1-base`: T5's encoder, 768-d (Raffel et al. 2020; SnapMoGen uses v1.1)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from marey.core.errors import InvalidFile
from marey.nn.threads import one_thread
from marey.text.encoders import HUB, WIDTHS, Encoding, weights_sha256
from marey.text.pretrained import load_pretrained, read_config

MAX_TOKENS = 512
FEED_FORWARD = {"t5-base": "relu", "t5-v1_1-base": "gated-gelu"}
"""Both are 768 wide; the feed-forward identifies the version."""


class T5Encoder:
    """Token states of the encoder; pooled = their mean, the end token included."""

    def __init__(self, name: str, folder: Path) -> None:
        from transformers import AutoTokenizer, T5EncoderModel

        check_t5(name, folder)
        self.name = name
        self.width = WIDTHS[name]
        self.sha256 = weights_sha256(folder)
        self._tokenizer: Any = load_pretrained(AutoTokenizer, folder)
        self._model: Any = load_pretrained(T5EncoderModel, folder, weights=True)

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


def check_t5(name: str, folder: Path) -> None:
    """Check that the configuration in a folder is that of this T5.

    Raises:
        InvalidFile: it is missing, of another model, or of the other version of T5.
    """
    config = read_config(folder)
    feed_forward = config.get("feed_forward_proj", "relu")
    if config.get("model_type") != "t5" or config.get("d_model") != WIDTHS[name]:
        raise InvalidFile(f"is not T5 of width {WIDTHS[name]}", where=str(folder), hint=f"It needs {HUB[name]}.")
    if feed_forward != FEED_FORWARD[name]:
        raise InvalidFile(
            f"is not {name}: its feed-forward is {feed_forward!r}, not {FEED_FORWARD[name]!r}",
            where=str(folder),
            hint=f"t5-base and t5-v1_1-base are different models of the same width; it needs {HUB[name]}.",
        )
