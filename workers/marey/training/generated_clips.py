"""Motions that a model generated for captions of training clips: used in training as further clips."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors import SafetensorError, safe_open
from safetensors.torch import load_file, save_file
from torch import Tensor

from marey.core.errors import InvalidFile
from marey.core.whole_files import whole_file
from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.training.motions import TokenData
from marey.training.sentences import SentenceData

C = TypeVar("C", bound=SentenceData)

FILE = "practice.safetensors"
FORMAT = 2


@dataclass(frozen=True)
class DrawnMotion:
    """A motion generated for a caption."""

    clip: int
    caption: int  # index among the captions of the whole clip
    tokens: Tensor  # (n, V) int64


@dataclass(frozen=True)
class Drawn:
    """M motions; their tokens are concatenated."""

    clips: NDArray[np.int64]  # (M,) clip of each motion's caption
    captions: NDArray[np.int64]  # (M,) index of the caption among those of the clip
    lengths: Tensor  # (M,) int64 tokens
    tokens: Tensor  # (N, V) int64

    @classmethod
    def of(cls, motions: Sequence[DrawnMotion]) -> Drawn:
        """Collect motions."""
        clips, captions = (
            np.array(values, np.int64) for values in ([m.clip for m in motions], [m.caption for m in motions])
        )
        lengths = torch.tensor([len(m.tokens) for m in motions])
        return cls(clips, captions, lengths, torch.cat([m.tokens for m in motions]))

    def write(self, run: Path, tokenizer: MotionTokenizer, prepared: PreparedData) -> None:
        """Write the motions into a run folder."""
        run.mkdir(parents=True, exist_ok=True)
        tensors = {
            "clips": torch.from_numpy(self.clips),
            "captions": torch.from_numpy(self.captions),
            "lengths": self.lengths,
            "tokens": self.tokens.short(),
        }
        with whole_file(run / FILE, alone=True) as part:
            save_file(tensors, part, metadata={"key": _key(tokenizer, prepared)})

    def extend(self, clips: Sequence[Clip], tokens: TokenData, captions: C) -> tuple[list[Clip], TokenData, C]:
        """Append these motions to clips, tokens and captions."""
        device = tokens.tokens.device
        lengths = self.lengths.to(device)
        starts = len(tokens.tokens) + lengths.cumsum(0) - lengths
        more = replace(
            tokens,
            tokens=torch.cat([tokens.tokens, self.tokens.to(device)]),
            starts=torch.cat([tokens.starts, starts[:, None].expand(-1, tokens.phases)]),
            lengths=torch.cat([tokens.lengths, lengths[:, None].expand(-1, tokens.phases)]),
        )
        # Drawn for a slower clip or not, a motion plays at its own speed.
        own = [clips[clip].model_copy(update={"speed": 1.0}) for clip in self.clips]
        return [*clips, *own], more, captions.with_single(self.clips, self.captions)


def load_drawn(run: Path, tokenizer: MotionTokenizer, prepared: PreparedData) -> Drawn | None:
    """Read the motions of a run folder; None if there are none.

    Raises:
        InvalidFile: generated with another tokenizer, or for other data.
    """
    file = run / FILE
    if not file.is_file():
        return None
    try:
        with safe_open(file, "pt") as opened:
            key = (opened.metadata() or {}).get("key")
    except (SafetensorError, OSError) as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(file), hint="Remove it.") from error
    if key != _key(tokenizer, prepared):
        hint = "Remove it, or generate again (`marey train self-train`)."
        raise InvalidFile("was drawn with another tokenizer, or for other data", where=str(file), hint=hint)
    values = load_file(file)
    clips, captions = values["clips"].numpy(), values["captions"].numpy()
    return Drawn(clips, captions, values["lengths"], values["tokens"].long())


def _key(tokenizer: MotionTokenizer, prepared: PreparedData) -> str:
    return f"{FORMAT}:{prepared.sha256}:{float(tokenizer.codebooks.double().abs().sum()):.6f}"
