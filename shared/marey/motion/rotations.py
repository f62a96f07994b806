"""Rotations on arrays: unit quaternions `w x y z` in the last axis, matrices, 6D, Euler angles.

Everything broadcasts over leading axes and is vectorized; nothing here loops over frames. Rotations are active: they
turn vectors, and `multiply(a, b)` turns by `b` first.

Functions that a live stream calls for every frame work on components in the first axis, each contiguous in memory: the
same arithmetic in half the numpy calls, which are the whole cost of a single frame. Sums over components are written
out in order, so that no bit of a row depends on the number of rows.
"""

from __future__ import annotations

from functools import reduce
from operator import add
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating[Any]]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
Z_TO_Y = np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0, 0.0])
"""From Z up to Y up: a quarter turn about X."""
AXES = "XYZ"
_TINY = 1e-12
_YZX = np.array([1, 2, 0])
# Where the products of the units i, j and k with a quaternion, before it and after it, find their components in
# `w x y z -w -x -y -z`.
_BEFORE = np.array([5, 0, 7, 2]), np.array([6, 3, 0, 5]), np.array([7, 6, 1, 0])
_AFTER = np.array([5, 0, 3, 6]), np.array([6, 7, 0, 1]), np.array([7, 2, 5, 0])


def dot(a: Array, b: Array) -> Array:
    """Return the scalar product (...) along the last axis; leading axes broadcast."""
    return _dot(*_components(a, b)).T


def length(vectors: Array) -> Array:
    """Return the Euclidean length (...) along the last axis."""
    return _length(np.ascontiguousarray(vectors.T)).T


def normalize(vectors: Array) -> Array:
    """Scale to unit length along the last axis; a zero vector stays zero."""
    return _unit(np.ascontiguousarray(vectors.T)).T


def multiply(a: Array, b: Array) -> Array:
    """Return the Hamilton product (..., 4): the rotation that turns by `b`, then by `a`."""
    a, b = _components(a, b)
    return (a[0] * b + _along(a[1:], b, _BEFORE)).T


def conjugate(q: Array) -> Array:
    """Return the inverse of unit quaternions (..., 4)."""
    return q * np.array([1, -1, -1, -1], q.dtype)


def cross(a: Array, b: Array) -> Array:
    """Return the cross product along the last axis; several times as fast as numpy.cross on small arrays."""
    return _cross(*_components(a, b)).T


def rotate(q: Array, v: Array) -> Array:
    """Turn vectors (..., 3) by unit quaternions (..., 4); leading axes broadcast."""
    q, v = _components(q, v)
    twice = 2.0 * _cross(q[1:], v)
    return (v + q[0] * twice + _cross(q[1:], twice)).T


def between(a: Array, b: Array) -> Array:
    """Return the shortest rotation (..., 4) that turns the direction of `a` to that of `b`.

    Opposite directions turn by half a turn about an axis perpendicular to `a`.
    """
    a, b = _components(a, b)
    a, b = _unit(a), _unit(b)
    w, xyz = 1.0 + _dot(a, b), _cross(a, b)
    opposite = w < 1e-9
    if np.count_nonzero(opposite):
        a = np.broadcast_to(a, xyz.shape)
        least = np.eye(3)[:, np.argmin(np.abs(a), axis=0)]
        w, xyz = np.where(opposite, 0.0, w), np.where(opposite, _unit(_cross(a, least)), xyz)
    return _unit(np.concatenate([w[None], xyz])).T


def aimed(q: Array, bone: Array, aim: Array) -> Array:
    """Turn rotations (..., 4) the shortest way until they take a bone to the direction of an aim.

    This equals `multiply(between(rotate(q, bone), aim), q)` in half the time. With half a turn about the bone before it
    and half a turn about the aim after it, a rotation takes the bone as far beyond the aim as it was before; the result
    lies in the middle between the two, which are q and -aim q bone as quaternions.

    Args:
        q: (..., 4).
        bone: (..., 3) of length one; with as many axes as q, as is the aim.
        aim: (..., 3) of any length; a zero aim turns nothing.
    """
    before, bones = _components(q, bone)
    aims = _unit(np.ascontiguousarray(aim.T))
    twice = before - _along(bones, _along(aims, before, _BEFORE), _AFTER)
    squared = _dot(twice, twice)  # 2 + 2 cos of the way, or 1 without an aim
    turned = (twice / np.sqrt(np.maximum(squared, _TINY))).T
    opposite = squared < 2e-9
    if np.count_nonzero(opposite):
        return np.where(opposite.T[..., None], multiply(between(rotate(q, bone), aim), q), turned)
    return turned


