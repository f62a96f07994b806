"""The reference of an evaluator's bundle, with which a server without capture data can evaluate: captions to generate
from, and label, length, motion embedding, verdict and quality of each real clip. It holds no joints and no features."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from marey.bundles import Bundle, BundleWriter
from marey.bundles.reference import FILE, PART, expected_of
from marey.checks.quality import Quality
from marey.core.errors import InvalidBundle, NotFound
from marey.core.validation import first_problem
from marey.data.manifest import Clip
from marey.data.sampling import UNLABELLED
from marey.evaluator.labels import label_ids, label_of
from marey.evaluator.measuring import check

SPLITS = ("val", "test", "compositional")
"""`test` is for evaluation, `val` for model selection; `compositional` has pairs of action and style unseen in
training."""


class ReferenceClip(BaseModel):
    """One real clip."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    id: str
    label: str
    """See `marey.evaluator.labels`."""
    acts: tuple[str, ...]
    sides: tuple[str, ...]
    """Side of each action, for the kinematic checks."""
    frames: int
    captured: bool
    """False for mirror images, loops and splices."""
    captions: tuple[str, ...]
    obeyed: bool | None = None
    """The checker's verdict on the captions' actions; None = no check exists for such an action."""
    quality: Quality | None = None
    """None in bundles from before it was measured."""

    @classmethod
    def of(cls, clip: Clip, joints: NDArray[np.float32], fps: float, max_frames: int) -> ReferenceClip:
        """Collect the stored facts of a prepared clip whose joints are (T, J, 3)."""
        sides = clip.sides or ("",) * len(clip.acts)
        checked = check(joints, fps, expected_of(clip.acts, sides))
        return cls(
            obeyed=checked.obeyed,
            quality=Quality(*(float(f"{value:.4g}") for value in astuple(checked.quality))),
            id=clip.id,
            label=label_of(clip),
            acts=clip.acts,
            sides=sides,
            frames=min(clip.length, max_frames),
            captured=clip.captured,
            captions=clip.captions,
        )


_CLIPS = TypeAdapter(dict[str, tuple[ReferenceClip, ...]])


@dataclass(frozen=True, eq=False)
class ReferenceSplit:
    """The clips of a split with the embeddings of their motions."""

    clips: tuple[ReferenceClip, ...]
    motion: NDArray[np.float32]  # (N, E), stored in half precision
    prompts: tuple[str, ...]
    """The caption of each clip that evaluations generate from, as chosen by `marey.bundles.reference`."""

    @property
    def labels(self) -> NDArray[np.int64]:
        """Return numbers (N,), equal for equal labels, as the metrics take them."""
        # References of earlier releases have one label for all clips of published sets.
        return label_ids([clip.id if UNLABELLED in clip.acts else clip.label for clip in self.clips])

    @classmethod
    def of(cls, clips: Sequence[ReferenceClip], motion: NDArray[np.float32]) -> ReferenceSplit:
        """Select clips with the embeddings (N, E) of their motions."""
        prompts = (clip.captions[number % len(clip.captions)] for number, clip in enumerate(clips))
        return cls(tuple(clips), motion, tuple(prompts))


@dataclass(frozen=True, eq=False)
class RealClips:
    """The real clips of an evaluator's reference, by split."""

    splits: Mapping[str, ReferenceSplit]

    def split(self, name: str) -> ReferenceSplit:
        """Return one split.

        Raises:
            NotFound: it does not exist, or had no clips.
        """
        if name not in self.splits:
            raise NotFound(f"no split {name!r}", where="reference", hint=f"There are {', '.join(self.splits)}.")
        return self.splits[name]

    def joined(self, names: Sequence[str]) -> ReferenceSplit:
        """Return several splits as one, in the given order.

        Raises:
            NotFound: see `split`.
        """
        splits = [self.split(name) for name in names]
        return ReferenceSplit(
            tuple(clip for split in splits for clip in split.clips),
            np.concatenate([split.motion for split in splits]),
            tuple(prompt for split in splits for prompt in split.prompts),
        )

    def add_to(self, writer: BundleWriter) -> None:
        """Add the reference to a new bundle."""
        rows = {name: list(split.clips) for name, split in self.splits.items()}
        writer.add_json(
            FILE, {name: [c.model_dump(mode="json", exclude_none=True) for c in clips] for name, clips in rows.items()}
        )
        writer.add_part(PART, {name: split.motion for name, split in self.splits.items()})

    @classmethod
    def of(cls, bundle: Bundle) -> RealClips:
        """Read the reference of an evaluator's bundle.

        Raises:
            InvalidBundle: it has none, or its clips and embeddings differ in number.
        """
        try:
            clips = _CLIPS.validate_python(bundle.read_json(FILE))
        except ValidationError as error:
            message = f"not a reference: {first_problem(error)}"
            raise InvalidBundle(message, where=str(bundle.path / FILE)) from error
        motion = bundle.tensors(PART)
        if {name: len(rows) for name, rows in clips.items()} != {name: len(rows) for name, rows in motion.items()}:
            raise InvalidBundle("embeddings do not fit the clips", where=str(bundle.path / FILE))
        return cls({name: ReferenceSplit.of(rows, motion[name].astype(np.float32)) for name, rows in clips.items()})
