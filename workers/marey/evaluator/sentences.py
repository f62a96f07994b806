"""Sentences as token states of a frozen text encoder: word-level features, as in SnapMoGen App. B.2.

These are not the nodes of a semantic graph that `marey data text` stores: an evaluator with the input of a generator
would share its blind spots, and would need a role labeller.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from marey.bundles import TextSpec
from marey.core.errors import InvalidBundle
from marey.text.encoders import TextEncoder
from marey.text.keys import NO_LABELLER
from marey.text.loading import load_encoder
from marey.text.pipeline import refuse_mismatch


def open_encoder(spec: TextSpec) -> TextEncoder:
    """Load the encoder named by a bundle or prepared texts from the weights on this machine.

    Raises:
        NotFound: they are not installed.
        InvalidBundle: they differ from the named ones.
    """
    return check_encoder(spec, load_encoder(spec.encoder))


def check_encoder(spec: TextSpec, encoder: TextEncoder) -> TextEncoder:
    """Return `encoder` if it is the one of `spec`. Raises InvalidBundle."""
    refuse_mismatch("encoder", spec.encoder, spec.encoder_sha256, encoder.name, encoder.sha256)
    if encoder.width != spec.width:
        raise InvalidBundle(f"the text width must be {spec.width}; {encoder.name} has {encoder.width}")
    return encoder


def spec_of(encoder: TextEncoder) -> TextSpec:
    """Return the text specification of an evaluator's encoder; without a graph it needs no labeller."""
    return TextSpec(
        encoder=encoder.name,  # pyright: ignore[reportArgumentType]  # pydantic checks it
        encoder_sha256=encoder.sha256,
        width=encoder.width,
        labeller=NO_LABELLER,
    )


def token_states(encoder: TextEncoder, sentences: Sequence[str]) -> list[Tensor]:
    """Return (S, W) float16 of each sentence, the same inside a training step in bfloat16 as outside."""
    with torch.autocast("cpu", enabled=False):  # states in bfloat16 have no numpy array
        encodings = encoder.encodings(sentences)
    return [torch.from_numpy(encoding.tokens).half() for encoding in encodings]


def padded(states: Sequence[Tensor], device: torch.device) -> tuple[Tensor, Tensor]:
    """Return states (B, S, W) float32, zeros after each sentence, and lengths (B,)."""
    lengths = torch.tensor([len(each) for each in states], device=device)
    return torch.nn.utils.rnn.pad_sequence(list(states), batch_first=True).to(device).float(), lengths


class CaptionStates:
    """Token states of training captions, each encoded when it is first drawn, then cached (15 kB per caption)."""

    def __init__(self, encoder: TextEncoder, device: torch.device) -> None:
        self.encoder, self.device = encoder, device
        self._found: dict[str, Tensor] = {}

    def batch(self, captions: Sequence[str]) -> tuple[Tensor, Tensor]:
        """See `padded`."""
        return padded(self.states(captions), self.device)

    def states(self, captions: Sequence[str]) -> list[Tensor]:
        """Return (S, W) float16 of each caption."""
        missing = [caption for caption in dict.fromkeys(captions) if caption not in self._found]
        self._found.update(zip(missing, token_states(self.encoder, missing), strict=True))
        return [self._found[caption] for caption in captions]