def _along(v: Array, q: Array, order: tuple[NDArray[np.intp], ...]) -> Array:
    """Return the product of vectors (3, ...) with quaternions (4, ...), `_BEFORE` or `_AFTER` them."""
    i, j, k = order
    signed = np.concatenate([q, -q])
    return v[0] * signed.take(i, 0) + v[1] * signed.take(j, 0) + v[2] * signed.take(k, 0)


def _components(a: Array, b: Array) -> tuple[Array, Array]:
    """Return both with components in the first axis and the others reversed, of one rank, so that they broadcast."""
    if a.ndim != b.ndim:
        rank = max(a.ndim, b.ndim)
        a, b = (v.reshape((1,) * (rank - v.ndim) + v.shape) for v in (a, b))
    return np.ascontiguousarray(a.T), np.ascontiguousarray(b.T)


def _dot(a: Array, b: Array) -> Array:
    return reduce(add, a * b)


def _length(v: Array) -> Array:
    return np.sqrt(_dot(v, v))


def _unit(v: Array) -> Array:
    return v / np.maximum(_length(v), _TINY)


def _cross(a: Array, b: Array) -> Array:
    return (a * b.take(_YZX, 0) - a.take(_YZX, 0) * b).take(_YZX, 0)


def about(axis: str, angle: ArrayLike) -> Array:
    """Return quaternions (..., 4) that turn by `angle` radians about one of the axes X, Y, Z."""
    half = np.asarray(angle, np.float64) / 2
    q = np.zeros((*half.shape, 4))
    q[..., 0] = np.cos(half)
    q[..., 1 + AXES.index(axis.upper())] = np.sin(half)
    return q


