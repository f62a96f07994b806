"""Blends of a loop that misses its bars by little: slower, and smoothed part by part of the body, while that helps.

In a blend two stretches of the source meet, and a joint may move or turn back a little more than it may. Then the blend
shows less of the source than it is long, and its frames move towards the middle of their neighbours, none at its
ends: root and legs, trunk and each arm as much as brings the joint that is farthest over its bar nearer to it. Feet
that stand stay where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from marey.motion.clip import MotionClip
from marey.motion.edits.loop_bars import Fault
from marey.motion.edits.loop_blend import Bool, Closed, closed, with_feet
from marey.motion.edits.loop_search import Cycle
from marey.motion.kinematics import forward_kinematics
from marey.motion.legs import foot_chain
from marey.motion.rotations import Array, slerp, unroll
from marey.motion.skeleton import Skeleton

NEAR = 1.2
"""Largest measure over its bar of a loop that is changed; of captured clips none with a larger one was mended."""
SLOWEST, STRONGEST = 0.08, 4.0
"""Largest share of its length by which a blend shows less of the source, and strength of smoothing: at 1, the frame in
the middle of the blend moves half the way to the middle of its neighbours, once."""
STEPS = (0.25, 0.125, 0.0625)
"""Changes of a share or strength, as shares of the largest, tried in this order."""
GAIN = 1e-4
"""Least gain of a change."""


def eased(
    clip: MotionClip, contacts: Bool, cycle: Cycle, window: int, judge: Callable[[Closed], Closed | Fault]
) -> Closed | Fault:
    """Close a cycle by the blend that comes nearest to the bars.

    Args:
        clip: the source.
        contacts: (T, 4).
        cycle: its first and last frame.
        window: frames of the blend.
        judge: `Bars.best`.

    Returns:
        The first loop that keeps the bars, or the bar that the nearest one misses.
    """

    def judged(values: Array) -> Closed | Fault:
        loop = closed(clip, contacts, cycle, window, values[0] * SLOWEST * window)
        return judge(smoothed(clip, loop, STRONGEST * values[1:]))

    values = np.zeros(1 + len(_parts(clip.skeleton)))
    nearest = judged(values)
    for step in STEPS:
        while isinstance(nearest, Fault) and nearest.excess <= NEAR:
            for other in _around(values, step):
                found = judged(other)
                if isinstance(found, Closed) or found.excess < nearest.excess - GAIN:
                    values, nearest = other, found
                    break
            else:
                break
    return nearest


def _around(values: Array, step: float) -> Iterator[Array]:
    """Yield values (1 + P,) that differ by a step: in how slow the blend is, in all parts, or in one."""
    slow, *parts = np.eye(len(values))
    for direction in [slow, 1.0 - slow, *parts]:
        for sign in (step, -step):
            other = np.clip(values + sign * direction, 0.0, 1.0)
            if (other != values).any():
                yield other


def smoothed(clip: MotionClip, loop: Closed, strengths: Array) -> Closed:
    """Return a loop whose blend is smoothed.

    Args:
        loop: with its seam after the blend, as `closed` returns it.
        strengths: (P,) of root and legs, trunk, and each arm.
    """
    count = len(loop.root) - 1
    inner = np.arange(count - loop.blend + 1, count)
    if not len(inner) or not strengths.any():
        return loop
    rotations, root = loop.rotations.astype(np.float64), loop.root.astype(np.float64)
    before = forward_kinematics(clip.skeleton, rotations[inner], root[inner])
    share = 0.5 * np.sin(np.pi * np.arange(1, loop.blend) / loop.blend)
    of_joint = strengths @ _parts(clip.skeleton)
    for number in range(int(np.ceil(strengths.max()))):
        now = share[:, None] * np.clip(of_joint - number, 0.0, 1.0)
        middle = slerp(rotations[inner - 1], rotations[inner + 1], np.full(now.shape, 0.5))
        place = root[inner] + now[:, :1] * ((root[inner - 1] + root[inner + 1]) / 2 - root[inner])
        rotations[inner], root[inner] = slerp(rotations[inner], middle, now), place
    wanted = forward_kinematics(clip.skeleton, rotations[inner], root[inner])
    feet = list(clip.skeleton.feet)
    stands = np.repeat(loop.contacts[inner].reshape(-1, 2, 2).any(axis=2), 2, axis=1)
    wanted[:, feet] = np.where(stands[..., None], before[:, feet], wanted[:, feet])
    rotations[inner] = with_feet(clip, rotations[inner], root[inner], wanted)
    return replace(loop, rotations=unroll(rotations), root=root)


@lru_cache(maxsize=8)
def _parts(skeleton: Skeleton) -> NDArray[np.float64]:
    """Return the parts (P, J) of a skeleton, 1 where a joint is of a part: root and legs, trunk, and each arm."""
    legs = {0}
    for hip, toe in zip((skeleton.facing[1], skeleton.facing[0]), skeleton.feet[1::2], strict=True):
        legs |= {hip, skeleton.children[hip][0], *foot_chain(skeleton, toe)}
    arms = [_below(skeleton, shoulder) for shoulder in skeleton.facing[2:]]
    trunk = set(range(len(skeleton))) - legs - set[int]().union(*arms)
    return np.array([[float(joint in part) for joint in range(len(skeleton))] for part in (legs, trunk, *arms)])


def _below(skeleton: Skeleton, joint: int) -> set[int]:
    """Return a joint and all that hang on it."""
    return {joint}.union(*(_below(skeleton, child) for child in skeleton.children[joint]))
