"""Text encoder `clip-vit-b32`: the text tower of CLIP ViT-B/32, 512-d (Radford et al. 2021), as in MoMask and HGM³."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from marey.core.errors import InvalidFile
from marey.nn.threads import one_thread
from marey.text.encoders import WIDTHS, Encoding, weights_sha256
from marey.text.pretrained import load_pretrained, read_config

MAX_TOKENS = 77


class ClipEncoder:
    """Pooled = projected state of the end token. Token states pass the same projection: one space for all nodes (ours;
    GraphMotion mixes projected sentences with unprojected tokens). Tokens past 77 are left out; the sentence is then
    that of the first 75 words' pieces and the end token.
    """

    name = "clip-vit-b32"
    width = WIDTHS["clip-vit-b32"]

    def __init__(self, folder: Path) -> None:
        from transformers import CLIPTextModelWithProjection, CLIPTokenizer

        check_clip(folder)
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


def check_clip(folder: Path) -> None:
    """Check that the configuration in a folder is that of CLIP ViT-B/32.

    Raises:
        InvalidFile: it is missing, or of another model.
    """
    config = read_config(folder)
    text = config.get("text_config") or config
    if not str(config.get("model_type", "")).startswith("clip") or text.get("hidden_size") != WIDTHS["clip-vit-b32"]:
        raise InvalidFile(
            "is not the text tower of CLIP ViT-B/32 (hidden size 512)",
            where=str(folder),
            hint="The folder needs the files of openai/clip-vit-base-patch32.",
        )
