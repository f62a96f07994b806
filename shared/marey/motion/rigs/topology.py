"""Find the parts of a rig whose joints have no telling names, by its tree and its rest pose.

Arms and legs are the two pairs of chains that mirror each other with the longest bones; the lower pair are the legs.
The body stands upright in the rest pose and the toes point forward.
"""

from __future__ import annotations

from collections.abc import Iterator, Set
from itertools import combinations

import numpy as np

from marey.motion.rigs.parts import sided
from marey.motion.rigs.rig import Rig

SHORT = 0.5
"""Length of a first bone relative to the next one, below which it is a hip or collar joint and no limb bone."""
LIMB = 4
"""Joints of a limb, with the one that it hangs on, at least."""
ALIKE = 0.1
"""Relative difference in length of two chains that are a pair."""


class _Tree:
    """The joints of a rig that carry the body, with the longest way below each; each is computed once."""

    def __init__(self, rig: Rig, controls: Set[int]) -> None:
        self.rig = rig
        self.children = [[child for child in below if child not in controls] for below in rig.children]
        self.bones = [
            float(np.linalg.norm(offset)) if parent >= 0 else 0.0
            for offset, parent in zip(rig.offsets, rig.parents, strict=True)
        ]
        count = len(rig)
        self.next = [-1] * count
        """The child with the longest way below it, -1 at an end."""
        self.joints = [1] * count
        """Number of joints of the chain that begins here."""
        ways = [0.0] * count
        for joint in range(count - 1, -1, -1):  # children come after their parents
            if below := self.children[joint]:
                self.next[joint] = longest = max(below, key=lambda child: ways[child] + self.bones[child])
                ways[joint] = ways[longest] + self.bones[longest]
                self.joints[joint] = self.joints[longest] + 1

    def chain(self, joint: int) -> list[int]:
        """Return the joints from one down to the farthest end."""
        chain: list[int] = []
        while joint >= 0:
            chain.append(joint)
            joint = self.next[joint]
        return chain

    def length(self, joint: int) -> float:
        """Return the length of a chain with the bone that leads to it, metres."""
        return sum(self.bones[each] for each in self.chain(joint))


def parts_by_shape(rig: Rig, controls: Set[int]) -> dict[str, int]:
    """Return the joints of the limbs and of the head; empty if there are no two pairs of limbs."""
    tree = _Tree(rig, controls)
    pairs = sorted(_pairs(tree), key=lambda pair: -pair[0])
    if len(pairs) < 2:
        return {}
    limbs = [[[joint, *tree.chain(child)] for child in pair] for _, joint, *pair in pairs[:2]]
    legs, arms = sorted(limbs, key=lambda pair: min(rig.positions[pair[0] + pair[1], 1]))
    found: dict[str, int] = {}
    forward = sum((_forward(tree, leg) for leg in legs), np.zeros(3))
    for names, limbs in (
        (("upper_leg", "lower_leg", "foot", "toes"), legs),
        (("upper_arm", "lower_arm", "hand"), arms),
    ):
        left = np.cross([0.0, 1.0, 0.0], forward)
        middle = np.mean([rig.positions[limb[1]] for limb in limbs], axis=0)
        for limb in limbs:
            side = int((rig.positions[limb[1]] - middle) @ left < 0)
            bones = _without_short(tree, limb)
            found.update({sided(side, part): joint for part, joint in zip(names, bones, strict=False)})
    head = _head(tree, [arm[1] for arm in arms], controls)
    return found if head is None else {**found, "head": head}


def _pairs(tree: _Tree) -> Iterator[tuple[float, int, int, int]]:
    """Yield the mean length of two chains that mirror each other and are long enough for limbs, the joint that they
    hang on, and the first joint of each."""
    for joint, children in enumerate(tree.children):
        limbs = [child for child in children if tree.joints[child] >= LIMB - 1]
        long = {child: tree.length(child) for child in limbs} if len(limbs) > 1 else {}
        for a, b in combinations(long, 2):
            alike = abs(long[a] - long[b]) <= ALIKE * max(long[a], long[b], 1e-9)
            if alike and tree.joints[a] == tree.joints[b]:
                yield (long[a] + long[b]) / 2, joint, a, b


def _without_short(tree: _Tree, limb: list[int]) -> list[int]:
    """Return the joints of a limb from the beginning of its first long bone on."""
    joints = limb[1:]
    while len(joints) > 3 and tree.bones[joints[1]] < SHORT * tree.bones[joints[2]]:
        joints = joints[1:]
    return joints


def _forward(tree: _Tree, leg: list[int]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return the direction in the floor plane from the ankle to the end of the foot."""
    bones, places = _without_short(tree, leg), tree.rig.positions
    way = places[bones[-1]] - places[bones[min(2, len(bones) - 1)]]
    return way * np.array([1.0, 0.0, 1.0])


def _head(tree: _Tree, arms: list[int], controls: Set[int]) -> int | None:
    """Return the joint above the neck: the second of the chain that rises between the arms."""
    chest, heights = tree.rig.parents[arms[0]], tree.rig.positions[:, 1]
    chains = [tree.chain(child) for child in tree.children[chest] if child not in arms and child not in controls]
    rising = next((chain for chain in chains if heights[chain[-1]] > heights[chest]), None)
    return None if rising is None else rising[min(1, len(rising) - 1)]
