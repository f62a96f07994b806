"""The joints pack: every clip of an archive retargeted at 20 fps, in one small, portable file.

It has no mirrored, spliced or encoded clips: `build.py` makes the prepared folder from it, with the same bytes every
time. Joints are stored relative to the root in float16 (error at most 0.25 mm), the root in float32.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from marey.core.arrays import check_array, read_npz, text_of
from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.validation import first_problem
from marey.core.whole_files import whole_file
from marey.data.licences import Terms

MAX_BYTES = 8 * 2**30
"""Largest size of a pack; a day of motion takes 1.5 GB."""
FORMAT = "marey-joints-pack-3"
SPLITS = ("train", "val", "test", "compositional")


@dataclass(frozen=True)
class PackClip:
    """One captured clip, or a segment of a long one.

    Attributes:
        id: its name, unique within the data set.
        dataset: name of the set.
        content, style: action and style of the index; the style may be empty.
        split: train, val, test or compositional; empty: assigned by source in stage 2.
        start, frames: its rows in the pack.
        source: the independent capture it comes from.
        captions: true sentences about it, by author.
        side, in_place, facts: see `marey.data.index.Row`.
        tier, licence, credit: its own terms; empty if they equal those of the set.
    """

    id: str
    dataset: str
    content: str
    style: str
    split: str
    start: int
    frames: int
    source: str = ""
    captions: tuple[tuple[str, ...], ...] = ()
    side: str = ""
    in_place: bool = False
    facts: str = ""
    tier: str = ""
    licence: str = ""
    credit: str = ""


@dataclass(frozen=True)
class JointsPack:
    """Clips and their joints.

    Attributes:
        clips: in the order of the rows.
        terms: terms of each source set.
        left_out: omitted clips of the index, each with the reason.
        caption_files: sha256 of each caption file, by `set/captions-author.csv`.
        local: (N, 21, 3) float16, joints 1 to 21 relative to the root, metres.
        root: (N, 3) float32 metres.
    """

    clips: tuple[PackClip, ...]
    local: NDArray[np.float16]
    root: NDArray[np.float32]
    terms: tuple[Terms, ...] = ()
    left_out: Mapping[str, str] = field(default_factory=dict[str, str])
    caption_files: Mapping[str, str] = field(default_factory=dict[str, str])

    def joints(self, clip: PackClip) -> NDArray[np.float32]:
        """Joints (T, 22, 3) of a clip, metres."""
        rows = slice(clip.start, clip.start + clip.frames)
        return join(self.local[rows], self.root[rows])

    def terms_of(self, clip: PackClip) -> Terms:
        """Terms of a clip: its own, otherwise those of its set.

        Raises:
            InvalidInput: the pack has no terms of the clip's set.
        """
        for terms in self.terms:
            if terms.name == clip.dataset:
                own = {"tier": clip.tier, "licence": clip.licence, "credit": clip.credit}
                return replace(terms, **{name: value for name, value in own.items() if value})
        raise InvalidInput(f"the pack has no terms of the set {clip.dataset!r}", where=clip.id)

    @classmethod
    def of(
        cls,
        clips: list[tuple[PackClip, NDArray[np.float32]]],
        terms: Sequence[Terms] = (),
        left_out: Mapping[str, str] | None = None,
        caption_files: Mapping[str, str] | None = None,
    ) -> JointsPack:
        """Pack clips with their joints (T, 22, 3); `start` and `frames` are set here."""
        table, start = [], 0
        for clip, joints in clips:
            table.append(PackClip(**{**asdict(clip), "start": start, "frames": len(joints)}))
            start += len(joints)
        halves = [split_root(joints) for _, joints in clips]
        local, root = np.concatenate([h[0] for h in halves]), np.concatenate([h[1] for h in halves])
        return cls(tuple(table), local, root, tuple(terms), dict(left_out or {}), dict(caption_files or {}))

    def save(self, path: Path) -> None:
        """Write one compressed npz atomically."""
        terms, clips = ([asdict(entry) for entry in entries] for entries in (self.terms, self.clips))
        about = {"left_out": self.left_out, "caption_files": self.caption_files}
        table = json.dumps({"format": FORMAT, "terms": terms, **about, "clips": clips})
        with whole_file(path, alone=True) as part, part.open("wb") as file:
            np.savez_compressed(file, local=self.local, root=self.root, table=np.array(table))

    @classmethod
    def load(cls, path: Path) -> JointsPack:
        """Read a pack.

        Raises:
            NotFound: no such file.
            InvalidFile: not a pack, truncated, or its table does not fit its arrays.
        """
        where = str(path)
        try:
            arrays = read_npz(path, ("table", "local", "root"), limit=MAX_BYTES)
        except NotFound:
            raise NotFound("no joints pack", where=where) from None
        table = parse_json(text_of(arrays["table"], "table", where), f"{where}: table")
        if not isinstance(table, dict) or table.get("format") != FORMAT:
            raise InvalidFile(f"not a joints pack of format {FORMAT}", where=where)
        try:
            clips = TypeAdapter(tuple[PackClip, ...]).validate_python(table.get("clips"))
            terms = TypeAdapter(tuple[Terms, ...]).validate_python(table.get("terms"))
            left_out, caption_files = (
                TypeAdapter(dict[str, str]).validate_python(table.get(name)) for name in ("left_out", "caption_files")
            )
        except ValidationError as error:
            raise InvalidFile(f"not a joints pack: {first_problem(error)}", where=where) from error
        rows = 0
        for clip in clips:
            if clip.start != rows or clip.frames < 1 or clip.split not in ("", *SPLITS):
                raise InvalidFile(f"the clip {clip.id!r} does not follow the one before it", where=where)
            rows += clip.frames
        local = check_array(arrays["local"], "local", where, kinds="float16", shape=(rows, 21, 3))
        root = check_array(arrays["root"], "root", where, kinds="float32", shape=(rows, 3))
        return cls(clips, local, root, terms, left_out, caption_files)


def split_root(joints: NDArray[np.floating]) -> tuple[NDArray[np.float16], NDArray[np.float32]]:
    """Split joints (T, J, 3) into joints relative to the root (T, J - 1, 3) float16 and the root (T, 3) float32."""
    root = joints[:, 0].astype(np.float32)
    return (joints[:, 1:] - root[:, None]).astype(np.float16), root


def join(local: NDArray[np.float16], root: NDArray[np.float32]) -> NDArray[np.float32]:
    """Invert `split_root`: (T, J, 3) float32."""
    joints = np.empty((len(root), 1 + local.shape[1], 3), np.float32)
    joints[:, 0] = root
    joints[:, 1:] = local.astype(np.float32) + root[:, None]
    return joints
