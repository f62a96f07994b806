"""Reconstruction of real clips by a generator's tokenizer: the upper bound for the generator's transformers.

A server that evaluates has no captured motion, so this is measured where the prepared data are and stored beside the
evaluator's bundle, in `reconstructions/{exact generator}.json`: outside the bundle's own hash, which is older than the
generators that it evaluates, and bound to both by their exact references.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from marey.bundles import Bundle
from marey.bundles.reference import expected_of
from marey.core.documents import read_json
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.core.validation import first_problem
from marey.data.prepared import PreparedData
from marey.evaluations import BUNDLE_SOURCES
from marey.evaluator.heat import heat_of, style_of
from marey.evaluator.measuring import Checked, check
from marey.evaluator.port import Embeddings, Evaluator
from marey.evaluator.reference import RealClips, ReferenceSplit
from marey.evaluator.report import HeatCell, Value
from marey.evaluator.rows import Ruler, real_set
from marey.motion.features import FeatureLayout, layout
from marey.nn.motion_tokenizer import MotionTokenizer

FOLDER = "reconstructions"
BATCH = 32
SAME = 0.02
"""Largest distance of a clip's embedding from the stored one, relative to its length: half precision and other machines
give .002, another clip over .5."""

Features = NDArray[np.float32]


class Reconstruction(BaseModel):
    """Metrics of the real clips of an evaluator's reference after encoding and decoding by a tokenizer."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: Literal["marey-reconstruction-1"] = "marey-reconstruction-1"
    generator: str
    evaluator: str
    clips: Mapping[str, int]
    """By source of prompts (`marey.evaluations.BUNDLE_SOURCES`)."""
    error_mm: Mapping[str, float]
    """Mean joint error with aligned pelvis, by source."""
    values: Mapping[str, Mapping[str, Value]]
    """Row by source and metric."""

    def note(self, source: str) -> str:
        """Describe the row in a few words."""
        return f"{self.clips[source]} real clips through the tokenizer, {self.error_mm[source]:.1f} mm error"

    def save(self, evaluator: Bundle) -> Path:
        """Write it beside the evaluator's bundle; return the file."""
        file = _file(evaluator, self.generator)
        file.parent.mkdir(exist_ok=True)
        file.write_text(self.model_dump_json(indent=1, exclude_defaults=True) + "\n", encoding="utf-8")
        return file


def find_reconstruction(evaluator: Bundle, generator: str) -> Reconstruction | None:
    """Return the reconstruction of an exact generator measured by this exact evaluator; None if there is none.

    Raises:
        InvalidFile: it is damaged, or was measured by another evaluator.
    """
    file = _file(evaluator, generator)
    try:
        found = Reconstruction.model_validate(read_json(file))
    except NotFound:
        return None
    except ValidationError as error:
        raise InvalidFile(f"is not a reconstruction: {first_problem(error)}", where=str(file)) from error
    if (found.generator, found.evaluator) != (generator, evaluator.reference):
        raise InvalidFile(
            f"was measured of {found.generator} by {found.evaluator}, not of {generator} by {evaluator.reference}",
            where=str(file),
            hint="Measure it again: `marey train evaluator reconstruct`.",
        )
    return found


@dataclass(frozen=True)
class Rebuilt:
    """A reconstruction with its prompt checks by action and style, for its own report."""

    reconstruction: Reconstruction
    heat: tuple[HeatCell, ...]


