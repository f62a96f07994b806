"""Compute the values of real clips by the selector: `python -m marey.data.selector_values PREPARED`.

A motion's percentile among real clips of its action is read from the quantiles in this file. Only unchanged captures
(not mirrored, spliced or retimed) of one action count, for actions with enough of them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from marey.data.measured_files import provenance, write_measured
from marey.data.prepared import PreparedData
from marey.quality.record import SHOWN
from marey.selector import RULES, Motion, WantedAction, match
from marey.selector.motion import SHORTEST
from marey.selector.records import FILE, PERCENT

ENOUGH = 10
"""Number of clips from which an action has quantiles."""
PASSING = 0.75
"""Least share of them that passes the rule of the action; below it, the rule is too strict for a percentile."""


def read_values(data: PreparedData) -> dict[str, list[float]]:
    """Return the values of the clips of each action that has a rule."""
    found: dict[str, list[float]] = defaultdict(list)
    for clip in data.clips:
        if clip.captured and clip.content in RULES and clip.length >= SHORTEST:
            motion = Motion(data.joints(clip), data.manifest.fps)
            found[clip.content].append(match(motion, [(WantedAction(clip.content),)]))
    return dict(sorted(found.items()))


def document(data: PreparedData, values: Mapping[str, Sequence[float]]) -> str:
    """Return the text of `real_values.toml`."""
    enough = {action: of for action, of in values.items() if _is_enough(of)}
    percents = np.arange(0, 101, PERCENT) / 100
    lines = [
        *provenance("marey.data.selector_values", data),
        "",
        "[clips]",
        *(f"{action} = {len(of)}" for action, of in enough.items()),
        "",
        "[values]",
    ]
    for action, of in enough.items():
        quantiles = np.quantile(of, percents, method="higher").round(3).tolist()
        lines.append(f"{action} = {quantiles}")
    return "\n".join(lines) + "\n"


def _is_enough(values: Sequence[float]) -> bool:
    return len(values) >= ENOUGH and sum(value >= SHOWN for value in values) >= PASSING * len(values)


if __name__ == "__main__":
    write_measured(
        "Compute the values of real clips by the selector.", FILE, lambda data: document(data, read_values(data))
    )
