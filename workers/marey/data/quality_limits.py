"""Compute the limits of `marey.quality` from real motions: `python -m marey.data.quality_limits PREPARED`.

The limit of a measure is a quantile of the captured clips (not mirrored or spliced) of a support: the lowest from the
99th percentile on at which 98 % of all clips have no flag. Floating is limited by the flight time of the actions.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from marey.core.errors import InvalidInput
from marey.data.manifest import Clip
from marey.data.measured_files import provenance, write_measured
from marey.data.prepared import PreparedData
from marey.quality.limits import FILE, LIMITED, OFF_FLOOR, Expected, expected_of
from marey.quality.measure import Measures, measure
from marey.vocabulary.entries import Support, load_vocabulary

PASSING = 0.98
QUANTILES = (*np.arange(0.990, 0.9995, 0.001).round(4).tolist(), 1.0)
LEAST = {"penetration_mm": 30.0}
"""Lower bounds of limits: the floor of prepared clips is fitted to their lowest joint."""
ENOUGH = 100
"""Number of clips from which a support has its own limits; others use those of all clips."""
RAISED = re.compile(r"uneven|\bframe\b|\bbar\b|\bhigh (stool|seat|hold)|on top|climbs down|drops to the floor")
"""Pattern of captions whose clips stand or sit on an object above the floor, regardless of the action."""
TILTED = ("07_", "08_")
"""CMU subjects whose captured floor tilts: their feet end 8 cm or more above it. They are counted separately."""


@dataclass(frozen=True)
class Real:
    """A real clip with its measures."""

    id: str
    expected: Expected
    measures: Measures

    @property
    def floats(self) -> bool:
        """Return True if the body is off the floor for longer than its actions allow."""
        return self.measures.float_s > self.expected.flight_s and not OFF_FLOOR & set(self.expected.supports)

    def within(self, table: Mapping[Support, Mapping[str, float]]) -> bool:
        """Return True if no measure exceeds its limit."""
        beyond = any(
            getattr(self.measures, name) > max(table[support][name] for support in self.expected.supports)
            for name in LIMITED
        )
        return not self.floats and not beyond


def read_real(data: PreparedData) -> list[Real]:
    """Measure the captured clips whose actions are in the vocabulary."""
    found = [(clip, _expected(clip)) for clip in data.clips if clip.captured]
    return [
        Real(clip.id, expected, measure(data.joints(clip), data.manifest.fps))
        for clip, expected in found
        if expected is not None
    ]


def _expected(clip: Clip) -> Expected | None:
    if any(RAISED.search(caption) for caption in clip.captions):
        return Expected(("raised",))
    actions = [name for name in clip.content.split("; ") if name in load_vocabulary().actions]
    return expected_of(actions) if actions else None


def limits_at(quantile: float, clips: Sequence[Real]) -> dict[Support, dict[str, float]]:
    """Return the limits of each support at a quantile."""
    supports: list[Support] = ["feet", "seat", "hands", "whole-body", "raised", "none"]

    def of(support: Support, name: str) -> float:
        own = [clip for clip in clips if support in clip.expected.supports]
        values = [getattr(clip.measures, name) for clip in (own if len(own) >= ENOUGH else clips)]
        limit = float(np.quantile(values, quantile, method="higher"))
        return max(LEAST.get(name, 0.0), round(limit, 4))

    return {support: {name: of(support, name) for name in LIMITED} for support in supports}


def share(clips: Sequence[Real], table: Mapping[Support, Mapping[str, float]]) -> float:
    """Return the share of clips without a flag."""
    return sum(clip.within(table) for clip in clips) / len(clips)


def compute(clips: Sequence[Real]) -> tuple[float, dict[Support, dict[str, float]]]:
    """Return the lowest quantile at which `PASSING` of the clips have no flag, and its limits.

    Raises:
        InvalidInput: no quantile does.
    """
    for quantile in QUANTILES:
        table = limits_at(quantile, clips)
        if share(clips, table) >= PASSING:
            return quantile, table
    floating = sum(clip.floats for clip in clips)
    raise InvalidInput(f"{floating} of {len(clips)} clips float: no limits pass {PASSING:.0%}", where="prepared data")


def document(data: PreparedData, clips: Sequence[Real]) -> str:
    """Return the text of `limits.toml`."""
    level = [clip for clip in clips if not clip.id.startswith(TILTED)]
    quantile, table = compute(level)
    counts = Counter(support for clip in level for support in clip.expected.supports)
    lines = [
        *provenance("marey.data.quality_limits", data),
        f"quantile = {quantile}",
        f"clips = {len(level)}",
        f"passing = {share(level, table):.4f}",
        f"clips_with_tilted_floors = {len(clips)}",
        f"passing_with_tilted_floors = {share(clips, table):.4f}",
        "",
        "[clips_by_support]",
        *(f"{support} = {counts[support]}" for support in table),
    ]
    for support, row in table.items():
        lines += ["", f"[limits.{support}]", *(f"{name} = {value:g}" for name, value in row.items())]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write_measured("Compute the limits of the quality of motions.", FILE, lambda data: document(data, read_real(data)))
