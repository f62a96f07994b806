"""Motions with the number of repetitions that their prompt asks for.

A network knows an action, but not how often to do it. Repetitions too many are cut out between two frames of the
same pose, and those that are missing are made of the others, as a motion graph joins clips (Kovar et al. 2002).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import body_frame, heading, velocity
from marey.motion.features import FeatureLayout
from marey.motion.filters import smoothstep
from marey.selector.repetitions import Repetition

Float32 = NDArray[np.float32]

FARTHEST = 0.25
"""Metres between the joints of two frames, and those that they pass in `LOOK_AHEAD`, from which they are not joined."""
LOOK_AHEAD = 0.15
"""Seconds of velocity that weigh as much as the place of a joint."""
BLEND = 0.4
"""Seconds after a seam within which a motion comes back to its own frames."""
HELD = 0.1
"""Metres of such a distance up to which a body holds still."""
LONGEST_HOLD = 0.5
"""Seconds for which a repetition of several is held at most: who does four squats does not sit in each of them."""
TRIES = 6
"""Most ways that are tried to reach a number."""


@dataclass(frozen=True)
class Seam:
    """Frame `after` follows on the frame before `before`.

    Attributes:
        cost: distance of the frames in metres.
    """

    before: int
    after: int
    cost: float


def repeated(
    features: Float32, layout: FeatureLayout, find: Callable[[NDArray[np.floating]], Sequence[Repetition]], count: int
) -> Float32 | None:
    """Return features (T', D) in which an action is done `count` times; None if they cannot be made of these.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        find: returns the repetitions in joints (T, J, 3).
        count: at least 1.
    """
    joints = layout.decode(features)
    found = find(joints)
    if not found:
        return None
    if len(found) == count:
        return features
    distances = _distances(joints, layout.fps)
    if count > 1 and (holds := list(_holds(found, distances, layout.fps))):
        features = _joined(features, holds, layout)
        joints = layout.decode(features)
        found, distances = find(joints), _distances(joints, layout.fps)
    ways = _removals(found, count, distances) if len(found) > count else _additions(found, count, distances)
    for seams in islice(ways, TRIES):
        made = _joined(features, seams, layout)
        if len(find(layout.decode(made))) == count:
            return made
    return None


def _distances(joints: NDArray[np.floating], fps: float) -> NDArray[np.floating]:
    """Return the distance (T, T) in metres of the poses and velocities of any two frames, wherever they stand and
    whichever way they face."""
    local = joints - joints[:, :1] * [1, 0, 1]
    moving = velocity(joints, fps) * LOOK_AHEAD
    angles = heading(joints, fps)[:, None]
    parts = []
    for vectors in (local, moving):
        forward, left = body_frame(vectors, angles)
        parts.append(np.stack([forward, vectors[..., 1], left], axis=-1))
    poses = np.concatenate(parts, axis=1).reshape(len(joints), -1)
    squares = (poses**2).sum(axis=1)
    between = squares[:, None] + squares[None] - 2 * poses @ poses.T
    return np.sqrt(np.maximum(between, 0) / joints.shape[1])


def _holds(found: Sequence[Repetition], distances: NDArray[np.floating], fps: float) -> Iterator[Seam]:
    """Yield seams over which no repetition holds still for longer than `LONGEST_HOLD`."""
    spare = round(LONGEST_HOLD * fps)
    for each in found:
        held = np.argwhere(np.triu(distances[each.begin : each.end, each.begin : each.end] <= HELD, spare + 1))
        if len(held):
            first, last = held[np.argmax(held[:, 1] - held[:, 0])] + each.begin
            yield Seam(int(first) + spare, int(last), float(distances[first, last]))


def _seam(before: tuple[int, int], after: tuple[int, int], distances: NDArray[np.floating]) -> Seam | None:
    """Return the best seam from a frame of one range to a frame of another; None if a range is empty."""
    part = distances[before[0] : before[1], after[0] : after[1]]
    if not part.size:
        return None
    row, column = np.unravel_index(int(np.argmin(part)), part.shape)
    return Seam(before[0] + int(row), after[0] + int(column), float(part[row, column]))


def _removals(found: Sequence[Repetition], count: int, distances: NDArray[np.floating]) -> Iterator[list[Seam]]:
    """Yield ways to leave out repetitions that follow on each other until `count` are left, the smoothest first."""
    pauses, spare = _pauses(found, len(distances)), len(found) - count
    seams = [_seam(pauses[number], pauses[number + spare], distances) for number in range(count + 1)]
    yield from ([seam] for seam in _smooth(seams))


def _additions(found: Sequence[Repetition], count: int, distances: NDArray[np.floating]) -> Iterator[list[Seam]]:
    """Yield ways to do repetitions again until there are `count`: all that can be, or the smoothest alone."""
    seams = _smooth(_seam(after, before, distances) for before, after in pairwise(_pauses(found, len(distances))))
    for used in range(len(seams), 0, -1):
        yield sorted((seams[number % used] for number in range(count - len(found))), key=lambda seam: seam.before)


def _pauses(found: Sequence[Repetition], frames: int) -> list[tuple[int, int]]:
    """Return the ranges of frames before, between and after repetitions; empty where these overlap."""
    begins, ends = [each.begin for each in found], [each.end for each in found]
    return list(zip([0, *ends], [*begins, frames], strict=True))


def _smooth(seams: Iterable[Seam | None]) -> list[Seam]:
    """Return the seams that are not seen, the smoothest first."""
    return sorted((seam for seam in seams if seam and seam.cost <= FARTHEST), key=lambda seam: seam.cost)


def _joined(features: Float32, seams: Sequence[Seam], layout: FeatureLayout) -> Float32:
    """Return features that go over seams, in order of `before`; what differs at a seam fades out after it."""
    length = max(round(BLEND * layout.fps), 1)
    share = np.concatenate([np.linspace(1, 0, length + 2)[1:], np.zeros(len(features))]).astype(np.float32)
    fade = smoothstep(share)[:, None]
    parts, begin, offset = list[Float32](), 0, np.zeros_like(features[0])
    for seam in seams:
        part = features[begin : seam.before]
        parts.append(part + fade[: len(part)] * offset)
        offset = features[seam.before] + fade[len(part)] * offset - features[seam.after]
        offset[layout.slices["contacts"]] = 0
        begin = seam.after
    parts.append(features[begin:] + fade[: len(features) - begin] * offset)
    return np.concatenate(parts)
