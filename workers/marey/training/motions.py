"""Motions for training, on one device: concatenated features of all clips, and their tokens.

Random choices use a numpy generator that the loop seeds from (seed, step, rank); this code has no state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, Self

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import Tensor, nn

from marey.core.errors import InvalidFile, InvalidInput
from marey.core.whole_files import whole_file
from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.nn import distributed
from marey.nn.motion_tokenizer import MotionTokenizer

TOKENS = "tokens.safetensors"


@dataclass(frozen=True)
class MotionData:
    """All clips of a prepared folder, concatenated on one device."""

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

    def originals(self, split: str) -> list[Clip]:
        """Return captured clips of a split: see `Clip.captured`."""
        return [c for c in self.prepared.split(split) if c.captured]

    def windows(self, starts: Tensor, size: int) -> Tensor:
        """Return features (B, size, D) from first frames (B,); frames past the end repeat the very last one."""
        index = starts[:, None] + torch.arange(size, device=self.features.device)
        return self.features[index.clamp(max=len(self.features) - 1)]


class LayoutConfig(Protocol):
    """Fields of a model's configuration that say which data it reads."""

    @property
    def name(self) -> str: ...
    @property
    def layout(self) -> str: ...


def check_layout(config: LayoutConfig, data: PreparedData) -> None:
    """Refuse data of another layout.

    Raises:
        InvalidInput: the features of the folder are not the configuration's.
    """
    found = data.manifest.layout
    if found != config.layout:
        raise InvalidInput(
            f"holds features of the layout {found}; the configuration {config.name!r} reads {config.layout}",
            where=str(data.path),
            hint="Prepare the data with this layout, or choose another configuration.",
        )


def dataset_of(clip: Clip) -> str:
    """Return the data set, with its part if the content names one: `bandai-namco/1`."""
    number, slash, _ = clip.content.partition("/")
    return f"{clip.dataset}/{number}" if slash and number.isdigit() else clip.dataset


