"""Cut long captures into pieces at moments in which the body is still (Guo et al. 2025, section 3, Segmentation).

The mean speed of hip and end effectors is smoothed by a Gaussian filter; its troughs are normalized within the capture
to rho in 0 to 1; a trough becomes a cut with probability 0.5 rho, and every piece has at least 4 and at most 12
seconds. The paper leaves the rest open. Our reading:

- rho is 1 at the stillest trough and 0 at the fastest: cuts at motionless moments are preferred.
- The standard deviation of the filter is a quarter of a second: pieces of a random motion that pauses every five
  seconds have 7.4 seconds on average, those of the paper 8.
- A trough that would leave a piece too short is passed over; where no trough was drawn for 12 seconds, the cut is at
  the stillest frame that leaves both sides long enough.
- End effectors are the ends of the limbs and the head; the fingers of a hand count as one, at the hand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.filters import smooth
from marey.motion.skeleton import Skeleton

Array = NDArray[np.floating]
HAND = 0.15
"""Reach of a hand, foot or head with its joints, at most, as a share of the body's size."""


@dataclass(frozen=True)
class SegmentRule:
    """Parameters of the cuts.

    Attributes:
        shortest, longest: seconds of a piece.
        share: probability of a cut at the stillest trough; it falls to 0 at the fastest.
        sigma: standard deviation of the smoothing of the speed, seconds.
        seed: of the draws; captures of one name are cut alike.
    """

    shortest: float = 4.0
    longest: float = 12.0
    share: float = 0.5
    sigma: float = 0.25
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the parameters.

        Raises:
            InvalidInput: one is out of bounds, or two shortest pieces are longer than the longest.
        """
        if not 0 < self.shortest <= self.longest / 2 or not math.isfinite(self.longest):
            hint = "Make the longest at least twice as long, so that every capture can be cut."
            raise InvalidInput(f"pieces of {self.shortest:g} to {self.longest:g} seconds", where="segment", hint=hint)
        if not 0 <= self.share <= 1:
            raise InvalidInput(f"share is {self.share:g}; it must be between 0 and 1", where="segment")
        if not (self.sigma >= 0 and math.isfinite(self.sigma)):
            raise InvalidInput(f"sigma is {self.sigma:g}; it must be 0 seconds or more", where="segment")


@dataclass(frozen=True, eq=False)
class Segmentation:
    """A capture with its cuts.

    Attributes:
        fps: frames a second.
        speed: (T,) m/s, smoothed.
        troughs: frames of the troughs of the speed.
        rho: (N,) stillness of each trough, 0 to 1.
        cuts: first frames of all pieces but the first, in order.
        forced: those of the cuts that the longest duration made.
        kept: False if the capture is shorter than the shortest piece: it has none.
    """

    fps: float
    speed: Array
    troughs: tuple[int, ...]
    rho: Array
    cuts: tuple[int, ...]
    forced: frozenset[int]
    kept: bool

    @property
    def pieces(self) -> tuple[tuple[int, int], ...]:
        """First frame and end (exclusive) of each piece."""
        edges = (0, *self.cuts, len(self.speed))
        return tuple(pairwise(edges)) if self.kept else ()


def effectors(skeleton: Skeleton) -> tuple[int, ...]:
    """Return hip and end effectors of a skeleton: the root, and the ends of limbs and head; a hand with fingers is one,
    as is a head with a face."""
    rest = skeleton.rest.astype(np.float64)
    size = float(np.ptp(rest, axis=0).max())
    found = {0}
    for leaf in range(1, len(skeleton)):
        if skeleton.children[leaf]:
            continue
        end = j = leaf
        while (j := skeleton.parents[j]) > 0 and _reach(skeleton, rest, j) <= HAND * size:
            end = j if len(skeleton.children[j]) > 1 else end
        found.add(end)
    return tuple(sorted(found))


def _reach(skeleton: Skeleton, rest: Array, j: int) -> float:
    """Return the distance in metres from a joint to the farthest one below it in the rest pose."""
    below, far = list(skeleton.children[j]), 0.0
    while below:
        k = below.pop()
        far = max(far, float(np.linalg.norm(rest[k] - rest[j])))
        below.extend(skeleton.children[k])
    return far


def mean_speed(joints: Array, fps: float, sigma: float) -> Array:
    """Return the mean speed (T,) of joints (T, K, 3) in m/s, smoothed by `sigma` seconds."""
    if len(joints) < 2:
        return np.zeros(len(joints))
    speed = np.linalg.norm(np.gradient(joints.astype(np.float64), axis=0), axis=-1).mean(axis=1) * fps
    return smooth(speed[:, None], sigma * fps)[:, 0]


def find_troughs(speed: Array) -> NDArray[np.intp]:
    """Return the frames (N,) of local minima of a curve (T,), ends excluded; of a flat one, the middle."""
    changes = np.flatnonzero(np.diff(speed))  # ends of level stretches
    edges = np.concatenate([[-1], changes, [len(speed) - 1]])
    middles, levels = (edges[:-1] + 1 + edges[1:]) // 2, speed[edges[1:]]
    low = (levels[1:-1] < levels[:-2]) & (levels[1:-1] < levels[2:])
    return middles[1:-1][low]


def segment(joints: Array, skeleton: Skeleton, fps: float, rule: SegmentRule, *, name: str = "") -> Segmentation:
    """Cut a capture into pieces.

    Args:
        joints: (T, J, 3) metres.
        skeleton: of the joints.
        fps: frames a second.
        rule: the parameters.
        name: of the capture; another name draws other cuts with the same seed.
    """
    speed = mean_speed(joints[:, list(effectors(skeleton))], fps, rule.sigma)
    troughs = find_troughs(speed)
    rho = stillness(speed[troughs])
    draws = np.random.default_rng([rule.seed, *name.encode()]).random(len(troughs))
    longest = max(math.floor(rule.longest * fps), 1)
    shortest = max(min(math.ceil(rule.shortest * fps), longest // 2), 1)  # of whole frames, two must fit into one
    cutter = _Cutter(speed, shortest, longest)
    for trough, drawn in zip(troughs.tolist(), draws < rule.share * rho, strict=True):
        cutter.keep_short(trough)
        if drawn:
            cutter.cut(trough)
    cutter.keep_short(len(speed))
    kept = len(speed) >= shortest
    return Segmentation(fps, speed, tuple(troughs.tolist()), rho, tuple(cutter.cuts), frozenset(cutter.forced), kept)


def stillness(speeds: Array) -> Array:
    """Return rho (N,) of the speeds of troughs: 1 at the lowest of them, 0 at the highest."""
    spread = float(np.ptp(speeds)) if len(speeds) else 0.0
    return (speeds.max() - speeds) / spread if spread > 0 else np.ones(len(speeds))


class _Cutter:
    """Cuts of one capture, from its begin to its end, with pieces neither too short nor too long."""

    def __init__(self, speed: Array, shortest: int, longest: int) -> None:
        self._speed = speed
        self._shortest, self._longest = shortest, longest
        self.cuts: list[int] = []
        self.forced: list[int] = []

    @property
    def _last(self) -> int:
        return self.cuts[-1] if self.cuts else 0

    def cut(self, frame: int) -> None:
        """Cut at a frame, unless a piece on either side would be too short."""
        if frame - self._last >= self._shortest and len(self._speed) - frame >= self._shortest:
            self.cuts.append(frame)

    def keep_short(self, frame: int) -> None:
        """Cut before a frame as often as the piece up to it is too long, each time where the body is stillest."""
        while frame - self._last > self._longest:
            first = self._last + self._shortest
            end = min(self._last + self._longest, len(self._speed) - self._shortest) + 1
            stillest = first + int(self._speed[first:end].argmin())
            self.cuts.append(stillest)
            self.forced.append(stillest)
