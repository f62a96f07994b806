"""What training reads: a prepared folder as tensors, and batches drawn from it.

Choices of data come from a numpy generator that the loop seeds from (seed, step, rank); nothing here has a state.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shared.errors import InvalidFile, NotFound


@dataclass(frozen=True)
class Clip:
    """One line of `clips.jsonl`, as far as training needs it."""

    id: str
    start: int  # first feature frame
    length: int  # feature frames
    split: str
    dataset: str  # with the part of it, where content names one: bandai-namco/1
    content: str
    style: str
    mirrored: bool
    spliced: tuple[str, ...]
    captions: int  # how many


@dataclass(frozen=True)
class MotionData:
    """All clips of a prepared folder, end to end on one device."""

    features: Tensor  # (F, D) float32, in their own units
    mean: Tensor  # (D,)
    std: Tensor  # (D,), grouped
    clips: tuple[Clip, ...]
    manifest_sha256: str

    @classmethod
    def load(cls, folder: Path, device: torch.device) -> MotionData:
        """Read a prepared folder.

        Raises:
            NotFound: no such folder, or it is no prepared folder.
            InvalidFile: a file in it is broken.
        """
        import hashlib

        for name in ("manifest.json", "features.npy", "clips.jsonl", "statistics.npz"):
            if not (folder / name).is_file():
                raise NotFound(f"there is no {name}", where=str(folder), hint="Run `marey data prepare` first.")
        features = np.load(folder / "features.npy", mmap_mode="r", allow_pickle=False)
        statistics = np.load(folder / "statistics.npz", allow_pickle=False)
        lines = (folder / "clips.jsonl").read_text(encoding="utf-8").splitlines()
        clips = tuple(_clip(line, folder / "clips.jsonl", i + 1) for i, line in enumerate(lines))
        if clips and max(c.start + c.length for c in clips) > len(features):
            raise InvalidFile("clips reach beyond the features", where=str(folder / "clips.jsonl"))
        return cls(
            torch.from_numpy(np.array(features, dtype=np.float32)).to(device),
            torch.from_numpy(statistics["mean"].astype(np.float32)).to(device),
            torch.from_numpy(statistics["std"].astype(np.float32)).to(device),
            clips,
            hashlib.sha256((folder / "manifest.json").read_bytes()).hexdigest(),
        )

    def split(self, name: str) -> list[int]:
        """Indices of the clips of a split."""
        return [i for i, clip in enumerate(self.clips) if clip.split == name]

    def windows(self, starts: Tensor, size: int) -> Tensor:
        """(B,) first frames to features (B, size, D); frames beyond the last one of all repeat it."""
        index = starts[:, None] + torch.arange(size, device=self.features.device)
        return self.features[index.clamp(max=len(self.features) - 1)]


def content_style_weights(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Sampling weights: count^-0.5 per content, then per style within it; they sum to 1.

    A class with n clips gets mass proportional to n^0.5 altogether: rare ones are seen more often than their count
    says, yet not as often as common ones.
    """
    contents = Counter(c.content for c in clips)
    styles = Counter((c.content, c.style) for c in clips)
    content_mass = {name: count**0.5 for name, count in contents.items()}
    style_total: Counter[str] = Counter()
    for (content, _), count in styles.items():
        style_total[content] += count**0.5  # pyright: ignore[reportArgumentType]
    weights = np.array(
        [
            content_mass[c.content]
            * (styles[c.content, c.style] ** 0.5 / style_total[c.content])
            / styles[c.content, c.style]
            for c in clips
        ]
    )
    return weights / weights.sum()


def _part(dataset: str, content: str) -> str:
    number, slash, _ = content.partition("/")
    return f"{dataset}/{number}" if slash and number.isdigit() else dataset


def _clip(line: str, file: Path, number: int) -> Clip:
    try:
        v = json.loads(line)
        return Clip(
            id=str(v["id"]),
            start=int(v["start"]),
            length=int(v["length"]),
            split=str(v["split"]),
            dataset=_part(str(v["dataset"]), str(v["content"])),
            content=str(v["content"]),
            style=str(v["style"]),
            mirrored=bool(v["mirrored"]),
            spliced=tuple(v.get("spliced", ())),
            captions=len(v.get("captions", ())),
        )
    except (json.JSONDecodeError, KeyError, TypeError, ValueError) as error:
        raise InvalidFile(f"is not a clip: {error!r}", where=f"{file}:{number}") from error
