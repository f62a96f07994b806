"""Stage 2 of data preparation: convert joints packs to a prepared folder, with the same bytes on every machine."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.core.sides import swap_sides
from marey.data import wording
from marey.data.captions import captions, phrasings
from marey.data.compose import COMPOSED, COUNTS, Composed, compose
from marey.data.describe import ACTIONS, STYLE_NAMES, Facts, describe, describe_text
from marey.data.folder import LEAST_STD, PreparedWriter
from marey.data.gestures import made_gestures
from marey.data.grammar import grammar
from marey.data.lengthen import SHORT, between_idles, closes, repeated, travelling
from marey.data.licences import check_mix
from marey.data.manifest import Clip, Manifest, Measured, SourceEntry
from marey.data.pack import SPLITS, JointsPack, PackClip
from marey.data.part import FPS, MAX_FRAMES, MIN_FRAMES, Part
from marey.data.retarget import resample_points
from marey.data.soundness import is_broken
from marey.data.splits import Sourced, actions_of, splits_by_source
from marey.data.spoken import sayings, spoken
from marey.data.text_sequences import compose_texts, joined_texts
from marey.motion.features import HUMANML3D_263
from marey.posing.bones import with_bones

Array = NDArray[np.floating]
# The heading is smoothed over half a second: this removes the sway of a gait (1 Hz) but follows turns. Hips and
# shoulders have equal weight, frame 0 has no jump, and an undefined heading keeps its last value. Decoding is that of
# HumanML3D.
LAYOUT = HUMANML3D_263.with_facing(sigma=10.0, hips=1.0, start="smoothed", held=True)
COMPOSITIONAL_SPLIT = "compositional"
LARGEST_SPEED = 0.5

Progress = Callable[[int, int], None]


def windows(frames: int) -> list[slice]:
    """Split a clip into pieces of at most MAX_FRAMES + 1 poses; trim both ends of a clip slightly over the limit."""
    limit = MAX_FRAMES + 1
    if frames <= limit:
        return [slice(0, frames)]
    if frames < 1.3 * limit:
        first = (frames - limit) // 2
        return [slice(first, first + limit)]
    count = -(-frames // limit)
    edges = np.linspace(0, frames, count + 1).round().astype(int)
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def held_out_pairs(packs: Sequence[JointsPack]) -> frozenset[tuple[str, str]]:
    """(content, style) pairs of the compositional split; no clip of another split may show them, mirrored or not."""
    return frozenset((c.content, c.style) for pack in packs for c in pack.clips if c.split == COMPOSITIONAL_SPLIT)


def with_splits(packs: Sequence[JointsPack], left_out: dict[str, str]) -> list[JointsPack]:
    """Assign a split to every clip, by source where the index gives none. If two sets contain the same source, such as
    a trial on two rigs, only the clips of the first set are used."""
    set_of: dict[str, str] = {}
    free: list[Sourced] = []
    kept: list[list[PackClip]] = []
    for pack in packs:
        kept.append([])
        for clip in pack.clips:
            source = clip.source or clip.id
            if set_of.setdefault(source, clip.dataset) != clip.dataset:
                left_out[f"{clip.dataset}/{clip.id}"] = f"its source {source!r} is taken from {set_of[source]}"
                continue
            kept[-1].append(clip)
            if not clip.split:
                free.append(Sourced(source, actions_of(clip.content), pack.terms_of(clip).tier))
    split = splits_by_source(free)
    return [
        replace(pack, clips=tuple(replace(c, split=c.split or split[c.source or c.id]) for c in clips))
        for pack, clips in zip(packs, kept, strict=True)
    ]


def parts_of(packs: Sequence[JointsPack], left_out: dict[str, str], speed: float = 0.0) -> Iterator[Part]:
    """Yield windows of each captured clip and its mirror image, with their facts; record rejected clips in `left_out`.
    With `speed`, each training clip is followed by copies that are slower and faster by that share."""
    held_out = held_out_pairs(packs)
    idles = _idles(packs)
    for pack in packs:
        for captured in pack.clips:
            clip, whole = _lengthened(captured, pack.joints(captured), pack.terms_of(captured).tier, idles)
            yield from _windows_of(clip, whole, 1.0, held_out, left_out)
            if speed and clip.split == "train":
                told = _said(clip, wording.retimed)
                for factor in (1 - speed, 1 + speed):
                    retimed = with_bones(resample_points(whole.astype(np.float64), FPS * factor, FPS))
                    yield from _windows_of(told, retimed.astype(np.float32), factor, held_out, left_out)


def _windows_of(
    clip: PackClip,
    whole: NDArray[np.float32],
    speed: float,
    held_out: frozenset[tuple[str, str]],
    left_out: dict[str, str],
) -> Iterator[Part]:
    """Windows of a clip (T, 22, 3) and its mirror image."""
    pieces = windows(len(whole))
    pace = "" if speed == 1 else f"*{speed:g}"
    for mirrored in (False, True):
        content = swap_sides(clip.content) if mirrored else clip.content
        if mirrored and (content, clip.style) in held_out and clip.split != COMPOSITIONAL_SPLIT:
            left_out[f"M{clip.id}{pace}"] = "its mirror image shows a held-out pair"
            continue
        for k, piece in enumerate(pieces):
            joints = LAYOUT.mirror_joints(whole[piece]) if mirrored else whole[piece]
            name = ("M" if mirrored else "") + clip.id + pace + (f"@{k}" if len(pieces) > 1 else "")
            facts = _facts(clip, content, joints, name, mirrored=mirrored)
            if len(joints) <= MIN_FRAMES:
                left_out[name] = "shorter than a second"
            elif is_broken(joints, FPS):
                left_out[name] = "broken capture: joints bend or jump as no body does"
            elif _jumps(joints):
                left_out[name] = "the body has no clear heading"
            elif facts is None:
                left_out[name] = "label and motion contradict each other"
            else:
                yield Part(name, clip, content, mirrored, joints, facts, speed)


IDLE = "idle"
STANCES = (IDLE, "fight-stance")
Idles = Mapping[tuple[str, str], Sequence[NDArray[np.float32]]]


def _idles(packs: Sequence[JointsPack]) -> Idles:
    """Joints of idles and guards, which extend short clips: by data set and split, and by licence tier and split for
    clips whose own data set has no pose that is close enough."""
    found: defaultdict[tuple[str, str], list[NDArray[np.float32]]] = defaultdict(list)
    for pack in packs:
        for clip in pack.clips:
            if clip.content in STANCES:
                for group in {clip.dataset, pack.terms_of(clip).tier}:
                    found[group, clip.split].append(pack.joints(clip))
    return found


def _lengthened(
    clip: PackClip, joints: NDArray[np.float32], tier: str, idles: Idles
) -> tuple[PackClip, NDArray[np.float32]]:
    """Add travel to a gait on the spot and lengthen a short clip where possible; see `lengthen`. Clips of sets with
    fixed splits are not lengthened."""
    cyclic = clip.in_place and not _ONCE.search(clip.facts)
    if clip.in_place and (moved := travelling(joints)) is not None:
        joints = moved.astype(np.float32)
        clip = replace(_said(clip, wording.travelling), in_place=False)
    if not clip.source or len(joints) > SHORT:
        return clip, joints
    if (cyclic or clip.content == IDLE) and closes(joints):
        return _said(clip, wording.repeated), repeated(joints).astype(np.float32)
    for group in (clip.dataset, tier):
        made = between_idles(joints, idles.get((group, clip.split), ()), clip.id)
        if made is not None and not is_broken(made, FPS):
            return clip, made.astype(np.float32)
    return clip, joints


_ONCE = re.compile(r"\b(once|twice|one (shot|blow))\b")


def _said(clip: PackClip, change: Callable[[str], str | None]) -> PackClip:
    """Return the clip with its captions and facts changed; drop those that cannot be changed."""
    changed = (tuple(new for text in said if (new := change(text))) for said in clip.captions)
    return replace(clip, facts=change(clip.facts) or "", captions=tuple(said for said in changed if said))


def _facts(clip: PackClip, content: str, joints: NDArray[np.float32], name: str, *, mirrored: bool) -> Facts | None:
    """Facts of a clip: captions of its index, and for training the vocabulary's; or the caption grammar if it has the
    action and the style."""
    told = content in ACTIONS and STYLE_NAMES.get(clip.style, clip.style) in grammar().styles
    if clip.captions or not told:
        seen = f"a person {clip.facts}." if clip.facts else f"a person does this: {clip.content}."
        authors = clip.captions or ((seen,),)
        if mirrored:
            authors = tuple(tuple(map(wording.mirrored, said)) for said in authors)
        if clip.split == "train" and (words := spoken(content, name)):
            authors += (words,)
        return describe_text(authors, joints, FPS)
    return describe(content, clip.style, joints, FPS)


_LARGEST_YAW_STEP = 0.4  # radians of half yaw a frame, smoothed: 900 degrees a second


def _jumps(joints: NDArray[np.float32]) -> bool:
    """Return True if the heading jumps: in a body bent over backwards, hips and shoulders are perpendicular."""
    return bool(np.abs(LAYOUT.encode(joints)[:, 0]).max() > _LARGEST_YAW_STEP)


class FolderWriter(PreparedWriter):
    """Write the prepared folder of captured clips on 22 joints."""

    def __init__(self, out: Path) -> None:
        super().__init__(out, LAYOUT)

    def add_part(self, part: Part) -> None:
        """Encode and append a clip of one action."""
        self._add(part, part.joints, (part.facts,), name=part.id, made=part.made)

    def add_composed(self, composed: Composed) -> None:
        """Encode and append a clip that is composed of others."""
        parts = composed.parts
        self._add(
            parts[0],
            composed.joints,
            composed.facts,
            name=composed.name,
            spliced=tuple(part.id for part in parts),
            seams=composed.seams,
            made=any(part.made for part in parts),
        )

    def _add(
        self,
        part: Part,
        joints: NDArray[np.floating],
        actions: Sequence[Facts],
        *,
        name: str,
        made: bool,
        spliced: tuple[str, ...] = (),
        seams: tuple[int, ...] = (),
    ) -> None:
        """Encode and append one clip; joints (T, 22, 3)."""
        placed = LAYOUT.canonicalize(joints)
        features = LAYOUT.encode(placed)
        told = _authors(part, actions, name)
        self.append(
            features,
            placed,
            Clip(
                id=name,
                **self.place(features),
                split=part.source.split,
                dataset=part.source.dataset,
                content=part.content,
                style=part.source.style,
                mirrored=part.mirrored,
                speed=part.speed,
                made=made,
                spliced=spliced,
                acts=tuple(facts.action for facts in actions),
                sides=tuple(facts.side for facts in actions),
                measured=_measured(actions[0], len(features)),
                captions=tuple(chain(*told)) or captions(actions, name, phrasings(actions, spliced=bool(spliced))),
                authors=tuple(map(len, told)),
                seams=seams,
                act_captions=_act_captions(actions, name) if len(actions) > 1 else (),
            ),
        )

    def finish(self, packs: Sequence[JointsPack], left_out: dict[str, str]) -> Manifest:
        """Write statistics, manifest and hashes, then move the complete folder to its final path."""
        self.check_split()
        return self.complete(self._statistics(self.close_arrays()), self._manifest(packs, left_out))

    def _statistics(self, features: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Mean and group-averaged deviation of the captured and mirrored training clips."""
        total, squares, count = np.zeros(LAYOUT.dim), np.zeros(LAYOUT.dim), 0
        for clip in self.clips:
            if clip.split == "train" and not clip.spliced:
                block = features[clip.start : clip.start + clip.length].astype(np.float64)
                total += block.sum(axis=0)
                squares += (block**2).sum(axis=0)
                count += len(block)
        mean = total / count
        deviation = np.sqrt(np.maximum(squares / count - mean**2, 0.0))
        std = np.empty_like(deviation)
        for group in LAYOUT.slices.values():
            std[group] = max(float(deviation[group].mean()), LEAST_STD)
        return mean.astype(np.float32), std.astype(np.float32)

    def _manifest(self, packs: Sequence[JointsPack], left_out: dict[str, str]) -> Manifest:
        sources = Counter(pack.terms_of(clip) for pack in packs for clip in pack.clips if clip.id not in left_out)
        return Manifest(
            **self.contents(),
            sources=tuple(
                SourceEntry(**vars(terms), clips=count)
                for terms, count in sorted(sources.items(), key=lambda entry: (entry[0].name, entry[0].licence))
            ),
            tier=check_mix(sources),
            facing_sigma=LAYOUT.facing_sigma,
            caption_files={name: sha256 for pack in packs for name, sha256 in pack.caption_files.items()},
            left_out=dict(sorted(left_out.items())),
            compositional_pairs=tuple(sorted(held_out_pairs(packs))),
        )


