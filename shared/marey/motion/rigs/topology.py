"""Find the parts of a rig whose joints have no telling names, by its tree and its rest pose.

Arms and legs are the two pairs of chains that mirror each other with the longest bones; the lower pair are the legs.
The body stands upright in the rest pose and the toes point forward.
"""

from __future__ import annotations

from collections.abc import Set
from itertools import combinations

import numpy as np

from marey.motion.rigs.parts import sided
from marey.motion.rigs.rig import Rig

SHORT = 0.5
"""Length of a first bone relative to the next one, below which it is a hip or collar joint and no limb bone."""
ALIKE = 0.1
"""Relative difference in length of two chains that are a pair."""


def parts_by_shape(rig: Rig, controls: Set[int]) -> dict[str, int]:
    """Return the joints of the limbs and of the head; empty if there are no two pairs of limbs."""
    chains = {joint: _chain(rig, joint, controls) for joint in range(len(rig)) if joint not in controls}
    pairs: list[tuple[float, list[int], list[int]]] = []
    for joint, children in enumerate(rig.children):
        for a, b in combinations([child for child in children if child in chains], 2):
            pairs += _pair(rig, [joint, *chains[a]], [joint, *chains[b]])
    pairs.sort(key=lambda pair: -pair[0])
    if len(pairs) < 2:
        return {}
    two = sorted(pairs[:2], key=lambda pair: min(rig.positions[pair[1] + pair[2], 1]))
    legs, arms = two[0][1:], two[1][1:]
    found: dict[str, int] = {}
    forward = sum((_forward(rig, leg) for leg in legs), np.zeros(3))
    for names, limbs in (
        (("upper_leg", "lower_leg", "foot", "toes"), legs),
        (("upper_arm", "lower_arm", "hand"), arms),
    ):
        left = np.cross([0.0, 1.0, 0.0], forward)
        middle = np.mean([rig.positions[limb[1]] for limb in limbs], axis=0)
        for limb in limbs:
            side = int((rig.positions[limb[1]] - middle) @ left < 0)
            bones = _without_short(rig, limb)
            found.update({sided(side, part): joint for part, joint in zip(names, bones, strict=False)})
    head = _head(rig, [arm[1] for arm in arms], chains)
    return found if head is None else {**found, "head": head}


def _chain(rig: Rig, joint: int, controls: Set[int]) -> list[int]:
    """Return the joints from one down to the farthest end, along the child with the longest way below it."""
    chain = [joint]
    while True:
        below = [child for child in rig.children[chain[-1]] if child not in controls]
        if not below:
            return chain
        chain.append(max(below, key=lambda child: _way(rig, child, controls) + _bone(rig, child)))


def _way(rig: Rig, joint: int, controls: Set[int]) -> float:
    waiting, longest = [(joint, 0.0)], 0.0
    while waiting:
        at, way = waiting.pop()
        longest = max(longest, way)
        waiting += [(child, way + _bone(rig, child)) for child in rig.children[at] if child not in controls]
    return longest


def _bone(rig: Rig, joint: int) -> float:
    return float(np.linalg.norm(rig.offsets[joint])) if rig.parents[joint] >= 0 else 0.0


def _pair(rig: Rig, a: list[int], b: list[int]) -> list[tuple[float, list[int], list[int]]]:
    """Return two chains with their length if they mirror each other and are long enough for limbs."""
    lengths = [sum(_bone(rig, joint) for joint in chain[1:]) for chain in (a, b)]
    alike = abs(lengths[0] - lengths[1]) <= ALIKE * max(*lengths, 1e-9) and len(a) == len(b)
    return [(sum(lengths) / 2, a, b)] if alike and len(a) >= 4 else []


def _without_short(rig: Rig, limb: list[int]) -> list[int]:
    """Return the joints of a limb from the beginning of its first long bone on."""
    joints = limb[1:]
    while len(joints) > 3 and _bone(rig, joints[1]) < SHORT * _bone(rig, joints[2]):
        joints = joints[1:]
    return joints


def _forward(rig: Rig, leg: list[int]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the direction in the floor plane from the ankle to the end of the foot."""
    bones = _without_short(rig, leg)
    way = rig.positions[bones[-1]] - rig.positions[bones[min(2, len(bones) - 1)]]
    return way * np.array([1.0, 0.0, 1.0])


def _head(rig: Rig, arms: list[int], chains: dict[int, list[int]]) -> int | None:
    """Return the joint above the neck: the second of the chain that rises between the arms."""
    chest = rig.parents[arms[0]]
    rising = [child for child in rig.children[chest] if child in chains and child not in arms]
    rising = [child for child in rising if rig.positions[chains[child][-1], 1] > rig.positions[chest, 1]]
    return chains[rising[0]][min(1, len(chains[rising[0]]) - 1)] if rising else None
