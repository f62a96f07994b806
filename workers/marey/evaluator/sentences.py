"""Sentences as token states of a frozen text encoder: word-level features, as in SnapMoGen App. B.2.

Not the nodes of a semantic graph that `marey data text` stores: an evaluator that read what one of the generators reads
would be blind where that generator is, and would need a role labeller.
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
    """Load the encoder that a bundle or prepared texts name from the weights on this machine.

    Raises:
        NotFound: they are not installed.
        InvalidBundle: they are others than those named.
    """
    return check_encoder(spec, load_encoder(spec.encoder))


def check_encoder(spec: TextSpec, encoder: TextEncoder) -> TextEncoder:
    """`encoder`, if it is the one that `spec` names. Raises InvalidBundle."""
    refuse_mismatch("encoder", spec.encoder, spec.encoder_sha256, encoder.name, encoder.sha256)
    if encoder.width != spec.width:
        raise InvalidBundle(f"text width {spec.width} is wanted, but {encoder.name} gives {encoder.width}")
    return encoder


def spec_of(encoder: TextEncoder) -> TextSpec:
    """Text specification of an evaluator's encoder; without a graph it needs no labeller."""
    return TextSpec(
        encoder=encoder.name,  # pyright: ignore[reportArgumentType]  # pydantic checks it
        encoder_sha256=encoder.sha256,
        width=encoder.width,
        labeller=NO_LABELLER,
    )


def token_states(encoder: TextEncoder, sentences: Sequence[str]) -> list[Tensor]:
    """(S, W) float16 of each sentence."""
    return [torch.from_numpy(states).half() for states in encoder.tokens(sentences)]


def padded(states: Sequence[Tensor], device: torch.device) -> tuple[Tensor, Tensor]:
    """States (B, S, W) float32, zeros behind each sentence, and lengths (B,)."""
    lengths = torch.tensor([len(each) for each in states], device=device)
    return torch.nn.utils.rnn.pad_sequence(list(states), batch_first=True).to(device).float(), lengths


class CaptionStates:
    """Token states of training captions, each encoded when it is first drawn, and kept (15 kB a caption)."""

    def __init__(self, encoder: TextEncoder, device: torch.device) -> None:
        self.encoder, self.device = encoder, device
        self._found: dict[str, Tensor] = {}

    def batch(self, captions: Sequence[str]) -> tuple[Tensor, Tensor]:
        """See `padded`."""
        return padded(self.states(captions), self.device)

    def states(self, captions: Sequence[str]) -> list[Tensor]:
        """(S, W) float16 of each caption."""
        missing = [caption for caption in dict.fromkeys(captions) if caption not in self._found]
        self._found.update(zip(missing, token_states(self.encoder, missing), strict=True))
        return [self._found[caption] for caption in captions]
