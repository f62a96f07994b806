"""Parts of a report: numbers, rows, clips, references.

A missing number is a marked place with a reason; NaN and infinity are refused on construction, so that no page shows
them. Numbers are given in the unit they are printed in: a share in percent is 94.9.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Literal

from pydantic import InstanceOf

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.distribution import SAMPLES_PER_DIMENSION
from marey.motion.clip import MotionClip


@dataclass(frozen=True)
class Value:
    """One number of the table.

    Attributes:
        mean: over the repeats; None = not available.
        half_width: of its 95 % interval over the repeats; None = measured once.
        n: motions (or prompts) of one repeat; for a distance of distributions the smaller set.
        note: a remark for the reader; the reason if there is no number.
        dimensions: of the embeddings, for a metric that needs many motions per dimension (FID).
    """

    mean: float | None
    half_width: float | None = None
    n: int = 0
    note: str = ""
    dimensions: int | None = None

    def __post_init__(self) -> None:
        finite("value", self.mean, self.half_width)
        if self.mean is None and not self.note.strip():
            raise InvalidInput("a value that is not available needs a note")
        if self.mean is None and self.half_width is not None:
            raise InvalidInput("a value that is not available has no interval")
        if self.half_width is not None and self.half_width < 0:
            raise InvalidInput(f"an interval of half width {self.half_width:g}")
        if self.n < 0 or (self.dimensions is not None and self.dimensions < 1):
            raise InvalidInput(f"a value of {self.n} motions in {self.dimensions} dimensions")

    @classmethod
    def missing(cls, why: str) -> Value:
        """Create a marked place in the table."""
        return cls(None, note=why)

    @property
    def too_few(self) -> bool:
        """True if the number has fewer than 5 motions per dimension: it is mostly sampling noise."""
        return (
            self.mean is not None and self.dimensions is not None and self.n < SAMPLES_PER_DIMENSION * self.dimensions
        )


@dataclass(frozen=True)
class Metric:
    """One column.

    Attributes:
        key: `r_precision_1`.
        label: `R-precision, top 1`.
        unit: printed after the number; empty for a bare one.
        better: the better direction; empty if neither is (diversity: near the ground truth).
        digits: after the point.
        explanation: one sentence for readers who do not know the metric.
        measured_by: the network (name and hash) or the method. Columns of different ones share no table.
        measured_on: the data, if not the report's source: the compositional split has columns of its own.
    """

    key: str
    label: str
    unit: str = ""
    better: Literal["higher", "lower", ""] = ""
    digits: int = 3
    explanation: str = ""
    measured_by: str = "joints, without a network"
    measured_on: str = ""

    @property
    def name(self) -> str:
        """Return the metric's name in a sentence, with its data if those differ from the report's."""
        return f"{self.label} on {self.measured_on}" if self.measured_on else self.label


@dataclass(frozen=True)
class MetricRow:
    """One row: ground truth, reconstruction, raw, exported, a ceiling.

    Attributes:
        key: `ground_truth`, `reconstruction`, `raw`, `exported`, ….
        label: as printed.
        note: description of the row, in a few words.
        values: by metric; a metric without meaning for the row is left out.
    """

    key: str
    label: str
    note: str = ""
    values: Mapping[str, Value] = field(default_factory=dict[str, Value])


@dataclass(frozen=True)
class TrendPoint:
    """The judged row of one run, for the key metrics."""

    finished: datetime
    evaluation: str
    bundle: str
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        aware("trend.finished", self.finished)
        finite(f"trend of evaluation {self.evaluation}", *self.values.values())


@dataclass(frozen=True)
class HeatCell:
    """Prompt checks of one action in one style."""

    act: str
    style: str
    trials: int
    passed: int

    def __post_init__(self) -> None:
        if not 0 <= self.passed <= self.trials:
            raise InvalidInput(f"{self.passed} of {self.trials} trials passed", where=f"{self.act}, {self.style}")


@dataclass(frozen=True)
class Exhibit:
    """A clip that the page shows. An exhibit read from JSON has no clip, and the page shows its text alone."""

    prompt: str
    seed: int
    passed: bool
    reason: str
    score: float
    clip: InstanceOf[MotionClip] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        finite(f"score of {self.prompt!r}", self.score)


@dataclass(frozen=True)
class GenerationSpeed:
    """Generation speed; `note` says on which hardware (workers, device, batch)."""

    motions_per_second: float
    median_seconds_per_motion: float
    note: str = ""

    def __post_init__(self) -> None:
        finite("speed", self.motions_per_second, self.median_seconds_per_motion)


@dataclass(frozen=True)
class ArtifactReference:
    """Reference to a bundle, a split or a file: name and sha256 of the content."""

    name: str
    sha256: str


@dataclass(frozen=True)
class Repeats:
    """The repeats that intervals are computed over.

    Attributes:
        count: repeats.
        regenerated: number of repeats that generated all motions anew; the others drew pools only, and an interval over
            those does not cover the variation of another generation.
    """

    count: int
    regenerated: int

    def __post_init__(self) -> None:
        if not 0 <= self.regenerated <= self.count or self.count < 1:
            raise InvalidInput(f"{self.regenerated} of {self.count} repeats were regenerated")


def finite(where: str, *numbers: float | None) -> None:
    """Refuse NaN and infinity."""
    for number in numbers:
        if number is not None and not math.isfinite(number):
            raise InvalidInput(f"{number} cannot be reported", where=where, hint="Give the reason with Value.missing.")


def aware(where: str, moment: datetime) -> None:
    """Refuse a time without time zone."""
    if moment.tzinfo is None:
        raise InvalidInput("a time without time zone", where=where)


def distinct(where: str, keys: Iterable[object]) -> None:
    """Refuse duplicate keys."""
    seen: set[object] = set()
    for key in keys:
        if key in seen:
            raise InvalidInput(f"duplicate key {key!r}", where=where)
        seen.add(key)
