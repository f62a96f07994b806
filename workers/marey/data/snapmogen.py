"""SnapMoGen as published (Guo et al. 2025): features of 24 joints at 30 fps, with six captions a clip, to a prepared
folder.

The published folder holds `renamed_feats/{mid}.npy` (the unpacked renamed_feats.zip), `all_caption_clean.json`,
`meta_data/{mean,std}.npy` and `data_split_info/{train,val,test}_ids.txt`. A clip is `mid#start#end`: frames of one
feature file. A mid with `m_` before it is the mirror image. Features and statistics are taken over as they are, since
the published networks were trained on them. Clips without a feature file, or with NaN in theirs, are left out if they
are few.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.arrays import check_array, map_npy
from marey.core.documents import read_json
from marey.core.errors import InvalidFile, NotFound
from marey.data.folder import PreparedWriter
from marey.data.licences import Terms
from marey.data.manifest import Clip, Manifest, Measured, SourceEntry
from marey.data.published import MAX_TEXT, SPLITS, LeftOut, read_lines, read_statistics
from marey.data.published import measure as measure_travel
from marey.data.sampling import UNLABELLED
from marey.data.wording import mirrored
from marey.motion.rig_features import SNAPMOGEN_296 as LAYOUT

Float32 = NDArray[np.float32]
Progress = Callable[[int, int], None]

FEATURES, CAPTIONS, META, SPLIT_INFO = "renamed_feats", "all_caption_clean.json", "meta_data", "data_split_info"
TERMS = Terms(
    name="snapmogen",
    title="SnapMoGen",
    licence="Snap Inc. Non-Commercial Licence",
    credit="Guo et al., SnapMoGen: Human Motion Generation from Expressive Texts, 2025; Snap Inc.",
    url="https://huggingface.co/datasets/Ericguo5513/SnapMoGen",
    tier="non-commercial",
)
AUTHORS = ("manual", "gpt")
"""Captions by people, and captions that a language model made from those."""
MIRROR = "m_"
_ID = re.compile(r"(?P<mid>[A-Za-z0-9_.-]+)#(?P<start>\d{1,9})#(?P<end>\d{1,9})")


@dataclass(frozen=True)
class PublishedClip:
    """A clip of the published folder.

    Attributes:
        id: `mid#start#end`.
        split: train, val or test.
        mid: name of the feature file.
        start, end: its frames there, the end exclusive.
        captions: by people first.
    """

    id: str
    split: str
    mid: str
    start: int
    end: int
    captions: tuple[str, ...]


@dataclass(frozen=True)
class PublishedFolder:
    """Reader of the published folder.

    Attributes:
        path: the folder.
    """

    path: Path

    def clips(self) -> Iterator[PublishedClip]:
        """Yield the clips of the three splits, in their order.

        Raises:
            NotFound: a split file or the captions are missing.
            InvalidFile: a line that is not a clip, a clip in two splits, or a clip without captions.
        """
        seen: dict[str, str] = {}
        for split in SPLITS:
            file = self.path / SPLIT_INFO / f"{split}_ids.txt"
            for number, name in enumerate(read_lines(file), start=1):
                where = f"{file}, line {number}"
                if not name:
                    continue
                if name in seen:
                    if seen[name] == split:
                        continue
                    raise InvalidFile(f"the clip {name} is in {seen[name]} already", where=where)
                seen[name] = split
                yield self._clip(name, split, where)

    def _clip(self, name: str, split: str, where: str) -> PublishedClip:
        found = _ID.fullmatch(name)
        if found is None:
            raise InvalidFile(f"{name[:60]!r} is not a clip", where=where, hint="A clip is written mid#start#end.")
        start, end = int(found["start"]), int(found["end"])
        if end <= start:
            raise InvalidFile(f"the clip {name} ends before it starts", where=where)
        return PublishedClip(name, split, found["mid"], start, end, self._captions_of(name, where))

    def _captions_of(self, name: str, where: str) -> tuple[str, ...]:
        """Return the captions of a clip; a mirror image without its own has those of the clip, with sides exchanged."""
        own = self._captions.get(name)
        if own is not None:
            return own
        other = self._captions.get(name.removeprefix(MIRROR)) if name.startswith(MIRROR) else None
        if other is None:
            raise InvalidFile(f"the clip {name} has no captions in {CAPTIONS}", where=where)
        return tuple(map(mirrored, other))

    @cached_property
    def _captions(self) -> Mapping[str, tuple[str, ...]]:
        path = self.path / CAPTIONS
        document = read_json(path, limit=MAX_TEXT)
        if not isinstance(document, dict):
            raise InvalidFile("is not a JSON object of clips", where=str(path))
        return {str(name): _captions_in(entry, f"{path}: {name}") for name, entry in document.items()}

    def features(self, clip: PublishedClip, left_out: LeftOut) -> Float32 | None:
        """Return the features (T, 296) of a clip; None, with the reason in `left_out`, without a file or with NaN.

        Raises:
            InvalidFile: its file has another width, or ends before the clip does.
        """
        path = self.path / FEATURES / f"{clip.mid}.npy"
        try:
            every = map_npy(path)
        except NotFound:
            left_out.miss(clip.id, f"{FEATURES}/{clip.mid}.npy")
            return None
        check_array(every, path.name, str(path), kinds="f", shape=(None, LAYOUT.dim), finite=False)
        if clip.end > len(every):
            message = f"the clip {clip.id} ends at frame {clip.end}, the file holds {len(every)}"
            raise InvalidFile(message, where=str(path))
        frames = every[clip.start : clip.end].astype(np.float32)
        if not np.isfinite(frames).all():
            left_out.spoil(clip.id, f"{FEATURES}/{clip.mid}.npy")
            return None
        return frames

    def statistics(self) -> tuple[Float32, Float32]:
        """Return the published mean and deviation (296,); raises as `read_statistics`."""
        return read_statistics(self.path / META / "mean.npy", self.path / META / "std.npy", LAYOUT.dim)


def _captions_in(entry: Any, where: str) -> tuple[str, ...]:
    if not isinstance(entry, dict):
        raise InvalidFile(f"is not an object with {' and '.join(AUTHORS)}", where=where)
    said: list[Any] = []
    for author in AUTHORS:
        texts: Any = entry.get(author, [])
        if not isinstance(texts, list):
            raise InvalidFile(f"{author} is not a list of captions", where=where)
        said.extend(texts)
    if not all(isinstance(text, str) for text in said):
        raise InvalidFile("holds a caption that is not text", where=where)
    captions = tuple(" ".join(text.split()) for text in said if text.strip())
    if not captions:
        raise InvalidFile("holds no caption", where=where)
    return captions


def prepare_snapmogen(path: Path, out: Path, *, progress: Progress | None = None) -> Manifest:
    """Write a prepared folder from the published one.

    Args:
        path: the published folder.
        out: a folder that is empty or does not exist; it is created only when complete.
        progress: called with the number of finished clips and the total.

    Raises:
        NotFound, InvalidFile: see `PublishedFolder`.
        Conflict: the folder `out` is not empty.
        InvalidInput: no training clip.
    """
    published = PublishedFolder(path)
    statistics = published.statistics()
    clips, left_out = list(published.clips()), LeftOut()
    with PreparedWriter(out, LAYOUT) as writer:
        for done, clip in enumerate(clips, start=1):
            features = published.features(clip, left_out)
            if features is not None:
                writer.append(features, joints_of(features), _described(clip, features, writer))
            if progress:
                progress(done, len(clips))
        hint = f"Unpack renamed_feats.zip, so that its files lie in {FEATURES}/."
        left_out.check(len(clips), where=path, hint=hint)
        writer.check_split()
        writer.close_arrays()
        captured = sum(not clip.mirrored for clip in writer.clips)
        manifest = Manifest(
            **writer.contents(),
            sources=(SourceEntry(**vars(TERMS), clips=captured),),
            tier=TERMS.tier,
            facing_sigma=LAYOUT.facing_sigma,
            left_out=left_out.reasons,
            compositional_pairs=(),
        )
        return writer.complete(statistics, manifest)


def _described(clip: PublishedClip, features: Float32, writer: PreparedWriter) -> Clip:
    return Clip(
        id=clip.id,
        **writer.place(features),
        split=clip.split,
        dataset=TERMS.name,
        content=UNLABELLED,
        style="",
        mirrored=clip.mid.startswith(MIRROR),
        spliced=(),
        acts=(UNLABELLED,),
        measured=measure(features),
        captions=clip.captions,
    )


def joints_of(features: Float32) -> Float32:
    """Return joints (T + 1, 24, 3) in metres of features (T, 296): the velocities of the last frame lead to one more
    pose."""
    slices = LAYOUT.slices
    last = features[-1:].copy()
    last[:, slices["positions"]] += last[:, slices["velocities"]]
    last[:, slices["height"]] = last[:, slices["positions"]][:, 1:2]
    return LAYOUT.decode_positions(np.concatenate([features, last]))


def measure(features: Float32) -> Measured:
    """Measure the travel of features (T, 296), and count how often a toe comes to stand."""
    values = features[:, 0].astype(np.float64)
    yaw = values - 2 * np.pi * np.round(values / (2 * np.pi))  # published steps may be a turn too long
    return measure_travel(features, LAYOUT, LAYOUT.unit, -float(np.degrees(yaw.sum())))