def _measured(facts: Facts, frames: int) -> Measured:
    walked = facts.gait
    return Measured(
        seconds=round(frames / FPS, 2),
        path=round(walked.path, 2),
        turn=round(walked.turn, 1),
        speed=round(walked.speed, 2),
        steps=walked.steps,
        side=facts.side,
    )


def _act_captions(actions: Sequence[Facts], name: str) -> tuple[str, ...]:
    """Return one caption of each action alone."""
    return tuple(
        facts.text[0][0] if facts.text else captions([facts], f"{name}/{k}", 1)[0] for k, facts in enumerate(actions)
    )


def _authors(part: Part, actions: Sequence[Facts], name: str) -> tuple[tuple[str, ...], ...]:
    """Return the captions of each author; those of a training clip with one action get an author of sayings too."""
    told = _choose_texts(actions, name)
    train_alone = len(actions) == 1 and part.source.split == "train"  # the people of two sentences differ
    if told and train_alone and (asked := sayings(part.content, name)):
        told += (asked,)
    return told


def _choose_texts(actions: Sequence[Facts], name: str) -> tuple[tuple[str, ...], ...]:
    """Return the captions of each author of the source; empty if the source has none."""
    if not actions[0].text:
        return ()
    return actions[0].text if len(actions) == 1 else joined_texts(actions, name)