def from_rotvec(vectors: Array) -> Array:
    """Return quaternions (..., 4) of rotation vectors (..., 3): axis times radians."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


def to_rotvec(q: Array) -> Array:
    """Return rotation vectors (..., 3), at most half a turn long, of unit quaternions (..., 4)."""
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, _TINY), 2.0)


def angle_between(a: Array, b: Array) -> Array:
    """Return the angle in radians (...) from rotation `a` to rotation `b`, 0 to pi."""
    difference = multiply(conjugate(a), b)
    return 2 * np.arctan2(np.linalg.norm(difference[..., 1:], axis=-1), np.abs(difference[..., 0]))


def unroll(q: Array, axis: int = 0) -> Array:
    """Choose the sign of each quaternion so that neighbours along `axis` are on the same side."""
    q = np.moveaxis(np.array(q), axis, 0)
    dots = np.einsum("t...i,t...i->t...", q[1:], q[:-1])
    signs = np.cumprod(np.where(dots < 0, -1.0, 1.0), axis=0).astype(q.dtype)
    q[1:] *= signs[..., None]
    return np.moveaxis(q, 0, axis)


def slerp(a: Array, b: Array, t: Array) -> Array:
    """Interpolate spherically (..., 4) from `a` (t = 0) to `b` (t = 1), the shorter way; `t` broadcasts as (...)."""
    cosine = dot(a, b)
    b = np.where(cosine[..., None] < 0, -b, b)
    theta = np.arccos(np.clip(np.abs(cosine), -1.0, 1.0))
    sine = np.sin(theta)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    wa = np.where(near, 1.0 - t, np.sin((1.0 - t) * theta) / safe)
    wb = np.where(near, t, np.sin(t * theta) / safe)
    return normalize(wa[..., None] * a + wb[..., None] * b)


def to_matrix(q: Array) -> Array:
    """Return rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = q[..., 0], q[..., 1], q[..., 2], q[..., 3]
    m = np.empty((*q.shape[:-1], 3, 3), q.dtype)
    m[..., 0, 0] = 1 - 2 * (y * y + z * z)
    m[..., 0, 1] = 2 * (x * y - w * z)
    m[..., 0, 2] = 2 * (x * z + w * y)
    m[..., 1, 0] = 2 * (x * y + w * z)
    m[..., 1, 1] = 1 - 2 * (x * x + z * z)
    m[..., 1, 2] = 2 * (y * z - w * x)
    m[..., 2, 0] = 2 * (x * z - w * y)
    m[..., 2, 1] = 2 * (y * z + w * x)
    m[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return m


def from_matrix(m: Array) -> Array:
    """Return unit quaternions (..., 4) of rotation matrices (..., 3, 3), by the largest component (Shepperd 1978)."""
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    squares = np.stack([1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz], axis=-1)
    wx, wy, wz = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    rows = np.stack(
        [
            np.stack([squares[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, squares[..., 1], xy, xz], axis=-1),
            np.stack([wy, xy, squares[..., 2], yz], axis=-1),
            np.stack([wz, xz, yz, squares[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(squares, axis=-1)
    return normalize(np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :])


def to_6d(q: Array) -> Array:
    """Return the first two columns of the rotation matrix, concatenated (..., 6) (Zhou et al. 2019)."""
    m = to_matrix(q)
    return np.concatenate([m[..., :, 0], m[..., :, 1]], axis=-1)


def from_6d(d: Array) -> Array:
    """Return quaternions (..., 4) of 6D rotations: x = norm(a), z = norm(a x b), y = z x x."""
    x = normalize(d[..., :3])
    z = normalize(cross(x, d[..., 3:]))
    return from_matrix(np.stack([x, cross(z, x), z], axis=-1))


def from_euler(angles: Array, order: str) -> Array:
    """Return quaternions (..., 4) of Euler angles in degrees (..., n), given in the order in which their axes are
    named.

    `order` is as in a BVH file, `ZXY` for instance: the first axis is the outermost, R = Rz Rx Ry. It may name any
    number of axes, including none.
    """
    half = np.radians(np.asarray(angles, np.float64)) / 2
    cos, sin = np.cos(half), np.sin(half)
    q = np.broadcast_to(IDENTITY, (*half.shape[:-1], 4))
    for k, axis in enumerate(order):
        # q * (c + s e): the unit axis e only permutes the components of q and changes signs
        x = AXES.index(axis)
        y, z = 1 + (x + 1) % 3, 1 + (x + 2) % 3
        x += 1
        turned = np.empty(q.shape)
        turned[..., 0] = -q[..., x]
        turned[..., x] = q[..., 0]
        turned[..., y] = q[..., z]
        turned[..., z] = -q[..., y]
        q = cos[..., k, None] * q + sin[..., k, None] * turned
    return q


def to_euler(q: Array, order: str) -> Array:
    """Return Euler angles in degrees (..., 3) of unit quaternions, in the order of `order` (see `from_euler`); the
    middle one lies in -90 to 90. At the gimbal lock the last angle is zero."""
    i, j, k = (AXES.index(a) for a in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    m = to_matrix(np.asarray(q, np.float64))
    sine = np.clip(sign * m[..., i, k], -1.0, 1.0)
    middle = np.arctan2(sine, np.hypot(m[..., i, i], m[..., i, j]))
    locked = np.abs(sine) > 1 - 1e-12
    first = np.arctan2(-sign * m[..., j, k], m[..., k, k])
    last = np.arctan2(-sign * m[..., i, j], m[..., i, i])
    first = np.where(locked, np.arctan2(sign * m[..., k, j], m[..., j, j]), first)
    last = np.where(locked, 0.0, last)
    return np.degrees(np.stack([first, middle, last], axis=-1))


def continuous_euler(angles: Array) -> Array:
    """Choose the Tait-Bryan triples nearest to the frame before, among (a, b, c), (a + 180, 180 - b, c + 180) and full
    turns.

    Args:
        angles: (T, ..., 3) degrees.
    """
    other = np.stack([angles[..., 0] + 180, 180 - angles[..., 1], angles[..., 2] + 180], axis=-1)

    def distance(a: Array, b: Array) -> Array:
        return np.abs((a - b + 180) % 360 - 180).sum(axis=-1)

    # Changing sides between two frames depends on those two alone, so the side is a running parity.
    change = distance(other[1:], angles[:-1]) < distance(angles[1:], angles[:-1])
    side = np.concatenate([np.zeros((1, *change.shape[1:]), bool), np.cumsum(change, axis=0) % 2 == 1])
    return np.unwrap(np.where(side[..., None], other, angles), period=360, axis=0)
