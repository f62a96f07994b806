"""Mix prepared data: a set with a share of another's training clips (MOGO Tab. 6, HumanML3D with CMP)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from marey.core.errors import InvalidInput
from marey.data.folder import PreparedWriter
from marey.data.licences import check_mix
from marey.data.manifest import Clip, Manifest, SourceEntry
from marey.data.prepared import PreparedData

Progress = Callable[[int, int], None]


def mix(
    base: PreparedData, other: PreparedData, share: float, out: Path, *, seed: int = 0, progress: Progress | None = None
) -> Manifest:
    """Write a prepared folder of all clips of `base` and a share of the training clips of `other`.

    Clips for validation and tests, and the statistics, are those of `base`, so that a tokenizer that was trained on it
    reads the mix. A clip of `other` comes with its mirror image and its pieces; its id gets the name of its set.

    Args:
        base: the set that is kept whole.
        other: the set of which a part is added.
        share: 0 to 1 of the different training clips of `other`.
        out: a folder that is empty or does not exist.
        seed: of the draw. A larger share holds all clips of a smaller one.
        progress: called with the number of finished clips and the total.

    Raises:
        InvalidInput: a share out of range, other layouts or terms that may not be mixed.
        Conflict: the folder `out` is not empty.
    """
    _check(base, other, share)
    added = drawn(other, share, seed)
    total = len(base.clips) + len(added)
    with PreparedWriter(out, base.layout) as writer:
        for data, clips in ((base, base.clips), (other, [_renamed(clip) for clip in added])):
            for clip in clips:
                features = data.features(clip)
                place = writer.place(features)
                writer.append(features, data.joints(clip), clip.model_copy(update=place))
                if progress:
                    progress(len(writer.clips), total)
        writer.check_split()
        writer.close_arrays()
        return writer.complete((base.mean, base.std), _manifest(writer, base, other if added else None, added))


def drawn(data: PreparedData, share: float, seed: int) -> list[Clip]:
    """Return the clips of a share of the training clips, in their order; mirror images and pieces follow their clip."""
    groups = defaultdict[str, list[Clip]](list)
    for clip in data.split("train"):
        groups[_group(clip)].append(clip)
    names = sorted(groups)
    order = np.random.default_rng(seed).permutation(len(names))[: round(share * len(names))]
    chosen = {names[int(number)] for number in order}
    return [clip for clip in data.split("train") if _group(clip) in chosen]


def _group(clip: Clip) -> str:
    """Return the name that a clip, its mirror image and its pieces share."""
    name = clip.id.partition("#")[0]
    return name.removeprefix("M") if clip.mirrored else name


def _renamed(clip: Clip) -> Clip:
    """Put the name of the set in front of the ids: HumanML3D and CMP both number their clips."""
    spliced = tuple(f"{clip.dataset}-{each}" for each in clip.spliced)
    return clip.model_copy(update={"id": f"{clip.dataset}-{clip.id}", "spliced": spliced})


def _check(base: PreparedData, other: PreparedData, share: float) -> None:
    if not 0 <= share <= 1:
        raise InvalidInput(f"is {share:g}, not a share from 0 to 1", where="share")
    ours, theirs = base.manifest, other.manifest
    for what in ("layout", "fps", "facing_sigma"):
        if getattr(ours, what) != getattr(theirs, what):
            raise InvalidInput(
                f"the {what} is {getattr(theirs, what)}, not {getattr(ours, what)} as in {base.path}",
                where=str(other.path),
                hint="Only data of the same features can be mixed.",
            )
    if common := {terms.name for terms in ours.terms} & {terms.name for terms in theirs.terms}:
        raise InvalidInput(f"both hold clips of {min(common)}", where=str(other.path))
    check_mix((*ours.terms, *theirs.terms))


def _manifest(
    writer: PreparedWriter, base: PreparedData, other: PreparedData | None, added: Sequence[Clip]
) -> Manifest:
    """Return the manifest of the mix; `other` is None where nothing of it was added."""
    sources = base.manifest.sources
    left_out, caption_files = dict(base.manifest.left_out), dict(base.manifest.caption_files)
    if other is not None:
        sources += tuple(_counted(source, added) for source in other.manifest.sources)
        left_out |= {f"{other.manifest.sources[0].name}-{name}": why for name, why in other.manifest.left_out.items()}
        caption_files |= other.manifest.caption_files
    return Manifest(
        **writer.contents(),
        sources=sources,
        tier=check_mix([*base.manifest.terms, *(other.manifest.terms if other else ())]),
        facing_sigma=base.manifest.facing_sigma,
        caption_files=caption_files,
        left_out=left_out,
        compositional_pairs=base.manifest.compositional_pairs,
    )


def _counted(source: SourceEntry, added: Sequence[Clip]) -> SourceEntry:
    """Return a source with the number of its captured clips that were added."""
    return source.model_copy(update={"clips": sum(clip.captured and clip.dataset == source.name for clip in added)})