def build(packs: Sequence[JointsPack], out: Path, *, speed: float = 0.0, progress: Progress | None = None) -> Manifest:
    """Write a prepared folder.

    Args:
        packs: one per source.
        out: a folder that is empty or does not exist; it is created only when complete.
        speed: share by which slower and faster copies of training clips differ; 0: no copies.
        progress: called with the number of finished clips and the total.

    Raises:
        Conflict: the folder is not empty.
        InvalidInput: no training clip is left, the licences of the packs exclude each other, or `speed` is outside
            0 … 0.5.
    """
    if not 0 <= speed <= LARGEST_SPEED:
        raise InvalidInput(f"speed is {speed:g}; it must be between 0 and {LARGEST_SPEED:g}")
    check_mix({pack.terms_of(clip) for pack in packs for clip in pack.clips})
    left_out = {name: why for pack in packs for name, why in pack.left_out.items()}
    packs = with_splits(packs, left_out)
    by_split: dict[str, list[Part]] = {split: [] for split in SPLITS}
    total = (6 if speed else 2) * sum(len(pack.clips) for pack in packs)
    if any(clip.dataset == COMPOSED for pack in packs for clip in pack.clips):
        total += sum(sum(vars(counts).values()) for counts in COUNTS.values())
    with FolderWriter(out) as writer:
        for part in parts_of(packs, left_out, speed):
            if part.speed == 1:
                by_split[part.source.split].append(part)
            writer.add_part(part)
            if progress:
                progress(len(writer.clips), total)
        for part in list(made_gestures(by_split["train"])):
            by_split["train"].append(part)
            writer.add_part(part)
            if progress:
                progress(len(writer.clips), max(total, len(writer.clips)))
        for split, parts in by_split.items():
            for joined in chain(compose(parts, split), compose_texts(parts, split)):
                writer.add_composed(joined)
                if progress:
                    progress(len(writer.clips), max(total, len(writer.clips)))
        return writer.finish(packs, left_out)
