"""Mix prepared data with their captions as they were read: no caption is read twice."""

from __future__ import annotations

from pathlib import Path

from marey.data.manifest import TEXTS, Manifest
from marey.data.mix import Progress, mix
from marey.data.prepared import PreparedData
from marey.training.texts import CaptionTexts, KnownCaptions


def mix_with_texts(
    base: Path, other: Path, share: float, out: Path, *, seed: int = 0, progress: Progress | None = None
) -> Manifest:
    """Write a prepared folder of `base` and a share of the training clips of `other`; see `marey.data.mix.mix`.

    Its captions are those of both folders as `marey data text` has read them, where it has read both.

    Raises:
        InvalidInput: as `mix`, or captions that different pipelines have read.
        NotFound, InvalidFile: of the folders.
        Conflict: the folder `out` is not empty.
    """
    folders = PreparedData.open(base), PreparedData.open(other)
    read = all((data.path / TEXTS).is_file() for data in folders)
    known = [KnownCaptions.load(data) for data in folders] if read else []
    if known:
        CaptionTexts.of_known([], known)  # before anything is written
    manifest = mix(*folders, share, out, seed=seed, progress=progress)
    if known:
        clips = PreparedData.open(out, verify=False).clips
        CaptionTexts.of_known([clip.all_captions for clip in clips], known).save(out)
    return manifest
