"""Models of a prepared folder's manifest and clip lines."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict, SerializerFunctionWrapHandler, model_serializer

from marey.data.licences import Terms, Tier

FORMAT = "marey-prepared-2"
FEATURES, JOINTS, ROOTS, CLIPS, STATISTICS, MANIFEST, TEXTS = (
    "features.npy",
    "joints.npy",
    "roots.npy",
    "clips.jsonl",
    "statistics.npz",
    "manifest.json",
    "texts.npz",
)
FILES = (FEATURES, JOINTS, ROOTS, CLIPS, STATISTICS)
ADDED = ("cropped", "tags")
"""Fields of clips that earlier releases do not know."""


class FileEntry(BaseModel):
    """A file of the folder."""

    model_config = ConfigDict(frozen=True)

    sha256: str
    bytes: int


class SourceEntry(BaseModel):
    """One source set, or those of its clips that have their own terms."""

    model_config = ConfigDict(frozen=True)

    name: str
    title: str
    licence: str
    credit: str
    url: str
    tier: Tier
    clips: int
    """Captured clips and segments, before mirroring and splicing."""


class Manifest(BaseModel):
    """`manifest.json`."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: str
    sources: tuple[SourceEntry, ...]
    tier: Tier
    """Tier of weights trained on the data: the strictest of the sources."""
    layout: str
    facing_sigma: float
    fps: float
    skeleton: str
    dim: int
    frames: int
    clips: int
    splits: dict[str, int]
    lengths: dict[str, dict[str, int]]
    """Number of clips by split and length in seconds (`0-1`, `1-2`, …)."""
    kinds: dict[str, int]
    """Number of clips by kind: captured, mirrored, retimed, made, cropped, looped, spliced."""
    captions: int
    caption_files: dict[str, str] = {}
    """sha256 of each file of human captions, by `set/captions-author.csv`."""
    left_out: dict[str, str]
    """Omitted captured clips, each with the reason."""
    compositional_pairs: tuple[tuple[str, str], ...]
    files: dict[str, FileEntry]

    @property
    def terms(self) -> tuple[Terms, ...]:
        """Terms of the sources."""
        return tuple(Terms(s.name, s.title, s.licence, s.credit, s.url, s.tier) for s in self.sources)


class Measured(BaseModel):
    """Measurements on a clip; metres, seconds, and degrees (positive to the left)."""

    model_config = ConfigDict(frozen=True)

    seconds: float
    path: float
    turn: float
    speed: float
    steps: int
    side: str


class Clip(BaseModel):
    """One line of `clips.jsonl`.

    `content` and `style` are those of the archive, with sides exchanged in mirrored clips; a spliced clip has those of
    its first part. `speed` is relative to the capture. `acts` are the actions in order, as keys of the caption grammar,
    `sides` the measured side of each: left, right, both, or empty. If several actions are joined, `seams` are the first
    frames of all but the first action, and `act_captions` describe each action separately. `authors` has the number of
    captions of each author, in order; empty: all by one author. `made` marks clips with a synthetic gesture
    (`marey.data.gestures`). `cropped` marks clips whose frames are a part of another clip of the folder. `tags` are the
    words of each caption with their parts of speech, `word/TAG word/TAG …`, where they are published.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    start: int
    length: int
    joints_start: int
    split: str
    dataset: str
    content: str
    style: str
    mirrored: bool
    speed: float = 1.0
    made: bool = False
    spliced: tuple[str, ...]
    acts: tuple[str, ...]
    sides: tuple[str, ...] = ()
    measured: Measured
    captions: tuple[str, ...]
    authors: tuple[int, ...] = ()
    seams: tuple[int, ...] = ()
    act_captions: tuple[str, ...] = ()
    cropped: bool = False
    tags: tuple[str, ...] = ()

    @model_serializer(mode="wrap")
    def _serialize(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Leave out the defaults of fields that earlier releases refuse."""
        values: dict[str, Any] = handler(self)
        return {name: value for name, value in values.items() if name not in ADDED or value}

    @property
    def all_captions(self) -> tuple[str, ...]:
        """Return the captions of the whole, then those of each action: the order of the features in `texts.npz`."""
        return self.captions + self.act_captions

    @property
    def captured(self) -> bool:
        """Return True for an unchanged capture: not mirrored, joined, made, cropped, slower or faster."""
        return not (self.mirrored or self.spliced or self.made or self.cropped) and self.speed == 1.0
