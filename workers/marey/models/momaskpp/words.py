"""Word-level states of texts: what the transformer reads of a prompt (docs/decisions/0026)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from marey.bundles import TextSpec
from marey.models.momaskpp.model import TextStates
from marey.text.encoders import encoder_sha256
from marey.text.loading import load_encoder
from marey.text.pipeline import refuse_mismatch
from marey.text.truncation import truncated_tokens

CACHED_TEXTS = 256
"""Prompts whose states are kept: candidates of one prompt come one after another."""


def pad_states(states: Sequence[NDArray[np.floating]], limit: int, device: torch.device) -> TextStates:
    """Put states (L, W) of texts into one batch of `limit` words each; absent words are zero."""
    padded = np.zeros((len(states), limit, states[0].shape[1]), np.float32)
    present = np.zeros((len(states), limit), bool)
    for row, own in enumerate(states):
        padded[row, : len(own)] = own
        present[row, : len(own)] = True
    return TextStates(torch.from_numpy(padded).to(device), torch.from_numpy(present).to(device))


class WordReader:
    """Reads prompts with the encoder that a bundle names. Not thread-safe."""

    def __init__(self, spec: TextSpec, limit: int) -> None:
        """Load the encoder.

        Raises:
            NotFound: its weights are not installed; the hint says how to get them.
            InvalidBundle: other weights are installed than `spec` names.
        """
        refuse_mismatch("encoder", spec.encoder, spec.encoder_sha256, spec.encoder, encoder_sha256(spec.encoder))
        self.encoder = load_encoder(spec.encoder)
        self.limit = limit
        self._read: OrderedDict[str, NDArray[np.float32]] = OrderedDict()

    def states(self, texts: Sequence[str]) -> list[NDArray[np.float32]]:
        """Return the states (L, W) of each text; they depend on that text alone."""
        found = {text: self._read[text] for text in texts if text in self._read}
        missing = [text for text in dict.fromkeys(texts) if text not in found]
        if missing:
            found.update(zip(missing, truncated_tokens(self.encoder, missing, self.limit), strict=True))
        for text, states in found.items():
            self._read[text] = states
            self._read.move_to_end(text)
        while len(self._read) > CACHED_TEXTS:
            self._read.popitem(last=False)
        return [found[text] for text in texts]
