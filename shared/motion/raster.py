"""A small software renderer: round cones, orthographic, lit.

A body is a handful of round cones (two balls and the cone that touches both). Seen without perspective each has a
closed-form depth and normal per pixel (the quadric of Quílez, "Round cone - intersection", 2018), so a figure is
exact, needs no mesh and takes a few milliseconds.

View coordinates are pixels: x right, y DOWN, z towards the viewer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]

# Key light from the upper left in front, sky from above, a rim from behind: view coordinates, y down.
KEY = np.array([-0.45, -0.65, 0.61], np.float32)
RIM = np.array([0.75, -0.35, -0.55], np.float32)
AMBIENT, SKY, DIFFUSE, RIM_STRENGTH = 0.46, 0.16, 0.50, 0.35


@dataclass(frozen=True)
class Camera:
    """An orthographic camera on a sphere around the figure.

    `azimuth` turns from +Z (the figure's front in frame 0) towards +X (its left); `elevation` looks down on it.
    Degrees.
    """

    azimuth: float = 32.0
    elevation: float = 14.0

    def axes(self) -> Floats:
        """Rows are the view's x (right), y (down) and z (towards the viewer) in world axes, (3, 3)."""
        azimuth, elevation = np.radians(self.azimuth), np.radians(self.elevation)
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        towards = np.array(
            [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
        )
        return np.stack([right, -np.cross(towards, right), towards]).astype(np.float32)

    def project(self, points: NDArray[np.floating]) -> Floats:
        """World points (..., 3) in metres to view axes (..., 3), still in metres."""
        return (points @ self.axes().T).astype(np.float32)


def shade(ends: Floats, radii: Floats, colours: Floats, size: tuple[int, int]) -> NDArray[np.uint8]:
    """Draw round cones, nearest in front.

    Args:
        ends: (L, 2, 3) both ends of each cone, pixels.
        radii: (L, 2) radius at each end, pixels.
        colours: (L, 3) sRGB, 0 to 1.
        size: width and height in pixels.

    Returns:
        (height, width, 4) RGBA, straight alpha; alpha is 0 or 255 (draw large and shrink to smooth the edges).
    """
    width, height = size
    depth = np.full((height, width), -np.inf, np.float32)
    normals = np.zeros((height, width, 3), np.float32)
    owner = np.zeros((height, width), np.int32)
    for index, (cone, radius) in enumerate(zip(ends, radii, strict=True)):
        window = _window(cone, radius, size)
        if window is None:
            continue
        rows, columns = window
        y, x = np.mgrid[rows, columns].astype(np.float32) + np.float32(0.5)
        for z, normal in _surfaces(cone, radius, x, y):
            front = z > depth[rows, columns]
            depth[rows, columns][front] = z[front]
            normals[rows, columns][front] = normal[front]
            owner[rows, columns][front] = index
    return _light(depth, normals, colours[owner] if len(colours) else normals)


def _window(cone: Floats, radius: Floats, size: tuple[int, int]) -> tuple[slice, slice] | None:
    reach = radius[:, None]
    low = np.floor((cone[:, :2] - reach).min(axis=0)).astype(int)
    high = np.ceil((cone[:, :2] + reach).max(axis=0)).astype(int)
    left, top = max(low[0], 0), max(low[1], 0)
    right, bottom = min(high[0], size[0]), min(high[1], size[1])
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def _surfaces(cone: Floats, radius: Floats, x: Floats, y: Floats) -> list[tuple[Floats, Floats]]:
    """Depth (-inf where missed) and unnormalized normal of each ball and of the cone between, over the window."""
    found = [_ball(end, r, x, y) for end, r in zip(cone, radius, strict=True)]
    (a, b), (ra, rb) = cone.astype(np.float64), radius.astype(np.float64)
    axis, taper = b - a, ra - rb
    length2 = axis @ axis
    slant2 = length2 - taper * taper
    if slant2 > 1e-6:  # else one ball swallows the other
        found += _flank(a, axis, ra, taper, slant2, x, y)
    return found


def _ball(centre: Floats, radius: np.float32, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    dx, dy = x - centre[0], y - centre[1]
    height2 = radius * radius - dx * dx - dy * dy
    rise = np.sqrt(np.maximum(height2, 0))
    z = np.where(height2 > 0, centre[2] + rise, -np.inf).astype(np.float32)
    return z, np.stack([dx, dy, rise], axis=-1)


def _flank(
    a: NDArray[np.float64], axis: NDArray[np.float64], ra: float, taper: float, slant2: float, x: Floats, y: Floats
) -> list[tuple[Floats, Floats]]:
    """The cone that touches both balls: a quadratic in the depth along the ray (0, 0, -1) from z = a_z."""
    dx, dy = x - a[0], y - a[1]
    along = axis[0] * dx + axis[1] * dy
    k2 = slant2 - axis[2] * axis[2]
    if abs(k2) < 1e-6:  # the ray runs along the flank: the balls' outline is the figure's
        return []
    k1 = axis[2] * (along - taper * ra)
    k0 = slant2 * (dx * dx + dy * dy) - along * along + 2 * along * taper * ra - (axis @ axis) * ra * ra
    inside = k1 * k1 - k0 * k2
    root = np.sqrt(np.maximum(inside, 0))
    found: list[tuple[Floats, Floats]] = []
    # Seen along the axis from its thin end (k2 < 0) either root may be the visible one; the depth test decides.
    for sign in (-1.0,) if k2 > 0 else (-1.0, 1.0):
        down = (sign * root - k1) / k2
        foot = along - ra * taper - down * axis[2]
        hit = (inside >= 0) & (foot > 0) & (foot < slant2)
        z = np.where(hit, a[2] - down, -np.inf).astype(np.float32)
        normal = np.stack([dx, dy, -down], axis=-1) * slant2 - axis * foot[..., None]
        found.append((z, normal.astype(np.float32)))
    return found


def _light(depth: Floats, normals: Floats, colours: Floats) -> NDArray[np.uint8]:
    solid = np.isfinite(depth)
    image = np.zeros((*depth.shape, 4), np.uint8)
    normal, colour = normals[solid], colours[solid]
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
    wrapped = np.clip(normal @ (KEY / np.linalg.norm(KEY)) * 0.75 + 0.25, 0, 1)  # wrap light: soft, like clay
    rim = np.clip(normal @ (RIM / np.linalg.norm(RIM)), 0, 1) ** 2
    lit = AMBIENT + SKY * np.clip(-normal[:, 1], -0.6, 1) + DIFFUSE * wrapped
    shaded = colour**1.6 * lit[:, None] ** 1.6 * 1.35  # in roughly linear light, so that colours keep their hue
    shaded = shaded ** (1 / 1.6) + (RIM_STRENGTH * rim * (1 - normal[:, 2]))[:, None]
    image[solid, :3] = (np.clip(shaded, 0, 1) * 255 + 0.5).astype(np.uint8)
    image[solid, 3] = 255
    return image
