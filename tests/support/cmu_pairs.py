"""Trials of the CMU database that stand in both archives: the same motion on two rigs, on the frames they share."""

from __future__ import annotations

import tarfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np

from marey.motion.io.bvh import BvhClip, parse_bvh
from marey.motion.retarget import source_on
from marey.motion.retarget.load import parse_body
from marey.motion.retarget.source import Source
from marey.motion.rigs.body import RigBody
from marey.motion.rotations import Array, normalize
from tests.support.archives import archive

SIDES = ("left", "right")
CHAINS = (("upper_leg", "lower_leg", "foot", "toes"), ("upper_arm", "lower_arm", "hand"))
BONES = [(f"{side}_{begin}", f"{side}_{end}") for side in SIDES for chain in CHAINS for begin, end in pairwise(chain)]
JOINTS = ["head", *(f"{side}_{part}" for side in SIDES for chain in CHAINS for part in chain)]
T_POSE = "007_03"
"""The one iClone trial that begins with a T-pose: all have the same rig, and the others show no rest pose."""


@dataclass(frozen=True)
class Pair:
    """A trial on the iClone rig and on that of the open archive, 30 frames a second, frame by frame."""

    name: str
    iclone: Source
    other: Source

    @property
    def both(self) -> tuple[tuple[Source, Source], tuple[Source, Source]]:
        """Both directions, source first."""
        return (self.iclone, self.other), (self.other, self.iclone)


def pairs() -> Iterator[Pair]:
    """Yield the trials in order of their names; skips the test, with the reason, where an archive is missing."""
    first, second = (_files(name) for name in ("cmu-iclone.tar.xz", "open-motions.tar.xz"))
    iclone = parse_body(first[T_POSE], f"{T_POSE}.bvh")
    for name in sorted(first):
        if name not in second:
            continue
        other = parse_body(second[name], f"{name}.bvh")
        mine, theirs = parse_bvh(first[name]), parse_bvh(second[name])
        frames = _shared(source_on(iclone, mine), source_on(other, theirs))
        yield Pair(name, *(_source(*each) for each in zip((iclone, other), (mine, theirs), frames, strict=True)))


def iclone_body() -> RigBody:
    """Return the iClone rig in its T-pose."""
    return parse_body(_files("cmu-iclone.tar.xz")[T_POSE], f"{T_POSE}.bvh")


def iclone_trial(name: str) -> Source:
    """Return a trial on the iClone rig, 30 frames a second, with contacts."""
    clip = parse_bvh(_files("cmu-iclone.tar.xz")[name])
    return _source(iclone_body(), clip, np.arange(0, len(clip.rotations), 2))


def directions(joints: Array, body: RigBody, others: RigBody) -> Array:
    """Return unit vectors (n, T, 3) along the bones of the limbs that both bodies have."""
    bones = [bone for bone in BONES if all(each.has(part) for each in (body, others) for part in bone)]
    return np.stack(
        [normalize(joints[:, body.map.parts[end]] - joints[:, body.map.parts[begin]]) for begin, end in bones]
    )


def angles(a: Array, b: Array) -> Array:
    """Return the angles between unit vectors, degrees."""
    return np.degrees(np.arccos(np.clip((a * b).sum(axis=-1), -1, 1)))


def turned_to(joints: Array, body: RigBody, goal: Array, theirs: RigBody) -> Array:
    """Return the motion turned about the vertical so that its bones point as another's: the files face elsewhere."""
    a, b = (directions(*each).reshape(-1, 3) for each in ((joints, body, theirs), (goal, theirs, body)))
    angle = np.arctan2((a[:, 2] * b[:, 0] - a[:, 0] * b[:, 2]).sum(), (a * b)[:, [0, 2]].sum())
    cos, sin = np.cos(angle), np.sin(angle)
    return joints @ np.array([[cos, 0, sin], [0, 1, 0], [-sin, 0, cos]]).T


@cache
def _files(name: str) -> dict[str, bytes]:
    """Return the CMU trials of an archive by the names that the iClone archive gives them."""
    found: dict[str, bytes] = {}
    with tarfile.open(archive(name), "r|*") as tar:
        for member in tar:
            folder, _, stem = member.name.removesuffix(".bvh").rpartition("/")
            subject, _, trial = stem.partition("_")
            if folder.endswith(("cmu", "cmu/bvh30")) and subject.isdigit() and trial.isdigit():
                file = tar.extractfile(member)
                found[f"{int(subject):03d}_{trial}"] = file.read() if file else b""
    return found


def _shared(mine: Source, theirs: Source) -> tuple[np.ndarray, np.ndarray]:
    """Return the frames of both that show the same moment: 60 and 30 a second, begun some frames apart."""
    a, b = (_from_hips(each, other) for each, other in ((mine, theirs), (theirs, mine)))
    best = np.inf, np.zeros(0, int), np.zeros(0, int)
    for shift in range(-len(b), len(a) - len(b)):
        own = 2 * np.arange(len(b)) + shift
        fits = (own >= 0) & (own < len(a))
        if fits.mean() >= 0.6 and (apart := angles(a[own[fits]], b[fits]).mean()) < best[0]:
            best = float(apart), own[fits], np.flatnonzero(fits)
    return best[1], best[2]


def _from_hips(source: Source, other: Source) -> Array:
    """Return the directions (T, n, 3) of the limbs seen from the heading of the hips."""
    across = source.places("left_upper_leg") - source.places("right_upper_leg")
    left = normalize(across * [1, 0, 1])
    up = np.broadcast_to([0.0, 1.0, 0.0], left.shape)
    axes = np.stack([left, up, np.cross(left, up)], axis=1)
    return np.einsum("tij,ntj->tni", axes, directions(source.joints, source.body, other.body))


def _source(body: RigBody, clip: BvhClip, frames: np.ndarray) -> Source:
    positions = None if clip.positions is None else clip.positions[frames]
    clip = replace(clip, rotations=clip.rotations[frames], root=clip.root[frames], positions=positions, fps=30.0)
    source = source_on(body, clip)
    contacts = np.zeros((len(frames), 4), bool)
    for number, side in enumerate(SIDES):
        for column, part in enumerate(("foot", "toes")):
            if body.has(f"{side}_{part}"):
                place = source.places(f"{side}_{part}")
                speed = np.linalg.norm(np.gradient(place, axis=0), axis=-1) * 30
                low = place[:, 1] < np.percentile(place[:, 1], 5) + 0.06
                contacts[:, 2 * number + column] = (speed < 0.25) & low
    return replace(source, contacts=contacts)
