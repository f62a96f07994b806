"""Rotations on arrays: unit quaternions `w x y z` in the last axis, matrices, 6D, Euler angles.

Everything broadcasts over leading axes and is vectorized; nothing here loops over frames. Rotations are active: they
turn vectors, and `multiply(a, b)` turns by `b` first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating[Any]]

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
AXES = "XYZ"
_TINY = 1e-12


def normalize(vectors: Array) -> Array:
    """Scale to unit length along the last axis; a zero vector stays zero."""
    length = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return vectors / np.maximum(length, _TINY)


def multiply(a: Array, b: Array) -> Array:
    """Hamilton product (..., 4): the rotation that turns by `b`, then by `a`."""
    aw, ax, ay, az = a[..., 0], a[..., 1], a[..., 2], a[..., 3]
    bw, bx, by, bz = b[..., 0], b[..., 1], b[..., 2], b[..., 3]
    w = aw * bw - ax * bx - ay * by - az * bz
    product = np.empty((*w.shape, 4), w.dtype)  # np.stack takes longer than the arithmetic of a single frame
    product[..., 0] = w
    product[..., 1] = aw * bx + ax * bw + ay * bz - az * by
    product[..., 2] = aw * by - ax * bz + ay * bw + az * bx
    product[..., 3] = aw * bz + ax * by - ay * bx + az * bw
    return product


def conjugate(q: Array) -> Array:
    """The inverse of unit quaternions (..., 4)."""
    return q * np.array([1, -1, -1, -1], q.dtype)


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis; several times as fast as numpy.cross on small arrays."""
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    x = ay * bz - az * by
    product = np.empty((*x.shape, 3), x.dtype)
    product[..., 0] = x
    product[..., 1] = az * bx - ax * bz
    product[..., 2] = ax * by - ay * bx
    return product


def rotate(q: Array, v: Array) -> Array:
    """Turn vectors (..., 3) by unit quaternions (..., 4); leading axes broadcast."""
    twice = 2.0 * cross(q[..., 1:], v)
    return v + q[..., :1] * twice + cross(q[..., 1:], twice)


def between(a: Array, b: Array) -> Array:
    """The shortest rotation (..., 4) that turns the direction of `a` to that of `b`.

    Opposite directions turn by half a turn about an axis square to `a`.
    """
    a, b = normalize(a), normalize(b)
    w = 1.0 + np.einsum("...i,...i->...", a, b)
    xyz = cross(a, b)
    opposite = w < 1e-9
    if opposite.any():
        least = np.eye(3)[np.argmin(np.abs(np.broadcast_to(a, xyz.shape)), axis=-1)]
        xyz = np.where(opposite[..., None], normalize(cross(np.broadcast_to(a, xyz.shape), least)), xyz)
        w = np.where(opposite, 0.0, w)
    return normalize(np.concatenate([w[..., None], xyz], axis=-1))


def about(axis: str, angle: ArrayLike) -> Array:
    """Quaternions (..., 4) that turn by `angle` radians about one of the axes X, Y, Z."""
    half = np.asarray(angle, np.float64) / 2
    q = np.zeros((*half.shape, 4))
    q[..., 0] = np.cos(half)
    q[..., 1 + AXES.index(axis.upper())] = np.sin(half)
    return q


def from_rotvec(vectors: Array) -> Array:
    """Quaternions (..., 4) of rotation vectors (..., 3): axis times radians."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * vectors], axis=-1)


def to_rotvec(q: Array) -> Array:
    """Rotation vectors (..., 3), at most half a turn long."""
    q = np.where(q[..., :1] < 0, -q, q)
    sine = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(sine, q[..., :1])
    return q[..., 1:] * np.where(sine > 1e-9, angle / np.maximum(sine, _TINY), 2.0)


def angle_between(a: Array, b: Array) -> Array:
    """The angle in radians (...) from rotation `a` to rotation `b`, 0 to pi."""
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
    """Spherical interpolation (..., 4) from `a` (t = 0) to `b` (t = 1), the shorter way; `t` broadcasts as (...)."""
    dot = np.einsum("...i,...i->...", a, b)
    b = np.where(dot[..., None] < 0, -b, b)
    theta = np.arccos(np.clip(np.abs(dot), -1.0, 1.0))
    sine = np.sin(theta)
    near = sine < 1e-6
    safe = np.where(near, 1.0, sine)
    wa = np.where(near, 1.0 - t, np.sin((1.0 - t) * theta) / safe)
    wb = np.where(near, t, np.sin(t * theta) / safe)
    return normalize(wa[..., None] * a + wb[..., None] * b)


def to_matrix(q: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4)."""
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
    """Unit quaternions (..., 4) of rotation matrices (..., 3, 3), by the largest component (Shepperd 1978)."""
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
    """The first two columns of the rotation matrix, end to end (..., 6) (Zhou et al. 2019)."""
    m = to_matrix(q)
    return np.concatenate([m[..., :, 0], m[..., :, 1]], axis=-1)


def from_6d(d: Array) -> Array:
    """Quaternions (..., 4) of 6D rotations: x = norm(a), z = norm(a x b), y = z x x."""
    x = normalize(d[..., :3])
    z = normalize(cross(x, d[..., 3:]))
    return from_matrix(np.stack([x, cross(z, x), z], axis=-1))


def from_euler(angles: Array, order: str) -> Array:
    """Quaternions (..., 4) of Euler angles in degrees (..., n), given in the order their axes are named.

    `order` is as in a BVH file, `ZXY` for instance: the first axis is the outermost, R = Rz Rx Ry. It may name any
    number of axes, also none.
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
    """Euler angles in degrees (..., 3) of unit quaternions, in the order of `order` (see `from_euler`); the middle one
    lies in -90 to 90. At the gimbal lock the last angle is zero."""
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
    """Of each pair of equivalent Tait-Bryan triples (a, b, c) and (a + 180, 180 - b, c + 180), and of all full turns,
    take the one nearest to the frame before (axis 0), so that a program that interpolates channels sees no jump.

    Args:
        angles: (T, ..., 3) degrees.
    """
    other = np.stack([angles[..., 0] + 180, 180 - angles[..., 1], angles[..., 2] + 180], axis=-1)

    def distance(a: Array, b: Array) -> Array:
        return np.abs((a - b + 180) % 360 - 180).sum(axis=-1)

    # Whether to change sides between two frames depends on those two alone, so the side is a running parity.
    change = distance(other[1:], angles[:-1]) < distance(angles[1:], angles[:-1])
    side = np.concatenate([np.zeros((1, *change.shape[1:]), bool), np.cumsum(change, axis=0) % 2 == 1])
    return np.unwrap(np.where(side[..., None], other, angles), period=360, axis=0)
