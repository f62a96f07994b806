"""What training reads, as tensors on one device: features, tokens, captions in slots; and batches drawn from them.

Choices of data come from a numpy generator that the loop seeds from (seed, step, rank); nothing here has a state.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shared.errors import InvalidFile
from workers.hgm3.config import ConditionConfig
from workers.hgm3.model import LEVELS, GraphBatch
from workers.hgm3.tokenizer import Tokenizer
from workers.training.data.manifest import Clip
from workers.training.data.prepared import PreparedData
from workers.training.texts import CaptionTexts

PHASES = 4
"""Training clips are tokenized from their frames 0, 1, 2 and 3 on: the same motion on four token grids."""


@dataclass(frozen=True)
class MotionData:
    """All clips of a prepared folder, end to end on one device."""

    prepared: PreparedData
    features: Tensor  # (F, D) float32, in their own units
    mean: Tensor  # (D,)
    std: Tensor  # (D,), grouped

    @classmethod
    def load(cls, folder: Path, device: torch.device) -> MotionData:
        """Read a prepared folder; raises as `PreparedData.open`."""
        prepared = PreparedData.open(folder)
        return cls(
            prepared,
            torch.from_numpy(np.array(prepared.all_features)).to(device),
            torch.from_numpy(prepared.mean).to(device),
            torch.from_numpy(prepared.std).to(device),
        )

    @property
    def sha256(self) -> str:
        """Hash of the manifest, which names every file's."""
        return hashlib.sha256(self.prepared.manifest.model_dump_json().encode()).hexdigest()

    def originals(self, split: str) -> list[Clip]:
        """Captured clips of a split: no mirror images, no loops or splices."""
        return [c for c in self.prepared.split(split) if not c.mirrored and not c.spliced]

    def windows(self, starts: Tensor, size: int) -> Tensor:
        """(B,) first frames to features (B, size, D); frames beyond the last one of all repeat it."""
        index = starts[:, None] + torch.arange(size, device=self.features.device)
        return self.features[index.clamp(max=len(self.features) - 1)]


def dataset_of(clip: Clip) -> str:
    """Data set, with the part of it where the content names one: `bandai-namco/1`."""
    number, slash, _ = clip.content.partition("/")
    return f"{clip.dataset}/{number}" if slash and number.isdigit() else clip.dataset


