"""Judge the measures of a motion by the limits of real motions."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from marey.quality.record import Flag, MotionQuality
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.drops import stated_drop
from marey.vocabulary.entries import FLIGHT_SECONDS, Support, load_vocabulary
from marey.vocabulary.scope import every_action, match_scope
from marey.vocabulary.take_names import as_words

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from marey.quality.measure import Measures

FILE = Path(__file__).with_name("limits.toml")
LIMITED: dict[str, Flag] = {
    "skate": Flag.SKATING,
    "penetration_mm": Flag.UNDER_FLOOR,
    "pops": Flag.POPPING,
    "range_deg": Flag.JOINT_RANGE,
    "self_contact": Flag.SELF_CONTACT,
}
"""Measures with a limit for each support, and the flag of a motion beyond it."""
OFF_FLOOR: frozenset[Support] = frozenset({"raised", "none"})
"""Supports of which the place is unknown: motions on them do not float."""
_ROUNDING = 1e-6


@dataclass(frozen=True)
class Expected:
    """Promise of the actions of a motion.

    Attributes:
        supports: parts of the body that carry it, without duplicates.
        flight_s: longest time off its support, seconds.
    """

    supports: tuple[Support, ...] = ("feet",)
    flight_s: float = FLIGHT_SECONDS


MOVED = Expected(("feet", "whole-body"), 0.7)
"""Promise of movements of the whole body that are no action, such as burpees and dives."""


def expected_of(actions: Iterable[str]) -> Expected:
    """Return what these actions of the vocabulary promise together; without one, a body on its feet."""
    vocabulary = load_vocabulary()
    found = [vocabulary.need(name) for name in actions]
    if not found:
        return Expected()
    return Expected(tuple(dict.fromkeys(a.support for a in found)), max(a.flight_s for a in found))


def expected_by_prompts(prompts: Iterable[str]) -> Expected:
    """Return what the actions promise that the words of prompts name."""
    prompts = tuple(prompts)
    named = (action.action for prompt in prompts for action in match_scope(prompt, every_action()).actions)
    expected = expected_of(name for name in named if name is not None)
    if any(stated_drop(as_words(prompt)) for prompt in prompts):
        expected = Expected((*expected.supports, "raised"), expected.flight_s)
    if not any(each.bearing.moves for prompt in prompts for each in stated_bearings(as_words(prompt))):
        return expected
    supports = tuple(dict.fromkeys((*expected.supports, *MOVED.supports)))
    return Expected(supports, max(expected.flight_s, MOVED.flight_s))


@lru_cache(maxsize=1)
def limits() -> Mapping[str, Mapping[str, float]]:
    """Return the limit of each measure by support."""
    return tomllib.loads(FILE.read_text("utf-8"))["limits"]


def judge(measures: Measures, expected: Expected) -> MotionQuality:
    """Compare measures with limits; of several supports the most lenient limit counts."""
    table = limits()
    values = vars(measures)
    flags = [
        flag
        for name, flag in LIMITED.items()
        if values[name] > max(table[support][name] for support in expected.supports) + _ROUNDING
    ]
    if measures.float_s > expected.flight_s + _ROUNDING and not OFF_FLOOR & set(expected.supports):
        flags.insert(0, Flag.FLOATING)
    return MotionQuality(**values, support=list(expected.supports), flags=flags, ok=not flags)


def assess(joints: NDArray[np.floating], fps: float, expected: Expected) -> MotionQuality:
    """Measure and judge a motion.

    Args:
        joints: (T >= 4, 22, 3) metres, Y up, the floor at y = 0.
        fps: frames a second.
        expected: what its actions promise.

    Raises:
        InvalidInput: joints of another shape, or numbers that are not finite.
    """
    from marey.quality.measure import measure

    return judge(measure(joints, fps), expected)
