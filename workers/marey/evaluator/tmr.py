"""The TMR-style evaluator: strings and raw features in, mean vectors out, compared by cosine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self

import numpy as np
import torch
from torch import Tensor

from marey.bundles import Bundle
from marey.core.errors import InvalidBundle
from marey.evaluator.bundle import load_networks
from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.metrics.retrieval import Distance
from marey.evaluator.model import MotionEncoder, SentenceEncoder
from marey.evaluator.networks import LoadedNetworks
from marey.evaluator.port import Embeddings, Motion, check_motions
from marey.evaluator.sentences import check_encoder, open_encoder, padded, token_states
from marey.items.prompts import check_prompt
from marey.nn.devices import choose_device
from marey.text.encoders import TextEncoder

BATCH = 64


class TMREvaluator(LoadedNetworks[EvaluatorConfig, MotionEncoder, SentenceEncoder]):
    """A loaded bundle. Not thread-safe.

    On a CPU matrices are packed, and the bits of an embedding do not depend on the rest of its batch.
    """

    distance: Distance = "cosine"

    def __init__(
        self,
        bundle: Bundle,
        config: EvaluatorConfig,
        motion: MotionEncoder,
        text: SentenceEncoder,
        encoder: TextEncoder,
        device: torch.device,
    ) -> None:
        """Create an evaluator from its parts; most callers use `load`."""
        super().__init__(bundle, config, motion, text, device)
        self.encoder = encoder
        self._pack()

    def _pack(self) -> None:
        self.motion.encoder.pack()
        self.text.encoder.pack()

    @classmethod
    def load(cls, bundle: Bundle, *, device: str = "auto", encoder: TextEncoder | None = None) -> Self:
        """Load a bundle.

        Args:
            bundle: a verified bundle.
            device: `auto`, `cpu`, `cuda`, `cuda:N`.
            encoder: a loaded one; None = load its weights on this machine.

        Raises:
            InvalidBundle: not this kind of evaluator, damaged, or trained with another text encoder.
            NotFound: the text encoder's weights are not installed.
            InvalidInput: unknown device.
        """
        config, motion, text = load_networks(bundle)
        spec = bundle.manifest.text
        if spec is None or spec.width != config.text_width:
            raise InvalidBundle("declares no text encoder", where=str(bundle.path))
        encoder = open_encoder(spec) if encoder is None else check_encoder(spec, encoder)
        return cls(bundle, config, motion, text, encoder, choose_device(device))

    def embed_motion(self, motions: Sequence[Motion]) -> Embeddings:
        """See `Evaluator`; motions of 16 to 196 frames at 20 fps, or as configured."""
        config = self.config
        check_motions(motions, config.features, config.min_frames, config.max_frames)
        return embed_motions(self.motion, motions)

    @torch.inference_mode()
    def embed_text(self, sentences: Sequence[str]) -> Embeddings:
        """See `Evaluator`; any English prompt (`check_prompt`), read as far as the text encoder reads."""
        checked = [check_prompt(sentence, where=f"sentence {n}", stored=True) for n, sentence in enumerate(sentences)]
        found = np.zeros((len(checked), self.width), np.float32)
        states = self._states(checked)
        for rows in _alike([len(each) for each in states]):
            found[rows] = _array(self.text.embed(*padded([states[row] for row in rows], self.device)))
        return found

    def _states(self, sentences: Sequence[str]) -> list[Tensor]:
        """Return the states (S, W) of each sentence that the text network reads."""
        return token_states(self.encoder, sentences)


@torch.inference_mode()
def embed_motions(encoder: MotionEncoder, motions: Sequence[Motion]) -> Embeddings:
    """Return mean vectors (N, E) of raw features (T, D) that passed `check_motions`, in the order given."""
    device = encoder.mean.device
    found = np.zeros((len(motions), encoder.width), np.float32)
    for rows in _alike([len(motion) for motion in motions]):
        lengths = torch.tensor([len(motions[row]) for row in rows], device=device)
        features = [torch.from_numpy(np.ascontiguousarray(motions[row], np.float32)) for row in rows]
        batch = torch.nn.utils.rnn.pad_sequence(features, batch_first=True).to(device)
        found[rows] = _array(encoder.embed(batch, lengths))
    return found


def _alike(lengths: Sequence[int]) -> list[list[int]]:
    """Group rows into batches of similar length."""
    order = sorted(range(len(lengths)), key=lambda row: lengths[row])
    return [order[at : at + BATCH] for at in range(0, len(order), BATCH)]


def _array(embeddings: Tensor) -> Embeddings:
    return embeddings.float().cpu().numpy()
