"""Joints with several bones as rigid bodies: detection, and their rotation (Davenport's q-method, Markley & Crassidis
2014, section 5.3.1)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marey.motion.rotations import Array, rotate
from marey.motion.skeleton import Skeleton


class BodyFit:
    """Fits all rigid bodies of a skeleton at once, B of them.

    Bodies with fewer bones are padded with bones of zero length, which have no weight.
    """

    def __init__(self, skeleton: Skeleton, offsets: Array, bodies: Mapping[int, tuple[int, ...]]) -> None:
        most = max(len(points) for points in bodies.values())
        filled = {j: (*points, *[j] * (most - len(points))) for j, points in bodies.items()}
        self.joints = np.array(list(filled))  # (B,)
        self._points = np.array(list(filled.values()))  # (B, K)
        rest = np.stack([rest_vectors(skeleton, offsets, j, points) for j, points in filled.items()])
        self._davenport = _Davenport(rest)
        self.children = [j for j, p in enumerate(skeleton.parents) if p in bodies]  # C of them
        self._carriers = np.array([list(filled).index(skeleton.parents[j]) for j in self.children])  # (C,)
        self._offsets = offsets[None, self.children]  # (1, C, 3)

    def fit(self, joints: Array) -> Array:
        """Return the best rotations (T, B, 4), in any sign: bones of the T-pose onto those of joints (T, J, 3)."""
        return self._davenport.fit(joints.take(self._points, 1) - joints.take(self.joints, 1)[:, :, None])

    def carry(self, joints: Array) -> Array:
        """Return bones (T, C, 3) from bodies to their children, rotated by the bodies' best fit to joints (T, J, 3)."""
        return rotate(self.fit(joints).take(self._carriers, 1), self._offsets)


def fit_rotation(rest: Array, seen: Array) -> Array:
    """Return the rotation that best turns one set of vectors into another, in the least-squares sense.

    Where the vectors leave a rotation open (all on one line) the smaller one is chosen, by a prior of a billionth.

    Args:
        rest: (K, 3). seen: (T, K, 3).

    Returns:
        (T, 4), in any sign.
    """
    return _Davenport(rest).fit(seen)


class _Davenport:
    """Davenport's q-method: the eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix.

    The matrix is linear in the observed vectors, so the factors of their coordinates are computed once.

    Args:
        rest: (..., K, 3).
    """

    def __init__(self, rest: Array) -> None:
        parts = _symmetric(np.eye(9).reshape(3, 3, 3, 3)).reshape(3, 3, 16)
        self.parts = np.einsum("...kj,ijn->...kin", rest, parts).reshape(*rest.shape[:-2], -1, 16)  # (..., 3 K, 16)
        least = 1e-9 * np.maximum(np.einsum("...ki,...ki->...", rest, rest), 1e-12)
        self.prior = least[..., None, None] * _symmetric(np.eye(3)).reshape(1, 16)  # (..., 1, 16)

    def fit(self, seen: Array) -> Array:
        """Return rotations (T, ..., 4) for vectors (T, ..., K, 3)."""
        shape = seen.shape[:-2]
        matrix = seen.reshape(*shape, 1, -1) @ self.parts + self.prior  # a product for each row: no sum over rows
        return np.linalg.eigh(matrix.reshape(*shape, 4, 4))[1][..., -1]


def _symmetric(b: Array) -> Array:
    """Return Davenport's matrices (..., 4, 4) of sums (..., 3, 3) of products seen x rest."""
    k = np.empty((*b.shape[:-2], 4, 4))
    trace = np.einsum("...ii->...", b)
    k[..., 1:, 1:] = b + np.swapaxes(b, -1, -2) - trace[..., None, None] * np.eye(3)
    k[..., 0, 0] = trace
    for i, (row, column) in enumerate(((2, 1), (0, 2), (1, 0)), start=1):
        k[..., 0, i] = k[..., i, 0] = b[..., row, column] - b[..., column, row]
    return k


def rest_vectors(skeleton: Skeleton, offsets: Array, j: int, points: tuple[int, ...]) -> Array:
    """Return vectors (K, 3) from joint j to its descendants in the T-pose."""
    return np.stack([_rest_vector(skeleton, offsets, j, k) for k in points])


def _rest_vector(skeleton: Skeleton, offsets: Array, j: int, k: int) -> Array:
    """Return the vector (3,) from joint j to its descendant k in the T-pose."""
    vector = np.zeros(3)
    while k != j:
        vector, k = vector + offsets[k], skeleton.parents[k]
    return vector


def bodies_of(skeleton: Skeleton) -> dict[int, tuple[int, ...]]:
    """Return joints with several bones, and their ends; a child at no distance (SnapMoGen's pelvis) is the same
    body."""
    lengths = np.linalg.norm(skeleton.offsets, axis=-1)

    def points(j: int) -> tuple[int, ...]:
        found: list[int] = []
        for child in skeleton.children[j]:
            found.extend((child,) if lengths[child] > 1e-6 else points(child))
        return tuple(found)

    every = {j: points(j) for j in range(len(skeleton)) if j == 0 or lengths[j] > 1e-6}
    return {j: found for j, found in every.items() if len(found) > 1}