@dataclass(frozen=True)
class TokenData:
    """Tokens of all clips, each at up to PHASES phases."""

    tokens: Tensor  # (N, V) int64, sequences end to end
    starts: Tensor  # (C, PHASES) int64, first token of clip c at phase p; phase 0 where a clip has fewer
    lengths: Tensor  # (C, PHASES) int64 tokens

    @classmethod
    @torch.no_grad()
    def encode(cls, tokenizer: Tokenizer, data: MotionData, *, batch: int = 64) -> TokenData:
        """Tokenize every clip whole; training clips at all phases, others at phase 0."""
        tokenizer.eval()
        rate = tokenizer.config.frames_per_token
        device = data.features.device
        clips = data.prepared.clips
        jobs = [
            (c, p, clip.start + p, (clip.length - p) // rate)
            for c, clip in enumerate(clips)
            for p in range(PHASES if clip.split == "train" else 1)
            if clip.length - p >= rate
        ]
        jobs.sort(key=lambda job: job[3])  # alike lengths together
        starts = torch.zeros(len(clips), PHASES, dtype=torch.long)
        lengths = torch.zeros(len(clips), PHASES, dtype=torch.long)
        found: list[Tensor] = []
        total = 0
        for at in range(0, len(jobs), batch):
            part = jobs[at : at + batch]
            counts = torch.tensor([job[3] for job in part], device=device)
            features = data.windows(torch.tensor([job[2] for job in part], device=device), int(counts.max()) * rate)
            tokens = tokenizer.encode(features, counts * rate)  # (B, n, V)
            for row, (clip, phase, _, count) in enumerate(part):
                starts[clip, phase], lengths[clip, phase] = total, count
                found.append(tokens[row, :count])
                total += count
        missing = lengths == 0
        starts = torch.where(missing, starts[:, :1], starts).to(device)
        lengths = torch.where(missing, lengths[:, :1], lengths).to(device)
        return cls(torch.cat(found), starts, lengths)

    def log_shares(self, codes: int) -> Tensor:
        """Logarithm of how often each code occurs (V, K): where the biases of the heads start."""
        levels = self.tokens.shape[1]
        counts = torch.stack([torch.bincount(self.tokens[:, v], minlength=codes) for v in range(levels)]).float() + 1
        return (counts / counts.sum(1, keepdim=True)).log()

    def batch(self, clips: Tensor, phases: Tensor, max_tokens: int) -> tuple[Tensor, Tensor]:
        """Tokens (B, n, V), -1 beyond a clip's own length, and lengths (B,); longer clips lose their end."""
        lengths = self.lengths[clips, phases].clamp(max=max_tokens)
        size = int(lengths.max())
        position = torch.arange(size, device=clips.device)
        index = (self.starts[clips, phases][:, None] + position).clamp(max=len(self.tokens) - 1)
        valid = position[None] < lengths[:, None]
        return self.tokens[index].masked_fill(~valid[..., None], -1), lengths


@dataclass(frozen=True)
class CaptionData:
    """Captions of all clips in fixed slots, on one device."""

    strings: Tensor  # (U, W) float16
    slots: Tensor  # (K, S) int32 string of each slot, -1 = absent
    adjacency: Tensor  # (K, S, S) int8
    first: NDArray[np.int64]  # (C + 1,): clip c has captions first[c] … first[c + 1] - 1

    @classmethod
    def load(cls, texts: CaptionTexts, config: ConditionConfig, device: torch.device) -> CaptionData:
        """Put the captions' graphs into slots.

        Raises:
            InvalidFile: texts of another encoder's width.
        """
        if texts.strings.shape[1] != config.text_width:
            raise InvalidFile(
                f"texts are {texts.strings.shape[1]} wide, this configuration reads {config.text_width}",
                hint="Run `marey data text` with the encoder of the configuration.",
            )
        slots, adjacency = texts.slots(config.max_actions, config.max_specifics)
        return cls(
            torch.from_numpy(np.asarray(texts.strings)).to(device),
            torch.from_numpy(slots.astype(np.int32)).to(device),
            torch.from_numpy(adjacency.astype(np.int8)).to(device),
            np.asarray(texts.first, np.int64),
        )

    def choose(self, clips: NDArray[np.int64], rng: np.random.Generator) -> Tensor:
        """One caption of each clip (B,) at random."""
        low, high = self.first[clips], self.first[clips + 1]
        chosen = low + np.floor(rng.random(len(clips)) * (high - low)).astype(np.int64)
        return torch.from_numpy(chosen).to(self.slots.device)

    def graphs(self, captions: Tensor) -> GraphBatch:
        """The graphs of captions (B,)."""
        slots = self.slots[captions].long()
        present = slots >= 0
        nodes = self.strings[slots.clamp(min=0)].float() * present[..., None]
        return GraphBatch(nodes, self.adjacency[captions].long(), present)

    def sentences(self, captions: Tensor) -> Tensor:
        """Sentence features (B, W)."""
        return self.strings[self.slots[captions, 0].long()].float()

    def statistics(self, clips: Sequence[int], config: ConditionConfig) -> tuple[Tensor, Tensor]:
        """Mean and std (3, W) of the texts of motion, action and specific nodes over captions of `clips`."""
        rows = np.concatenate([np.arange(self.first[c], self.first[c + 1]) for c in clips])
        slots = self.slots[torch.from_numpy(rows).to(self.slots.device)].long()  # (R, S)
        ends = [0, 1, 1 + config.max_actions, config.slots]
        means, stds = [], []
        for level in range(LEVELS):
            index = slots[:, ends[level] : ends[level + 1]]
            index = index[index >= 0]
            counts = torch.bincount(
                index, minlength=len(self.strings)
            ).double()  # a string counts as often as it occurs
            share = (counts / counts.sum().clamp(min=1))[:, None]
            values = self.strings.double()
            mean = (values * share).sum(0)
            means.append(mean)
            stds.append(((values - mean).square() * share).sum(0).sqrt().clamp(min=1e-4))
        return torch.stack(means).float(), torch.stack(stds).float()
