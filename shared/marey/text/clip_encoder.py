"""Text encoders `clip-vit-b32` and `clip-vit-l14`: text towers of CLIP (Radford et al. 2021).

ViT-B/32, 512-d, is that of MoMask and HGM³; ViT-L/14, 768-d, that of GraphMotion and of MOGO's public code.
"""

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

MAX_TOKENS = 77
NAMES = {"clip-vit-b32": "ViT-B/32", "clip-vit-l14": "ViT-L/14"}


class ClipEncoder:
    """Pooled = projected state of the end token. Token states pass the same projection: one space for all nodes (ours;
    GraphMotion mixes projected sentences with unprojected tokens). Tokens past 77 are left out; the sentence is then
    that of the first 75 words' pieces and the end token.
    """

    def __init__(self, name: str, folder: Path) -> None:
        from transformers import CLIPTextModelWithProjection, CLIPTokenizer

        check_clip(name, folder)
        self.name = name
        self.width = WIDTHS[name]
        self.sha256 = weights_sha256(folder)
        self._tokenizer: Any = load_pretrained(CLIPTokenizer, folder)
        self._model: Any = load_pretrained(CLIPTextModelWithProjection, folder, weights=True)

    @one_thread()
    @torch.inference_mode()
    def encode(self, text: str) -> Encoding:
        """Encode one text; tokens past 77 are left out."""
        inputs = self._tokenizer(
            text, truncation=True, max_length=MAX_TOKENS, return_offsets_mapping=True, return_tensors="pt"
        )
        offsets = tuple((int(a), int(b)) for a, b in inputs.pop("offset_mapping")[0].tolist())
        output = self._model(**inputs)
        tokens = self._model.text_projection(output.last_hidden_state[0])
        return Encoding(output.text_embeds[0].numpy(), tokens.numpy(), offsets)

    def pooled(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One by one: a product of other rows may round differently."""
        return [self.encode(text).pooled for text in texts]

    def tokens(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """One by one, as `pooled`."""
        return [self.encode(text).tokens for text in texts]


def check_clip(name: str, folder: Path) -> None:
    """Check that the configuration in a folder is that of this CLIP.

    Raises:
        InvalidFile: it is missing, or of another model.
    """
    config = read_config(folder)
    text = config.get("text_config") or config
    if not str(config.get("model_type", "")).startswith("clip") or text.get("hidden_size") != WIDTHS[name]:
        raise InvalidFile(
            f"is not the text tower of CLIP {NAMES[name]} (hidden size {WIDTHS[name]})",
            where=str(folder),
            hint=f"The folder needs the files of {HUB[name]}.",
        )
