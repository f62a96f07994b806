"""Pass rates of the checker on real clips: on the actions that a clip shows, and on those it does not show."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.checks.judge import Expectation, judge
from marey.checks.quality import Quality, quality

_JUDGED_AS = {"dash": "run"}
_SIDED = ("turn", "wave", "raise")
ALL_EXPECTATIONS: tuple[Expectation, ...] = (
    *(Expectation(act) for act in ("walk", "run", "walk_back", "bow", "kick", "punch", "slash", "dance")),
    *(Expectation("turn", side) for side in ("left", "right")),
    *(Expectation("wave", side) for side in ("left", "right", "both")),
    *(Expectation("raise", side) for side in ("left", "right", "both")),
)


@dataclass(frozen=True)
class LabelledClip:
    """A clip whose actions are known."""

    id: str
    acts: tuple[str, ...]
    sides: tuple[str, ...]
    joints: Callable[[], NDArray[np.float32]]

    def expected(self) -> tuple[Expectation, ...] | None:
        """The clip's actions as expectations; None if one of them has no check."""
        return expectations(self.acts, self.sides)


def expectations(acts: Sequence[str], sides: Sequence[str]) -> tuple[Expectation, ...] | None:
    """Actions and the measured side of each as expectations, in order; None when there is no check for one of them."""
    out: list[Expectation] = []
    for act, side in zip(acts, sides, strict=True):
        act = _JUDGED_AS.get(act, act)
        found = [e for e in ALL_EXPECTATIONS if e.act == act and e.side == (side if act in _SIDED else "")]
        if not found:
            return None
        out.append(found[0])
    return tuple(out)


@dataclass(frozen=True)
class Rate:
    """Number of clips of one kind, and of those that pass."""

    clips: int
    passed: int

    @property
    def share(self) -> float:
        """0 to 1."""
        return self.passed / max(self.clips, 1)


@dataclass(frozen=True)
class Rates:
    """Pass rates of the checker on real clips.

    Attributes:
        own: share of clips that pass their own check, by content (`turn left`, `wave right then walk`).
        wrong: by check, the share of clips of other contents that pass it.
        wrong_by: (content, check) pairs with their rates, other contents only.
        failures: id and reason of each clip that fails its own check.
        quality: mean over all clips.
    """

    own: dict[str, Rate]
    wrong: dict[str, Rate]
    wrong_by: dict[tuple[str, str], Rate]
    failures: tuple[tuple[str, str], ...]
    quality: Quality

    @property
    def overall(self) -> Rate:
        """Return the rate over all clips."""
        return Rate(sum(r.clips for r in self.own.values()), sum(r.passed for r in self.own.values()))


def name_of(expected: Iterable[Expectation]) -> str:
    """`walk`, `wave left`, `walk then wave left`."""
    return " then ".join(f"{e.act} {e.side}".strip() for e in expected)


def rates(clips: Iterable[LabelledClip], fps: float) -> Rates:
    """Judge clips by their own check and, if they show one action, by every other."""
    shown, passed = Counter[str](), Counter[str]()
    tried, wrong = Counter[tuple[str, str]](), Counter[tuple[str, str]]()
    failures: list[tuple[str, str]] = []
    qualities: list[Quality] = []
    for clip in clips:
        joints = clip.joints()
        qualities.append(quality(joints, fps))
        expected = clip.expected()
        name = name_of(expected) if expected else " then ".join(clip.acts)
        if expected:
            verdict = judge(joints, fps, expected)
            shown[name] += 1
            passed[name] += verdict.passed
            if not verdict.passed:
                failures.append((clip.id, verdict.reason))
        if len(clip.acts) == 1:
            for other in ALL_EXPECTATIONS:
                if expected != (other,):
                    tried[name, name_of([other])] += 1
                    wrong[name, name_of([other])] += judge(joints, fps, [other]).passed
    by_check: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for (content, check), count in tried.items():
        by_check[check][0] += count
        by_check[check][1] += wrong[content, check]
    return Rates(
        own={name: Rate(count, passed[name]) for name, count in sorted(shown.items())},
        wrong={check: Rate(*counts) for check, counts in sorted(by_check.items())},
        wrong_by={key: Rate(count, wrong[key]) for key, count in sorted(tried.items()) if wrong[key]},
        failures=tuple(failures),
        quality=mean_quality(qualities),
    )


def mean_quality(qualities: Iterable[Quality]) -> Quality:
    """Return the mean of each number over the clips, the deepest penetration included."""
    table = np.array([[q.skate, q.jerk, q.bone_drift, q.penetration] for q in qualities])
    return Quality(*(float(v) for v in table.mean(axis=0)))