@dataclass(frozen=True)
class Cuts:
    """Which part of each clip of a batch is read, drawn without knowing how long the clips are."""

    kept: Tensor  # (B,) share of the clip, 0 to 1; 1 = all of it
    place: Tensor  # (B,) where the part lies: 0 = at the start, below 1
    least: int  # tokens that a part has at least

    def of(self, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Return the first token (B,) and the number of tokens (B,) of the parts of clips of `lengths` (B,)."""
        count = (self.kept * lengths).round().long().clamp(min=self.least).minimum(lengths)
        return (self.place * (lengths - count + 1)).long(), count


@dataclass(frozen=True)
class TokenData:
    """Tokens of all clips. A training clip is tokenized from its frames 0, 1, … on, up to the number of frames of a
    token (P): the same motion on P token grids."""

    tokens: Tensor  # (N, V) int64, concatenated sequences
    starts: Tensor  # (C, P) int64, first token of clip c at phase p; phase 0 where a clip has fewer
    lengths: Tensor  # (C, P) int64 tokens

    @classmethod
    @torch.no_grad()
    def encode(cls, tokenizer: MotionTokenizer, data: MotionData, *, batch: int = 64) -> TokenData:
        """Tokenize every clip whole; training clips at all phases, others at phase 0."""
        tokenizer.eval()
        rate = tokenizer.frames_per_token

        def tokens_of(features: Tensor, frames: Tensor) -> list[Tensor]:
            tokens = tokenizer.encode(features, frames)  # (B, n, V)
            return [row[:count] for row, count in zip(tokens, (frames // rate).tolist(), strict=True)]

        return encode_phases(tokens_of, data, rate, batch=batch)

    @property
    def phases(self) -> int:
        """Return P."""
        return self.starts.shape[1]

    def first_phases(self, count: int) -> Self:
        """Return the same clips at their first `count` phases, or at all if there are fewer."""
        return replace(self, starts=self.starts[:, :count], lengths=self.lengths[:, :count])

    def log_shares(self, codes: int, clips: NDArray[np.int64]) -> Tensor:
        """Return the logarithm of each code's frequency (V, K) in `clips`, those that are trained on, at all phases:
        initial biases of the heads."""
        chosen = torch.from_numpy(clips).to(self.starts.device)
        sequences = torch.stack([self.starts[chosen].flatten(), self.lengths[chosen].flatten()])
        starts, lengths = torch.unique(sequences, dim=1)  # phase 0 stands for those that a clip does not have
        edges = torch.zeros(len(self.tokens) + 1, dtype=torch.long, device=self.tokens.device)
        edges.index_add_(0, starts, torch.ones_like(starts)).index_add_(0, starts + lengths, -torch.ones_like(starts))
        tokens = self.tokens[edges.cumsum(0)[:-1] > 0]
        counts = torch.stack([torch.bincount(level, minlength=codes) for level in tokens.T]).float() + 1
        return (counts / counts.sum(1, keepdim=True)).log()

    def batch(
        self, clips: Tensor, phases: Tensor, max_tokens: int, *, size: int | None = None, cuts: Cuts | None = None
    ) -> tuple[Tensor, Tensor]:
        """Return tokens (B, n, V), -1 beyond a clip's own length, and lengths (B,); longer clips lose their end. n is
        `size`, or the longest length. With `cuts`, a part of each clip."""
        starts, lengths = self.starts[clips, phases], self.lengths[clips, phases].clamp(max=max_tokens)
        if cuts is not None:
            first, lengths = cuts.of(lengths)
            starts = starts + first
        size = int(lengths.max()) if size is None else size
        position = torch.arange(size, device=clips.device)
        index = (starts[:, None] + position).clamp(max=len(self.tokens) - 1)
        valid = position[None] < lengths[:, None]
        return self.tokens[index].masked_fill(~valid[..., None], -1), lengths


def load_tokens(run: Path, tokenizer: MotionTokenizer, data: MotionData) -> TokenData:
    """Return tokens of all clips: encoded once per tokenizer and data, then read from the run folder."""
    key = f"{data.prepared.sha256}:{fingerprint(tokenizer)}"
    device = data.features.device
    return TokenData(**made_once(run / TOKENS, key, device, lambda: vars(TokenData.encode(tokenizer, data))))


def encode_phases(
    tokens_of: Callable[[Tensor, Tensor], Sequence[Tensor]],
    data: MotionData,
    rate: int,
    *,
    longest: int | None = None,
    batch: int = 64,
) -> TokenData:
    """Tokenize every clip: training clips at all phases, others at phase 0.

    Args:
        tokens_of: function from features (B, T, D) and frames (B,), multiples of `rate`, to the tokens (n, V) of each.
        data: the prepared data.
        rate: frames of a token, which are also the phases.
        longest: tokens that a clip is cut to; None = clips are whole.
        batch: clips that are encoded together.
    """
    device = data.features.device
    clips = data.prepared.clips
    jobs = [
        (c, p, clip.start + p, min((clip.length - p) // rate, longest or clip.length))
        for c, clip in enumerate(clips)
        for p in range(rate if clip.split == "train" else 1)
        if clip.length - p >= rate
    ]
    jobs.sort(key=lambda job: job[3])  # similar lengths together
    starts = torch.zeros(len(clips), rate, dtype=torch.long)
    lengths = torch.zeros(len(clips), rate, dtype=torch.long)
    found: list[Tensor] = []
    total = 0
    for at in range(0, len(jobs), batch):
        part = jobs[at : at + batch]
        counts = torch.tensor([job[3] for job in part], device=device)
        features = data.windows(torch.tensor([job[2] for job in part], device=device), int(counts.max()) * rate)
        for own, (clip, phase, _, count) in zip(tokens_of(features, counts * rate), part, strict=True):
            starts[clip, phase], lengths[clip, phase] = total, count
            found.append(own)
            total += len(own)
    missing = lengths == 0
    starts = torch.where(missing, starts[:, :1], starts).to(device)
    lengths = torch.where(missing, lengths[:, :1], lengths).to(device)
    return TokenData(torch.cat(found), starts, lengths)


def made_once(
    file: Path, key: str, device: torch.device, make: Callable[[], Mapping[str, Tensor]]
) -> Mapping[str, Tensor]:
    """Return int64 arrays, `tokens` among them: read from a file with this key, else computed and written there."""
    if file.is_file():
        try:
            values = load_file(file)
        except (SafetensorError, OSError) as error:
            raise InvalidFile(f"cannot be read: {error}", where=str(file), hint="Remove it.") from error
        if "key" in values and values.pop("key").numpy().tobytes() == key.encode():
            return {name: value.to(device).long() for name, value in values.items()}
    made = {name: value.long() for name, value in make().items()}
    if distributed.rank() == 0:
        values = {name: value.int() for name, value in made.items()}
        values["tokens"] = made["tokens"].to(torch.int16)
        values["key"] = torch.tensor(list(key.encode()), dtype=torch.uint8)
        with whole_file(file, alone=True) as part:
            save_file({name: value.cpu().contiguous() for name, value in values.items()}, part)
    return made


def fingerprint(network: nn.Module) -> str:
    """Return a fingerprint of a network's weights."""
    total = sum(float(value.double().abs().sum()) for value in network.state_dict().values())
    return f"{total:.6f}"
