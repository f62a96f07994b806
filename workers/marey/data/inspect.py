"""Summary of a prepared folder: counts, lengths, captions, bytes."""

from __future__ import annotations

from collections import Counter

from pydantic import BaseModel, ConfigDict

from marey.data.manifest import Clip
from marey.data.pack import SPLITS
from marey.data.prepared import PreparedData


class Summary(BaseModel):
    """Counts of a prepared folder.

    Attributes:
        splits: clips by split.
        hours: total length of all clips, including mirrored and spliced ones.
        kinds: captured, mirrored, retimed, looped (another length of one action), spliced (several actions).
        actions: captured and mirrored clips by action and side, then by split.
        sequences: spliced clips by their actions, most frequent first.
        styles: captured and mirrored clips by style, then by split.
        lengths: clips by whole seconds, by split.
        captions: number of different captions, and examples by action.
        left_out: reasons with the number of clips left out for each.
        megabytes: size of each file.
    """

    model_config = ConfigDict(frozen=True)

    sources: tuple[str, ...]
    splits: dict[str, int]
    hours: float
    kinds: dict[str, int]
    acts: dict[str, dict[str, int]]
    sequences: dict[str, int]
    styles: dict[str, dict[str, int]]
    lengths: dict[str, dict[str, int]]
    captions: int
    examples: dict[str, tuple[str, ...]]
    left_out: dict[str, int]
    megabytes: dict[str, float]


def summarize(data: PreparedData) -> Summary:
    """Summarize an open folder."""
    manifest = data.manifest
    real = [clip for clip in data.clips if not clip.spliced]
    return Summary(
        sources=tuple(f"{source.title} ({source.licence})" for source in manifest.sources),
        splits=manifest.splits,
        hours=round(manifest.frames / manifest.fps / 3600, 2),
        kinds=manifest.kinds,
        acts=_by_split(real, [act_of(clip) for clip in real]),
        sequences=dict(Counter(" + ".join(clip.acts) for clip in data.clips if len(clip.acts) > 1).most_common(20)),
        styles=_by_split(real, [clip.style or "none" for clip in real]),
        lengths=manifest.lengths,
        captions=manifest.captions,
        examples={act_of(clip): clip.captions for clip in reversed(data.clips) if len(clip.acts) == 1},
        left_out=dict(Counter(manifest.left_out.values()).most_common()),
        megabytes={name: round(entry.bytes / 1e6, 1) for name, entry in manifest.files.items()},
    )


def act_of(clip: Clip) -> str:
    """First action with its side, such as `wave left`."""
    return f"{clip.acts[0]} {clip.sides[0] if clip.sides else ''}".strip()


def _by_split(clips: list[Clip], keys: list[str]) -> dict[str, dict[str, int]]:
    counts = Counter(zip(keys, (clip.split for clip in clips), strict=True))
    return {key: {split: counts[key, split] for split in SPLITS if counts[key, split]} for key in sorted(set(keys))}
