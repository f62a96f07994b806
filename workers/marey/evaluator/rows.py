"""Rows of a report: real motion, reconstructed real motion, and generated motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.quality import Quality
from marey.evaluations import COMPOSITIONAL, TEST_SPLIT
from marey.evaluator.measuring import EvaluatedMotions, embed_prompts
from marey.evaluator.port import Embeddings, Evaluator, ProgressCallback, no_progress
from marey.evaluator.reference import RealClips, ReferenceSplit
from marey.evaluator.report import MetricRow, Value
from marey.evaluator.report.model import GROUND_TRUTH, RECONSTRUCTION
from marey.evaluator.scoring import (
    POOLS,
    QUALITY,
    EmbeddedSet,
    compositional,
    embedded,
    flagged,
    keys_of,
    label_ceilings,
    multimodality,
    on_joints,
    retrieval,
)
from marey.measures.comparing import OBEYED, RETRIEVED

UNMEASURED = "this generator's tokenizer was not measured on real motion (run `marey train evaluator reconstruct`)"
OLD_BUNDLE = "the evaluator's bundle is older than measurements on the joints of real clips"

Found = Sequence[tuple[bool | None, Quality]]
"""Verdict (None = no expectation) and quality of each motion."""


@dataclass(frozen=True, eq=False)
class Ruler:
    """Measurement context shared by all rows of a report.

    Attributes:
        evaluator: embeds the motions.
        real: clips that distributions are compared with.
        splits: splits of the real clips, in the order of the prompts; with two, the compositional one has its own
            columns.
        seed: of the random draws.
        progress: called in every repeat.
    """

    evaluator: Evaluator
    real: RealClips
    splits: tuple[str, ...]
    seed: int
    progress: ProgressCallback = no_progress

    def values(
        self, embeddings: EmbeddedSet, found: Found | None, prompts: NDArray[np.int64], *, distances: bool
    ) -> dict[str, Value]:
        """Compute all values of a row.

        Args:
            embeddings: of N motions.
            found: measurements on their joints; None = unknown.
            prompts: (N,) prompt of each motion, which determines its split if there are several.
            distances: measure the distances of distributions to the real motions.
        """
        values = self._values(embeddings, found, self.splits, distances)
        if self.splits != (TEST_SPLIT, COMPOSITIONAL):
            return values
        late = prompts >= len(self.real.split(TEST_SPLIT).clips)
        if not late.any():
            return values
        some = None if found is None else [each for each, taken in zip(found, late, strict=True) if taken]
        alone = self._values(embeddings.only(late), some, (COMPOSITIONAL,), distances)
        return values | compositional(alone | retrieval(embeddings, self.evaluator, POOLS[0], self.seed, of=late))

    def _values(
        self, embeddings: EmbeddedSet, found: Found | None, splits: Sequence[str], distances: bool
    ) -> dict[str, Value]:
        real = self.real.joined(splits).motion if distances else None
        values = embedded(embeddings, real, self.evaluator, self.seed)
        if found is None:
            return values | dict.fromkeys((OBEYED, *QUALITY), Value.missing(OLD_BUNDLE))
        return values | on_joints(found, embeddings.variants)


def truth_row(ruler: Ruler) -> MetricRow:
    """Return the row of real motion with its own captions, measured by the same network and checker."""
    split = ruler.real.joined(ruler.splits)
    rows = np.arange(len(split.clips))
    found = [(clip.obeyed, clip.quality) for clip in split.clips if clip.quality is not None]
    values = ruler.values(
        real_set(split, split.motion, ruler),
        found if len(found) == len(split.clips) else None,
        rows,
        distances=False,
    )
    for pool, note in _ceilings(split.labels, ruler.seed).items():
        values |= {
            key: replace(value, note=value.note or note) for key, value in values.items() if key in keys_of(pool)
        }
    return MetricRow(
        GROUND_TRUTH, "Real motion", f"{len(split.clips)} clips of {_named(ruler.splits)} with their captions", values
    )


def reconstruction_row(values: Mapping[str, Value] | None, note: str) -> MetricRow:
    """Return the row of real motion through the generator's tokenizer: the upper bound of the generator."""
    if values is None:
        values = {key: Value.missing(UNMEASURED) for key in (OBEYED, RETRIEVED, "fid")}
    return MetricRow(RECONSTRUCTION, "Reconstruction", note, values)


def generated_rows(
    measured: EvaluatedMotions, sets: tuple[EmbeddedSet, EmbeddedSet], ruler: Ruler
) -> tuple[MetricRow, MetricRow]:
    """Return the rows `raw` and `exported` of measured motions, from their two embedded sets."""
    raw, exported = (
        ruler.values(embeddings, found, measured.indices, distances=True)
        for embeddings, found in zip(
            sets,
            (
                [(motion.raw.obeyed, motion.raw.quality) for motion in measured.motions],
                [(motion.exported.obeyed, motion.exported.quality) for motion in measured.motions],
            ),
            strict=True,
        )
    )
    return (
        MetricRow("raw", "Generated", "features as the network made them", raw),
        MetricRow(
            "exported",
            "Exported",
            "as users get them: feet locked, rotations solved",
            exported | {"multimodality": multimodality(measured, ruler.seed), "flagged": flagged(measured)},
        ),
    )


def embedded_sets(
    measured: EvaluatedMotions, labels: NDArray[np.int64], progress: ProgressCallback = no_progress
) -> tuple[EmbeddedSet, EmbeddedSet]:
    """Return embedded sets of the raw and the exported motions; `labels` (N,) are those of their prompts."""
    raw, exported = (
        EmbeddedSet(motion, measured.text, labels, measured.variants, progress, measured.single)
        for motion in (measured.raw, measured.exported)
    )
    return raw, exported


def real_set(split: ReferenceSplit, motion: Embeddings, ruler: Ruler) -> EmbeddedSet:
    """Return the embedded set of a split's clips (N, E) with the clips' captions."""
    text = embed_prompts(split.prompts, ruler.evaluator, ruler.progress)
    return EmbeddedSet(motion, text, split.labels, np.zeros(len(split.clips), np.int64), ruler.progress)


def _ceilings(labels: NDArray[np.int64], seed: int) -> dict[int, str]:
    """Describe the upper bound of R-precision for clips with these labels (N,), by pool size, for pools that they
    fill."""
    return {
        pool: (
            f"Where a motion of the prompt's own label counts as found, a model that knows only the labels "
            f"has 100 % in pools of {pool}. Where the clip of the prompt alone counts, it would have "
            f"{', '.join(f'{ceiling:.1f} % at {k}' for k, ceiling in label_ceilings(labels, pool, seed).items())}."
        )
        for pool in POOLS
        if len(labels) >= pool
    }


def _named(splits: Sequence[str]) -> str:
    return f"the {' and '.join(splits)} split{'s' if len(splits) > 1 else ''}"
