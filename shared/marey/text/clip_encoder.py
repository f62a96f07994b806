"""Text encoders `clip-vit-b32` and `clip-vit-l14`: text towers of CLIP (Radford et al. 2021).

ViT-B/32, 512-d, is that of MoMask and HGM³; ViT-L/14, 768-d, that of GraphMotion and of MOGO's public code.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from torch import Tensor

from marey.core.errors import InvalidFile
from marey.text.encoders import HUB, WIDTHS
from marey.text.pretrained import read_config
from marey.text.states_encoder import StatesEncoder

NAMES = {"clip-vit-b32": "ViT-B/32", "clip-vit-l14": "ViT-L/14"}


class ClipEncoder(StatesEncoder):
    """Pooled = projected state of the end token. Token states pass the same projection: one space for all nodes (ours;
    GraphMotion mixes projected sentences with unprojected tokens). Tokens past 77 are left out; the sentence is then
    that of the first 75 words' pieces and the end token.
    """

    max_tokens = 77

    def __init__(self, name: str, folder: Path) -> None:
        from transformers import CLIPTextModelWithProjection, CLIPTokenizer

        check_clip(name, folder)
        super().__init__(name, folder, CLIPTextModelWithProjection, CLIPTokenizer)

    def _read(self, output: Any) -> tuple[Tensor, Tensor]:
        return output.text_embeds[0], self._model.text_projection(output.last_hidden_state[0])


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
