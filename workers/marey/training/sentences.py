"""Captions of all clips as sentence features on one device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.core.errors import InvalidFile
from marey.data.sampling import author_table, draw_captions
from marey.training.texts import CaptionTexts


@dataclass(frozen=True)
class SentenceData:
    """Features of whole sentences, without the parts of their graphs."""

    strings: Tensor  # (U, W) float16
    sentence: Tensor  # (K,) int64: string of each caption
    first: NDArray[np.int64]  # (C,): captions of clip c begin there; those of its actions alone follow them
    authors: NDArray[np.int64]  # (C, A): captions of the whole clip by each author, 0 beyond its last

    @classmethod
    def of_sentences(
        cls, texts: CaptionTexts, counts: Sequence[Sequence[int]], width: int, device: torch.device
    ) -> SentenceData:
        """Put the captions on a device; `counts` are those of each whole clip by each author.

        Raises:
            InvalidFile: texts of another encoder's width.
        """
        return SentenceData(**sentence_fields(texts, counts, width, device))

    def with_single(self, clips: NDArray[np.int64], captions: NDArray[np.int64]) -> Self:
        """Return the same data with further clips of one caption each: `captions` (M,) of those of `clips` (M,)."""
        first = np.concatenate([self.first, self.first[clips] + captions])
        one = np.zeros((len(clips), self.authors.shape[1]), np.int64)
        one[:, :1] = 1
        return replace(self, first=first, authors=np.concatenate([self.authors, one]))

    @property
    def count(self) -> NDArray[np.int64]:
        """Captions (C,) of each whole clip."""
        return self.authors.sum(axis=1)

    def choose(self, clips: NDArray[np.int64], rng: np.random.Generator) -> Tensor:
        """Draw one caption of each clip (B,): first an author, then one of the author's."""
        chosen = self.first[clips] + draw_captions(self.authors[clips], rng.random(len(clips)))
        return torch.from_numpy(chosen).to(self.sentence.device)

    def sentences(self, captions: Tensor) -> Tensor:
        """Return sentence features (B, W)."""
        return self.strings[self.sentence[captions]].float()

    def captions_of(self, clips: Sequence[int]) -> Tensor:
        """Return all captions of some whole clips."""
        count = self.count
        rows = np.concatenate([self.first[c] + np.arange(count[c]) for c in clips])
        return torch.from_numpy(rows).to(self.sentence.device)


def sentence_fields(
    texts: CaptionTexts, counts: Sequence[Sequence[int]], width: int, device: torch.device
) -> dict[str, Any]:
    """Return the fields of `SentenceData`, validated."""
    if texts.strings.shape[1] != width:
        raise InvalidFile(
            f"texts have width {texts.strings.shape[1]}; this configuration reads {width}",
            hint="Run `marey data text` with the encoder of the configuration.",
        )
    whole = texts.node_string[texts.node_start[:-1]]  # the motion node comes first
    return {
        "strings": torch.from_numpy(np.asarray(texts.strings)).to(device),
        "sentence": torch.from_numpy(whole.astype(np.int64)).to(device),
        "first": np.asarray(texts.first[:-1], np.int64),
        "authors": author_table(counts),
    }


def text_statistics(strings: Tensor, index: Tensor) -> tuple[Tensor, Tensor]:
    """Return mean and std (W,) of the strings (U, W) at `index`, each counted as often as it occurs there."""
    counts = torch.bincount(index, minlength=len(strings)).double()
    share = (counts / counts.sum().clamp(min=1))[:, None]
    values = strings.double()
    mean = (values * share).sum(0)
    std = ((values - mean).square() * share).sum(0).sqrt().clamp(min=1e-4)
    return mean.float(), std.float()