def reconstruct(
    data: PreparedData,
    real: RealClips,
    evaluator: Evaluator,
    generator: str,
    tokenizer: MotionTokenizer,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Rebuilt:
    """Encode and decode the clips of the reference, and measure them as generated motion is.

    Args:
        data: the prepared folder of the reference's clips.
        real: the evaluator's reference.
        evaluator: embeds the motions.
        generator: exact reference of the tokenizer's bundle.
        tokenizer: in evaluation mode, on the CPU.
        progress: called with (clips done, number of clips).

    Raises:
        InvalidInput: the data lack a clip, or hold other motion under its name; another feature layout.
    """
    space = layout(evaluator.layout)
    if data.manifest.layout != space.name or tokenizer.mean.shape[0] != space.dim:
        raise InvalidInput(f"{generator} and {data.path} are not both of {space.name}", where=generator)
    sources = {name: tuple(name.split("+")) for name in BUNDLE_SOURCES if set(name.split("+")) <= set(real.splits)}
    whole = real.joined([name for name in sources if name in real.splits])
    features = _features(data, whole, tokenizer.frames_per_token, evaluator)
    made = _rebuild_all(tokenizer, features, progress)
    checked, errors = _joints(space, whole, features, made)
    motion = evaluator.embed_motion(made)
    rows = _rows(real, sources)
    found = {
        source: _measured(
            Ruler(evaluator, real, splits, seed=0), motion[rows[source]], [checked[r] for r in rows[source]]
        )
        for source, splits in sources.items()
    }
    reconstruction = Reconstruction(
        generator=generator,
        evaluator=evaluator.name,
        clips={source: len(at) for source, at in rows.items()},
        error_mm={source: round(float(1000 * errors[at].mean()), 3) for source, at in rows.items()},
        values=found,
    )
    pairs = zip(whole.clips, checked, strict=True)
    heat = heat_of((expected_of(c.acts, c.sides), style_of(c.label), each.obeyed) for c, each in pairs)
    return Rebuilt(reconstruction, heat)


def _rebuild_all(
    tokenizer: MotionTokenizer, features: Sequence[Features], progress: Callable[[int, int], None]
) -> list[Features]:
    made: list[Features] = []
    for low in range(0, len(features), BATCH):
        made += rebuilt(tokenizer, features[low : low + BATCH])
        progress(len(made), len(features))
    return made


@torch.inference_mode()
def rebuilt(tokenizer: MotionTokenizer, clips: Sequence[Features]) -> list[Features]:
    """Encode and decode clips (T, D), T a multiple of the frames of a token, on the tokenizer's device."""
    rate, device = tokenizer.frames_per_token, tokenizer.mean.device
    lengths = torch.tensor([len(clip) for clip in clips], device=device)
    batch = torch.nn.utils.rnn.pad_sequence([torch.from_numpy(clip) for clip in clips], batch_first=True).to(device)
    output = tokenizer.decode(tokenizer.encode(batch, lengths), lengths // rate).float().cpu().numpy()
    return [np.array(output[row, : len(clip)]) for row, clip in enumerate(clips)]


def _measured(ruler: Ruler, motion: Embeddings, checked: Sequence[Checked]) -> dict[str, Value]:
    split = ruler.real.joined(ruler.splits)
    embeddings = real_set(split, motion, ruler)
    found = [(each.obeyed, each.quality) for each in checked]
    return ruler.values(embeddings, found, np.arange(len(found)), distances=True)


def _features(data: PreparedData, split: ReferenceSplit, rate: int, evaluator: Evaluator) -> list[Features]:
    """Return raw features (T, D) of the clips of a reference, T cut to whole tokens."""
    known = {clip.id: clip for clip in data.clips}
    if lacking := [clip.id for clip in split.clips if clip.id not in known]:
        raise InvalidInput(
            f"lacks {len(lacking)} of {len(split.clips)} clips of the evaluator's reference, {lacking[0]} first",
            where=str(data.path),
            hint="Give the prepared folder of the evaluator's bundle.",
        )
    whole = [np.array(data.features(known[clip.id])[: clip.frames], np.float32) for clip in split.clips]
    away = np.linalg.norm(evaluator.embed_motion(whole) - split.motion, axis=1) / np.linalg.norm(split.motion, axis=1)
    if away.max() > SAME:
        raise InvalidInput(
            f"{split.clips[int(away.argmax())].id} differs from the evaluator's reference",
            where=str(data.path),
            hint="Give the prepared folder of the evaluator's bundle.",
        )
    return [clip[: len(clip) - len(clip) % rate] for clip in whole]


def _joints(
    space: FeatureLayout, split: ReferenceSplit, truth: Sequence[Features], made: Sequence[Features]
) -> tuple[list[Checked], NDArray[np.float64]]:
    """Return measurements on the joints of each clip, and the joint error in metres."""
    checked: list[Checked] = []
    errors: list[float] = []
    for clip, before, after in zip(split.clips, truth, made, strict=True):
        old, new = space.decode(before), space.decode(after)
        checked.append(check(new, space.fps, expected_of(clip.acts, clip.sides)))
        off = (new - new[:, :1]) - (old - old[:, :1])
        errors.append(float(np.linalg.norm(off, axis=-1).mean()))
    return checked, np.array(errors)


def _rows(real: RealClips, sources: Mapping[str, Sequence[str]]) -> dict[str, NDArray[np.int64]]:
    """Return rows of each source's clips among those of all splits, joined in the order of the sources."""
    at, first = {}, 0
    for name in (name for name in sources if name in real.splits):
        count = len(real.split(name).clips)
        at[name] = np.arange(first, first + count)
        first += count
    return {source: np.concatenate([at[name] for name in splits]) for source, splits in sources.items()}


def _file(evaluator: Bundle, generator: str) -> Path:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*@[0-9a-f]{12,64}", generator):
        raise InvalidInput(
            f"{generator!r} is not an exact bundle reference", where="generator", hint="As hgm3-starter@96a91328572d."
        )
    return evaluator.path / FOLDER / f"{generator}.json"
