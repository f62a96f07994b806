"""Spines and necks with different numbers of joints: places along them, and turns shared out by place."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from marey.motion.rigs.body import RigBody
from marey.motion.rotations import Array, normalize


def spans(body: RigBody, chain: Sequence[int], end: Array) -> Array:
    """Return the beginning and end (n, 2) of each bone of a chain, as shares of its length; the last bone ends at a
    place (3,) of the upright rest pose."""
    points: Array = np.concatenate([body.places[list(chain)], end[None]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=-1)
    ends = np.concatenate([[0.0], np.cumsum(lengths)]) / max(float(lengths.sum()), 1e-9)
    return np.stack([ends[:-1], ends[1:]], axis=-1)


def shares(target: Array, source: Array) -> Array:
    """Return the share (n, m) of each of m source bones in each of n target bones; rows sum to 1.

    Args:
        target, source: spans (n, 2) and (m, 2) of bones along one chain.
    """
    overlap = np.minimum(target[:, None, 1], source[None, :, 1]) - np.maximum(target[:, None, 0], source[None, :, 0])
    overlap = np.maximum(overlap, 0.0)
    points = target.mean(axis=1)
    holds = np.array([min(int((source[:, 1] < point).sum()), len(source) - 1) for point in points], np.intp)
    empty = overlap.sum(axis=1) < 1e-6
    overlap[empty, holds[empty]] = 1.0
    return overlap / overlap.sum(axis=1, keepdims=True)


def blend(turns: Sequence[Array], weights: Array) -> Array:
    """Return the weighted mean (T, 4) of rotations (T, 4) that are near each other; one of weight 1 is returned as it
    is."""
    used = [(turn, weight) for turn, weight in zip(turns, weights, strict=True) if weight > 1e-6]
    if len(used) == 1:
        return used[0][0]
    first = used[0][0]
    total = np.zeros_like(first)
    for turn, weight in used:
        sign = np.where(np.einsum("ti,ti->t", turn, first) < 0, -1.0, 1.0)
        total += weight * sign[:, None] * turn
    return normalize(total)


def along(body: RigBody, chain: Sequence[int], end: Array, places: Array) -> Array:
    """Return the points (n, 3) of a chain's upright rest pose at places (n,) from 0 to 1."""
    points = np.concatenate([body.places[list(chain)], end[None]])
    ends = np.concatenate([[0.0], spans(body, chain, end)[:, 1]])
    columns: list[Array] = [np.interp(places, ends, points[:, axis]) for axis in range(3)]
    return np.stack(columns, axis=-1)
