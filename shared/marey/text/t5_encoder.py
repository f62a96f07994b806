"""Text encoders `t5-base` and `t5-v1_1-base`: T5's encoder, 768-d (Raffel et al. 2020; SnapMoGen uses v1.1)."""

from __future__ import annotations

from pathlib import Path

from marey.core.errors import InvalidFile
from marey.text.encoders import HUB, WIDTHS
from marey.text.pretrained import read_config
from marey.text.states_encoder import StatesEncoder

FEED_FORWARD = {"t5-base": "relu", "t5-v1_1-base": "gated-gelu"}
"""Both are 768 wide; the feed-forward identifies the version."""


class T5Encoder(StatesEncoder):
    """Token states of T5's encoder, the end token included."""

    def __init__(self, name: str, folder: Path) -> None:
        from transformers import T5EncoderModel

        check_t5(name, folder)
        super().__init__(name, folder, T5EncoderModel)


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
