"""Relations in the tree of a rig."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def above(parents: Sequence[int], joint: int) -> list[int]:
    """Return a joint and everything above it, from the joint up."""
    chain: list[int] = []
    while joint >= 0:
        chain.append(joint)
        joint = parents[joint]
    return chain


def hangs_on(parents: Sequence[int], joint: int, upper: int) -> bool:
    """Return True if a joint is below another one."""
    return joint != upper and upper in above(parents, joint)


def between(parents: Sequence[int], upper: int, joint: int) -> list[int]:
    """Return the joints under `upper` and over `joint`, from above; empty if it does not hang on it."""
    chain = above(parents, joint)
    return chain[1 : chain.index(upper)][::-1] if upper in chain else []


def common(parents: Sequence[int], joints: Iterable[int]) -> int:
    """Return the lowest joint that all of these hang on or are; -1 if there is none."""
    chains = [above(parents, joint) for joint in joints]
    return next((joint for joint in chains[0] if all(joint in chain for chain in chains[1:])), -1) if chains else -1
