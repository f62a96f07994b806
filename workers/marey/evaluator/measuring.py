"""Measure each motion of an evaluation: the checker's verdict, quality, and embedding.

There are two rows. `raw` are the features as the network generated them; `exported` are features encoded again from the
joints of the npz, after rotations were solved and feet locked: the files that users get.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from marey.checks.judge import Act, CheckVerdict, Expectation, Side, judge
from marey.checks.quality import Quality, quality
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.evaluations import MAX_MISSING, MadeItem
from marey.evaluator.port import Embeddings, Evaluator, ProgressCallback, no_progress
from marey.evaluator.shots import RowReading, constraints_of, rows_of
from marey.items.expected import read_expected
from marey.motion.body import travel_scale
from marey.motion.clip import MotionClip, parse_npz
from marey.motion.features import FeatureLayout, PosedLayout, encode_all, layout
from marey.motion.resample import resample
from marey.motion.rotations import conjugate, multiply
from marey.quality.constraints import ConstraintError
from marey.quality.record import read_quality

Piece = TypeVar("Piece")
TOGETHER = 64
"""Motions held at a time: 10,000 of them would be 2 GB of features."""


@dataclass(frozen=True)
class Checked:
    """Measurements on the joints of a motion; `verdict` is None if no action is expected."""

    verdict: CheckVerdict | None
    quality: Quality

    @property
    def obeyed(self) -> bool | None:
        """Return True if the motion passed its check; None if no action is expected."""
        return None if self.verdict is None else self.verdict.passed


@dataclass(frozen=True)
class EvaluatedMotion:
    """One motion and its measurements, as generated and as exported.

    Attributes:
        flags: those of the quality record that it was delivered with; None without a record.
        rows: of a timeline; none for one prompt.
        constraints: errors of its constraints; None = it has no record of any.
        kinematic: it has no features of a network, as edited and constrained motions; `raw` is measured on its files.
    """

    item: MadeItem
    raw: Checked
    exported: Checked
    flags: tuple[str, ...] | None = None
    rows: tuple[RowReading, ...] = ()
    constraints: tuple[ConstraintError, ...] | None = None
    kinematic: bool = False


@dataclass(frozen=True)
class Broken:
    """A generated motion without a measurement."""

    item: MadeItem
    reason: str


@dataclass(frozen=True, eq=False)
class EvaluatedMotions:
    """All motions of an evaluation, in input order, repeats within prompt. Embeddings of timelines are 0."""

    motions: tuple[EvaluatedMotion, ...]
    raw: Embeddings  # (N, E)
    exported: Embeddings  # (N, E)
    text: Embeddings  # (N, E) of each motion's prompt
    broken: tuple[Broken, ...]

    @property
    def indices(self) -> NDArray[np.int64]:
        """Return the prompt (N,) of each motion."""
        return np.array([motion.item.index for motion in self.motions], np.int64)

    @property
    def variants(self) -> NDArray[np.int64]:
        """Return the repeat (N,) of each motion."""
        return np.array([motion.item.variant for motion in self.motions], np.int64)

    @property
    def single(self) -> NDArray[np.bool_]:
        """Return which (N,) motions are of one prompt: evaluators embed these alone."""
        return np.array([not motion.rows for motion in self.motions], bool)


def measure(
    items: Sequence[MadeItem],
    read: Callable[[MadeItem], bytes],
    evaluator: Evaluator,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> EvaluatedMotions:
    """Measure every generated motion.

    Args:
        items: items of the generation; those without a motion are skipped.
        read: returns the npz of an item.
        evaluator: embeds motions and prompts.
        progress: called with (motions done, number of motions).

    Raises:
        InvalidInput: the motions are of another feature layout or frame rate than the evaluator reads.
        Unreachable: the store does not answer.
    """
    made = [item for item in items if item.npz is not None]
    space = layout(evaluator.layout)
    found: list[EvaluatedMotion] = []
    broken: list[Broken] = []
    raw, exported = [np.zeros((0, evaluator.width), np.float32)], [np.zeros((0, evaluator.width), np.float32)]
    done = 0
    for some in _chunks(made, TOGETHER):
        clips: list[MotionClip] = []
        for item in some:
            clip = _read(item, read, evaluator, space)
            if isinstance(clip, Broken):
                broken.append(clip)
                continue
            clips.append(clip)
            found.append(_evaluated(item, clip, space))
        single = [not motion.rows for motion in found[len(found) - len(clips) :]]
        alone = [clip for clip, is_single in zip(clips, single, strict=True) if is_single]
        raw.append(_scattered(single, evaluator.embed_motion([_features(space, clip) for clip in alone])))
        exported.append(_scattered(single, evaluator.embed_motion([encoded(space, clip) for clip in alone])))
        done += len(some)
        progress(done, len(made))
    single = [not motion.rows for motion in found]
    prompts = [motion.item.prompt for motion in found if not motion.rows]
    text = embed_prompts(prompts, evaluator, lambda: progress(done, len(made)))
    return EvaluatedMotions(
        tuple(found), np.concatenate(raw), np.concatenate(exported), _scattered(single, text), tuple(broken)
    )


def _evaluated(item: MadeItem, clip: MotionClip, space: FeatureLayout) -> EvaluatedMotion:
    record = read_quality(clip.manifest)
    return EvaluatedMotion(
        item,
        raw=check(space.decode(_features(space, clip)), space.fps, item.expected),
        exported=check(clip.joints, clip.fps, item.expected),
        flags=None if record is None else tuple(record.flags),
        rows=rows_of(clip),
        constraints=constraints_of(clip),
        kinematic=not clip.features.size,
    )


def _features(space: FeatureLayout, clip: MotionClip) -> NDArray[np.float32]:
    """Return the features as the network made them; of a clip without any those of its joints."""
    return clip.features if clip.features.size else encoded(space, clip)


def _scattered(rows: Sequence[bool], embeddings: Embeddings) -> Embeddings:
    """Return (N, E) with the embeddings where `rows` (N,) is true, and 0 elsewhere."""
    found = np.zeros((len(rows), embeddings.shape[1]), np.float32)
    found[np.array(rows, bool)] = embeddings
    return found


def check_measured(measured: EvaluatedMotions, asked: int) -> None:
    """Refuse a report if too many motions are missing: its numbers would describe another set.

    Args:
        measured: measured motions, and generated ones that could not be measured.
        asked: number of requested motions.

    Raises:
        InvalidFile: some are lost, damaged, or hold NaN, and with those more than `MAX_MISSING` are missing.
    """
    broken, missing = measured.broken, asked - len(measured.motions)
    if broken and missing > MAX_MISSING * asked:
        raise InvalidFile(
            f"{missing} of {asked} motions cannot be measured, {missing / asked:.1%} the limit is {MAX_MISSING:.0%}; "
            f"the first of {len(broken)} broken ones: {broken[0].reason}",
            where=f"prompt {broken[0].item.index}, repeat {broken[0].item.variant}",
            hint="Check the store and the generator's bundle, then evaluate again.",
        )


def check(joints: NDArray[np.floating], fps: float, expected: str | None) -> Checked:
    """Measure a motion (T, 22, 3) in metres and judge it by the expectation (`marey.items.expected`)."""
    verdict = None
    if expected is not None:
        actions = read_expected(expected)
        wanted = [Expectation(cast("Act", each.action), cast("Side", each.side), each.straight) for each in actions]
        verdict = judge(joints, fps, wanted)
    return Checked(verdict, quality(joints, fps))


def encoded(space: FeatureLayout, clip: MotionClip) -> NDArray[np.float32]:
    """Encode a clip as features (T, D) at the layout's rate, as a body of the size of the layout's skeleton.

    An encoder needs the step after the last frame: the previous step is repeated.
    """
    scale = travel_scale(clip.skeleton, space.skeleton)
    if isinstance(space, PosedLayout):
        turns, root = np.asarray(clip.rotations, np.float64), scale * np.asarray(clip.root, np.float64)
        onward = multiply(multiply(turns[-1:], conjugate(turns[-2:-1])), turns[-1:])
        return space.encode_pose(np.concatenate([turns, onward]), np.concatenate([root, 2 * root[-1:] - root[-2:-1]]))
    joints = scale * np.asarray(clip.joints, np.float64)
    return encode_all(space, joints)


def _read(
    item: MadeItem, read: Callable[[MadeItem], bytes], evaluator: Evaluator, space: FeatureLayout
) -> MotionClip | Broken:
    """Return the clip of an item, at the evaluator's rate; `Broken` if it is lost, damaged or holds NaN."""
    try:
        clip = parse_npz(read(item), where=f"prompt {item.index}, repeat {item.variant}")
    except (InvalidFile, NotFound) as error:
        return Broken(item, error.message)
    if clip.features.size and (clip.features.shape[1] != space.dim or clip.features_fps != space.fps):
        raise InvalidInput(
            f"the motions have {clip.features.shape[1]} features at {clip.features_fps:g} fps; "
            f"{evaluator.name} reads {space.dim} at {space.fps:g} fps ({space.name})",
            where=f"prompt {item.index}, repeat {item.variant}",
            hint="Choose an evaluator of the generator's feature layout.",
        )
    return clip if clip.fps == space.fps else resample(clip, space.fps)


def embed_prompts(prompts: Sequence[str], evaluator: Evaluator, progress: ProgressCallback = no_progress) -> Embeddings:
    """Return embeddings (N, E) of prompts; equal prompts are embedded once."""
    distinct = list(dict.fromkeys(prompts))
    rows = {prompt: row for row, prompt in enumerate(distinct)}
    found = [np.zeros((0, evaluator.width), np.float32)]
    for some in _chunks(distinct, TOGETHER):
        found.append(evaluator.embed_text(some))
        progress()
    return np.concatenate(found)[[rows[prompt] for prompt in prompts]]


def _chunks(items: Iterable[Piece], size: int) -> Iterator[list[Piece]]:
    rest = iter(items)
    while some := list(islice(rest, size)):
        yield some
