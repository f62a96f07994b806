"""The public T2M evaluator's networks (Guo et al. 2022, "Generating Diverse and Natural 3D Human Motions from Text").

    motion ── MovementEncoder (4 frames a step) ── RecurrentEncoder ── embedding
    words  ── WordInput (GloVe + part of speech) ── RecurrentEncoder ── embedding

Parameters carry the names and shapes of the public `text_mot_match/model/finest.tar`, so that it can be loaded. Sizes:
`EricGuo5513/momask-codes` (MIT), models/t2m_eval_wrapper.py.

Shapes: B batch, T frames, n steps, D features, S words with start and end, E = 512.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from marey.core.configs import ModelConfig

FRAMES = 196
"""The public code pads every normalised motion with zeros to this many frames. The padding matters: the two
convolutions reach two frames past a motion's last step, where zeros become a bias, so less padding would change
embeddings."""
FRAMES_PER_STEP = 4
CONTACTS = 4
"""Number of last columns, the foot contacts, that are not read."""
SLOPE = 0.2


@dataclass(frozen=True)
class T2MConfig(ModelConfig):
    """Sizes of the networks; the public ones are the defaults."""

    name: str = "public"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    fps: float = 20.0
    movement: int = 512
    motion_hidden: int = 1024
    text_hidden: int = 512
    width: int = 512  # E
    word_width: int = 300  # GloVe
    tags: int = 15  # parts of speech
    min_frames: int = FRAMES_PER_STEP


class MovementEncoder(nn.Module):
    """Two strided convolutions: a step for four frames."""

    def __init__(self, config: T2MConfig) -> None:
        super().__init__()
        width = config.movement
        self.main = nn.Sequential(
            nn.Conv1d(config.features - CONTACTS, width, 4, stride=2, padding=1),
            nn.Dropout(0.2),
            nn.LeakyReLU(SLOPE),
            nn.Conv1d(width, width, 4, stride=2, padding=1),
            nn.Dropout(0.2),
            nn.LeakyReLU(SLOPE),
        )
        self.out_net = nn.Linear(width, width)

    def forward(self, features: Tensor) -> Tensor:
        """Encode normalised (B, T, D) as (B, T / 4, movement)."""
        return self.out_net(self.main(features[..., :-CONTACTS].transpose(1, 2)).transpose(1, 2))


class RecurrentEncoder(nn.Module):
    """A bidirectional GRU with a learned start; its last states, both directions, give one embedding."""

    def __init__(self, inputs: int, hidden: int, width: int) -> None:
        super().__init__()
        self.input_emb = nn.Linear(inputs, hidden)
        self.gru = nn.GRU(hidden, hidden, batch_first=True, bidirectional=True)
        self.output_net = nn.Sequential(
            nn.Linear(2 * hidden, hidden), nn.LayerNorm(hidden), nn.LeakyReLU(SLOPE), nn.Linear(hidden, width)
        )
        self.hidden = nn.Parameter(torch.randn(2, 1, hidden))

    def forward(self, x: Tensor, lengths: Tensor) -> Tensor:
        """Encode (B, S, inputs) with lengths (B,), at least 1, as (B, E), in the order given; the public code requires
        and returns them sorted by length."""
        packed = nn.utils.rnn.pack_padded_sequence(
            self.input_emb(x), lengths.cpu(), batch_first=True, enforce_sorted=False
        )
        _, last = self.gru(packed, self.hidden.expand(-1, len(x), -1).contiguous())
        return self.output_net(last.transpose(0, 1).flatten(1))


class T2MTextEncoder(RecurrentEncoder):
    """Encoder of words and their parts of speech."""

    def __init__(self, config: T2MConfig) -> None:
        super().__init__(config.word_width, config.text_hidden, config.width)
        self.pos_emb = nn.Linear(config.tags, config.word_width)

    def embed(self, words: Tensor, tags: Tensor, lengths: Tensor) -> Tensor:
        """Encode word vectors (B, S, 300), one-hot parts of speech (B, S, 15) and lengths (B,) as (B, E)."""
        return self(words + self.pos_emb(tags), lengths)


class T2MMotionEncoder(nn.Module):
    """Movement encoder and GRU, with the statistics that normalise motions."""

    mean: Tensor  # (D,) of the evaluator's own training (Comp_v6_KLD005), which differ from every generator's
    std: Tensor

    def __init__(self, config: T2MConfig) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(config.features))
        self.register_buffer("std", torch.ones(config.features))
        self.movement = MovementEncoder(config)
        self.motion = RecurrentEncoder(config.movement, config.motion_hidden, config.width)

    def forward(self, features: Tensor, lengths: Tensor) -> Tensor:
        """Encode raw features (B, T, D), T at most 196, with frames (B,), at least 4, as (B, E).

        The last incomplete step of a motion is not read, as the public loader cuts it off.
        """
        steps = lengths // FRAMES_PER_STEP
        size = features.shape[1]
        read = torch.arange(size, device=features.device)[None] < (steps * FRAMES_PER_STEP)[:, None]
        padded = features.new_zeros(len(features), FRAMES, features.shape[2])
        padded[:, :size] = ((features - self.mean) / self.std).masked_fill(~read[..., None], 0.0)
        return self.motion(self.movement(padded), steps)
