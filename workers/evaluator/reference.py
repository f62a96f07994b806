"""What an evaluator's bundle knows of real clips, so that a server without capture data can evaluate: captions to
generate from, the label and length of each, and the embedding of the motion that was captured. Neither joints nor
features."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from shared.bundles import Bundle, BundleWriter
from shared.errors import InvalidBundle, NotFound
from workers.evaluator.labels import label_ids, label_of
from workers.training.data.manifest import Clip

SPLITS = ("val", "test", "compositional")
"""`test` judges; `val` is to choose by; `compositional` are pairs of act and style that training never saw."""
FILE, PART = "reference.json", "reference"


class ReferenceClip(BaseModel):
    """One real clip."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    label: str
    """See `workers.evaluator.labels`."""
    acts: tuple[str, ...]
    sides: tuple[str, ...]
    """Of each act; what the kinematic checks of prompts expect."""
    frames: int
    captured: bool
    """Neither a mirror image nor looped or spliced."""
    captions: tuple[str, ...]

    @classmethod
    def of(cls, clip: Clip, max_frames: int) -> ReferenceClip:
        """What is kept of a prepared clip."""
        return cls(
            id=clip.id,
            label=label_of(clip),
            acts=clip.acts,
            sides=clip.sides or ("",) * len(clip.acts),
            frames=min(clip.length, max_frames),
            captured=not clip.mirrored and not clip.spliced,
            captions=clip.captions,
        )


_CLIPS = TypeAdapter(dict[str, tuple[ReferenceClip, ...]])


@dataclass(frozen=True, eq=False)
class ReferenceSplit:
    """The clips of a split with the embeddings of their motions."""

    clips: tuple[ReferenceClip, ...]
    motion: NDArray[np.float32]  # (N, E), stored in half precision

    @property
    def labels(self) -> NDArray[np.int64]:
        """(N,) one number a different label, as the metrics take them."""
        return label_ids([clip.label for clip in self.clips])


@dataclass(frozen=True, eq=False)
class Reference:
    """Real clips by split."""

    splits: Mapping[str, ReferenceSplit]

    def split(self, name: str) -> ReferenceSplit:
        """One split.

        Raises:
            NotFound: it is not there, or had no clips.
        """
        if name not in self.splits:
            raise NotFound(f"no split {name!r}", where="reference", hint=f"There are {', '.join(self.splits)}.")
        return self.splits[name]

    def add_to(self, writer: BundleWriter) -> None:
        """Put it into a bundle that is being written."""
        rows = {name: list(split.clips) for name, split in self.splits.items()}
        writer.add_json(FILE, {name: [c.model_dump(mode="json") for c in clips] for name, clips in rows.items()})
        writer.add_part(PART, {name: split.motion for name, split in self.splits.items()})

    @classmethod
    def of(cls, bundle: Bundle) -> Reference:
        """The reference of an evaluator's bundle.

        Raises:
            InvalidBundle: it has none, or one whose halves do not fit each other.
        """
        try:
            clips = _CLIPS.validate_python(bundle.read_json(FILE))
        except ValidationError as error:
            message = f"is no reference: {error.errors()[0]['msg']}"
            raise InvalidBundle(message, where=str(bundle.path / FILE)) from error
        motion = bundle.tensors(PART)
        if {name: len(rows) for name, rows in clips.items()} != {name: len(rows) for name, rows in motion.items()}:
            raise InvalidBundle("embeddings do not fit the clips", where=str(bundle.path / FILE))
        return cls({name: ReferenceSplit(rows, motion[name].astype(np.float32)) for name, rows in clips.items()})
