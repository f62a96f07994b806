"""HumanML3D, KIT-ML and CMP as published: features with captions, splits, mirror images and statistics, to a prepared
folder.

All three have the layout of HumanML3D (Guo et al. 2022):

    new_joint_vecs/NAME.npy     features (T, D)
    texts/NAME.txt              captions, see `marey.data.t2m_captions`
    train.txt, val.txt, test.txt    names of each split, those of mirror images (`MNAME`) among them
    Mean.npy, Std.npy           statistics (D,)

Features and statistics are taken over as they are. What is used is what the public loader uses (momask-codes,
data/t2m_dataset.py): clips of `shortest` to 199 frames; a caption with times of its own is a clip of its own, if that
piece is long enough; names without a feature file, or with one that holds NaN, are left out if they are few.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.arrays import check_array, read_npy
from marey.core.errors import InvalidFile, NotFound
from marey.data.folder import PreparedWriter
from marey.data.licences import Terms
from marey.data.manifest import Clip, Manifest, SourceEntry
from marey.data.published import SPLITS, LeftOut, measure, read_lines, read_statistics
from marey.data.sampling import UNLABELLED
from marey.data.t2m_captions import TaggedCaption, read_caption
from marey.motion.features import HUMANML3D_263, KIT_251, HeadingLayout, to_world

Float32 = NDArray[np.float32]
Progress = Callable[[int, int], None]

FEATURES, TEXTS = "new_joint_vecs", "texts"
MEAN, STD = "Mean.npy", "Std.npy"
LONGEST = 199
"""Frames of the longest clip that is used."""
MIRROR = "M"


@dataclass(frozen=True)
class T2MSet:
    """A set in the layout of HumanML3D.

    Attributes:
        terms: of the set.
        layout: of its features.
        shortest: frames of the shortest clip that is used.
    """

    terms: Terms
    layout: HeadingLayout
    shortest: int


HUMANML3D_SET = T2MSet(
    Terms(
        name="humanml3d",
        title="HumanML3D",
        licence="AMASS licence (non-commercial research); captions MIT",
        credit="Guo et al., Generating Diverse and Natural 3D Human Motions from Text, CVPR 2022; "
        "Mahmood et al., AMASS, ICCV 2019; Guo et al., HumanAct12, 2020",
        url="https://github.com/EricGuo5513/HumanML3D",
        tier="non-commercial",
    ),
    HUMANML3D_263,
    shortest=40,
)
KIT_SET = T2MSet(
    Terms(
        name="kit",
        title="KIT Motion-Language Dataset",
        licence="no licence is stated; treated as non-commercial",
        credit="Plappert et al., The KIT Motion-Language Dataset, Big Data 2016",
        url="https://motion-annotation.humanoids.kit.edu/dataset",
        tier="non-commercial",
    ),
    KIT_251,
    shortest=24,
)
CMP_SET = T2MSet(
    Terms(
        name="cmp",
        title="CombatMotionProcessed",
        licence="no licence is stated; the motions are taken from games: treated as non-commercial",
        credit="Liao et al., AnimationGPT, 2024",
        url="https://github.com/fyyakaxyy/AnimationGPT",
        tier="non-commercial",
    ),
    HUMANML3D_263,
    shortest=40,
)


@dataclass
class T2MFolder:
    """Reader of a published folder.

    Attributes:
        path: the folder.
        kind: the set that it holds.
        left_out: clips that are not used, each with the reason; filled while clips are read.
    """

    path: Path
    kind: T2MSet
    left_out: LeftOut = field(default_factory=LeftOut)

    def names(self) -> dict[str, str]:
        """Return the split of each listed name.

        Raises:
            NotFound, InvalidFile, TooLarge: a split file is missing or not text, or a name is in two splits or is none.
        """
        found: dict[str, str] = {}
        for split in SPLITS:
            file = self.path / f"{split}.txt"
            for number, name in enumerate(read_lines(file), start=1):
                where = f"{file}, line {number}"
                if not name:
                    continue
                if Path(name).name != name:
                    raise InvalidFile(f"{name[:60]!r} is not the name of a clip", where=where)
                if found.setdefault(name, split) != split:
                    raise InvalidFile(f"the clip {name} is in {found[name]} already", where=where)
        return found

    def pieces(self, name: str) -> Iterator[tuple[str, Float32, tuple[TaggedCaption, ...]]]:
        """Yield the clips that a listed name gives: id, features (T, D) and captions. The first is the whole clip.

        Raises:
            InvalidFile: features of another width, or a line that is no caption.
        """
        features = self._features(name)
        if features is None:
            return
        fps, whole = self.kind.layout.fps, list[TaggedCaption]()
        cropped: list[tuple[str, Float32, tuple[TaggedCaption, ...]]] = []
        for caption in self._captions(name):
            if caption.whole:
                whole.append(caption)
                continue
            piece = features[int(caption.start * fps) : int(caption.end * fps)]
            piece_id = _unused(f"{name}#{caption.start:g}#{caption.end:g}", [known for known, *_ in cropped])
            if self._fits(piece_id, piece):
                cropped.append((piece_id, piece, (caption,)))
        if whole:
            yield name, features, tuple(whole)
        elif not cropped:
            self.left_out.reasons.setdefault(name, "it has no caption")
        yield from cropped

    def _features(self, name: str) -> Float32 | None:
        path = self.path / FEATURES / f"{name}.npy"
        try:
            values = read_npy(path)
        except NotFound:
            self.left_out.miss(name, f"{FEATURES}/{name}.npy")
            return None
        wide = check_array(values, path.name, str(path), kinds="f", shape=(None, self.kind.layout.dim), finite=False)
        if not np.isfinite(wide).all():
            self.left_out.spoil(name, f"{FEATURES}/{name}.npy")
            return None
        return wide.astype(np.float32) if self._fits(name, wide) else None

    def _captions(self, name: str) -> Iterator[TaggedCaption]:
        path = self.path / TEXTS / f"{name}.txt"
        try:
            lines = read_lines(path)
        except NotFound:
            self.left_out.miss(name, f"{TEXTS}/{name}.txt")
            return
        for number, line in enumerate(lines, start=1):
            if line:
                yield read_caption(line, where=f"{path}, line {number}")

    def _fits(self, name: str, features: NDArray[np.floating]) -> bool:
        fits = self.kind.shortest <= len(features) <= LONGEST
        if not fits:
            self.left_out.reasons[name] = f"it is not {self.kind.shortest} to {LONGEST} frames long"
        return fits


def _unused(name: str, known: list[str]) -> str:
    """Return the name, with a number if it is known already: two captions may be of the same times."""
    same = sum(each == name or each.startswith(f"{name}-") for each in known)
    return f"{name}-{same + 1}" if same else name


def prepare_t2m(kind: T2MSet, path: Path, out: Path, *, progress: Progress | None = None) -> Manifest:
    """Write a prepared folder from a published one.

    Args:
        kind: the set.
        path: the published folder.
        out: a folder that is empty or does not exist; it is created only when complete.
        progress: called with the number of finished names and the total.

    Raises:
        NotFound, InvalidFile, TooLarge: see `T2MFolder`.
        Conflict: the folder `out` is not empty.
        InvalidInput: no training clip.
    """
    published = T2MFolder(path, kind)
    statistics = read_statistics(path / MEAN, path / STD, kind.layout.dim)
    names = published.names()
    with PreparedWriter(out, kind.layout) as writer:
        for done, (name, split) in enumerate(names.items(), start=1):
            mirrored = name.startswith(MIRROR) and name.removeprefix(MIRROR) in names
            for clip_id, features, captions in published.pieces(name):
                joints = joints_of(features, kind.layout)
                clip = _described(clip_id, features, captions, kind, writer, split=split, mirrored=mirrored)
                writer.append(features, joints, clip)
            if progress:
                progress(done, len(names))
        hint = f"The folder holds {FEATURES}, {TEXTS}, {MEAN}, {STD} and the names of the splits."
        published.left_out.check(len(names), where=path, hint=hint)
        writer.check_split()
        writer.close_arrays()
        captured = sum(not (clip.mirrored or clip.cropped) for clip in writer.clips)
        manifest = Manifest(
            **writer.contents(),
            sources=(SourceEntry(**vars(kind.terms), clips=captured),),
            tier=kind.terms.tier,
            facing_sigma=kind.layout.facing_sigma,
            left_out=published.left_out.reasons,
            compositional_pairs=(),
        )
        return writer.complete(statistics, manifest)


def _described(
    clip_id: str,
    features: Float32,
    captions: tuple[TaggedCaption, ...],
    kind: T2MSet,
    writer: PreparedWriter,
    *,
    split: str,
    mirrored: bool,
) -> Clip:
    turn = -2 * float(np.degrees(features[:, 0].astype(np.float64).sum()))
    return Clip(
        id=clip_id,
        **writer.place(features),
        split=split,
        dataset=kind.terms.name,
        content=UNLABELLED,
        style="",
        mirrored=mirrored,
        spliced=(),
        acts=(UNLABELLED,),
        measured=measure(features, kind.layout, kind.layout.unit, turn),
        captions=tuple(caption.text for caption in captions),
        cropped=not captions[0].whole,
        tags=tuple(caption.tags for caption in captions),
    )


def joints_of(features: Float32, layout: HeadingLayout) -> Float32:
    """Return joints (T + 1, J, 3) in metres of features (T, D): the velocities of the last frame lead to one more
    pose."""
    joints = layout.decode(features)
    half_yaw, _ = layout.root_trajectory(features)
    step = features[-1, layout.slices["velocities"]].astype(np.float64).reshape(-1, 3) * layout.unit
    step[:, [0, 2]] = to_world(half_yaw[-1], step[:, [0, 2]])
    return np.concatenate([joints, joints[-1:] + step.astype(np.float32)])
