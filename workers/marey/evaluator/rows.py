"""The rows of a report: real motion, real motion through a tokenizer, and what a model generated."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.quality import Quality
from marey.evaluations import COMPOSITIONAL, TEST_SPLIT
from marey.evaluator.measuring import Measured, embed_prompts
from marey.evaluator.port import Beat, Embeddings, Evaluator, unheard
from marey.evaluator.reference import Reference, ReferenceSplit
from marey.evaluator.report import Row, Value
from marey.evaluator.report.model import GROUND_TRUTH, RECONSTRUCTION
from marey.evaluator.scoring import (
    POOLS,
    QUALITY,
    Side,
    apart,
    embedded,
    keys_of,
    label_ceilings,
    on_joints,
    retrieval,
    several,
)
from marey.measures.comparing import OBEYED, RETRIEVED

UNMEASURED = "nobody measured this generator's tokenizer on real motion (`marey train evaluator reconstruct`)"
OLD_BUNDLE = "the evaluator's bundle was made before it carried what the joints of real clips say"

Found = Sequence[tuple[bool | None, Quality]]
"""Of each motion whether it obeys its prompt (None = nothing is expected), and how it moves."""


@dataclass(frozen=True, eq=False)
class Ruler:
    """What all rows of a report are measured by.

    Attributes:
        evaluator: embeds.
        real: clips that distributions are compared with.
        splits: whose, in the order of the prompts; two of them have columns of their own for the compositional one.
        seed: of the draws.
        beat: heard in every repeat.
    """

    evaluator: Evaluator
    real: Reference
    splits: tuple[str, ...]
    seed: int
    beat: Beat = unheard

    def values(
        self, side: Side, found: Found | None, prompts: NDArray[np.int64], *, distances: bool
    ) -> dict[str, Value]:
        """All values of a row.

        Args:
            side: embeddings of N motions.
            found: what their joints say; None = nobody knows.
            prompts: (N,) the prompt of each motion, which with several splits tells the split.
            distances: whether to measure how far the motions are from the real ones.
        """
        values = self._values(side, found, self.splits, distances)
        if self.splits != (TEST_SPLIT, COMPOSITIONAL):
            return values
        late = prompts >= len(self.real.split(TEST_SPLIT).clips)
        if not late.any():
            return values
        some = None if found is None else [each for each, taken in zip(found, late, strict=True) if taken]
        alone = self._values(side.only(late), some, (COMPOSITIONAL,), distances)
        return values | apart(alone | retrieval(side, self.evaluator, POOLS[0], self.seed, of=late))

    def _values(self, side: Side, found: Found | None, splits: Sequence[str], distances: bool) -> dict[str, Value]:
        real = self.real.joined(splits).motion if distances else None
        values = embedded(side, real, self.evaluator, self.seed)
        if found is None:
            return values | dict.fromkeys((OBEYED, *QUALITY), Value.missing(OLD_BUNDLE))
        return values | on_joints(found, side.variants)


def truth_row(ruler: Ruler) -> Row:
    """Real motion with its own captions, by the same network and the same checker."""
    split = ruler.real.joined(ruler.splits)
    rows = np.arange(len(split.clips))
    found = [(clip.obeyed, clip.quality) for clip in split.clips if clip.quality is not None]
    values = ruler.values(
        real_side(split, split.motion, ruler),
        found if len(found) == len(split.clips) else None,
        rows,
        distances=False,
    )
    for pool, note in _ceilings(split.labels, ruler.seed).items():
        values |= {
            key: replace(value, note=value.note or note) for key, value in values.items() if key in keys_of(pool)
        }
    return Row(
        GROUND_TRUTH, "Real motion", f"{len(split.clips)} clips of {_named(ruler.splits)} with their captions", values
    )


def reconstruction_row(values: Mapping[str, Value] | None, note: str) -> Row:
    """Real motion through the generator's tokenizer: what no generator behind it can be better than."""
    if values is None:
        values = {key: Value.missing(UNMEASURED) for key in (OBEYED, RETRIEVED, "fid")}
    return Row(RECONSTRUCTION, "Reconstruction", note, values)


def generated_rows(measured: Measured, sides: tuple[Side, Side], ruler: Ruler) -> tuple[Row, Row]:
    """The rows `raw` and `exported` of measured motions, whose embeddings are the two sides."""
    raw, exported = (
        ruler.values(side, found, measured.indices, distances=True)
        for side, found in zip(
            sides,
            (
                [(motion.raw.obeyed, motion.raw.quality) for motion in measured.motions],
                [(motion.exported.obeyed, motion.exported.quality) for motion in measured.motions],
            ),
            strict=True,
        )
    )
    return (
        Row("raw", "Generated", "features as the network made them", raw),
        Row(
            "exported",
            "Exported",
            "as users get them: feet locked, rotations solved",
            exported | {"multimodality": several(measured, ruler.seed)},
        ),
    )


def sides_of(measured: Measured, labels: NDArray[np.int64], beat: Beat = unheard) -> tuple[Side, Side]:
    """Raw and exported motions; `labels` (N,) are those of their prompts."""
    raw, exported = (
        Side(motion, measured.text, labels, measured.variants, beat) for motion in (measured.raw, measured.exported)
    )
    return raw, exported


def real_side(split: ReferenceSplit, motion: Embeddings, ruler: Ruler) -> Side:
    """Embeddings (N, E) made of the clips of a split, with the clips' captions."""
    text = embed_prompts(split.prompts, ruler.evaluator, ruler.beat)
    return Side(motion, text, split.labels, np.zeros(len(split.clips), np.int64), ruler.beat)


def _ceilings(labels: NDArray[np.int64], seed: int) -> dict[int, str]:
    """By pool, what R-precision of clips with these labels (N,) has as its most; of pools that they fill."""
    return {
        pool: (
            f"A motion of the prompt's own label counts as found, so a model that knows every label, and nothing more, "
            f"has 100 % in pools of {pool}. Were the clip of the prompt alone to count, it would have "
            f"{', '.join(f'{ceiling:.1f} % at {k}' for k, ceiling in label_ceilings(labels, pool, seed).items())}."
        )
        for pool in POOLS
        if len(labels) >= pool
    }


def _named(splits: Sequence[str]) -> str:
    return f"the {' and '.join(splits)} split{'s' if len(splits) > 1 else ''}"
