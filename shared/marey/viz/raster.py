"""A small software renderer: round cones, orthographic, lit.

A body is a handful of round cones (two balls and the cone that touches both). Seen without perspective each has a
closed-form depth and normal per pixel (the quadric of Quílez, "Round cone - intersection", 2018), so a figure is
exact, needs no mesh and takes a few milliseconds.

View coordinates are pixels: x right, y DOWN, z towards the viewer.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
Depth = tuple[Floats, NDArray[np.bool_]]
"""Depth of each pixel of a window, and a mask of the pixels that show the surface."""
Window = tuple[slice, slice]

# Key light from the upper left in front, sky from above, a rim from behind: view coordinates, y down.
KEY = np.array([-0.45, -0.65, 0.61], np.float32)
RIM = np.array([0.75, -0.35, -0.55], np.float32)
AMBIENT, SKY, DIFFUSE, RIM_STRENGTH = 0.46, 0.16, 0.50, 0.35
EXPOSURE = 1.206
MIN_SLOPE = 1e-6
"""Below this value a ray counts as parallel to a flank."""


@dataclass(frozen=True)
class Camera:
    """An orthographic camera on a sphere around the figure.

    `azimuth` turns from +Z (the figure's front in frame 0) towards +X (its left); `elevation` looks down on it.
    Degrees.
    """

    azimuth: float = 32.0
    elevation: float = 14.0

    @cached_property
    def axes(self) -> Floats:
        """Return view axes x (right), y (down) and z (towards the viewer) in world axes, as rows (3, 3)."""
        azimuth, elevation = np.radians(self.azimuth), np.radians(self.elevation)
        right = np.array([np.cos(azimuth), 0.0, -np.sin(azimuth)])
        towards = np.array(
            [np.sin(azimuth) * np.cos(elevation), np.sin(elevation), np.cos(azimuth) * np.cos(elevation)]
        )
        return np.stack([right, -np.cross(towards, right), towards]).astype(np.float32)

    def project(self, points: NDArray[np.floating]) -> Floats:
        """Transform world points (..., 3) in metres to view axes (..., 3), still in metres."""
        return (points @ self.axes.T).astype(np.float32)


@dataclass(frozen=True)
class Shown:
    """The pixels that show a surface, and their colours: (N,), (N,) and (N, 3) sRGB bytes."""

    rows: NDArray[np.intp]
    columns: NDArray[np.intp]
    colours: NDArray[np.uint8]


def shade(ends: Floats, radii: Floats, colours: Floats, size: tuple[int, int]) -> Shown:
    """Draw round cones, nearest in front.

    The first pass keeps depth and number of the nearest surface for each pixel. Normals and light follow once for each
    pixel that shows a surface. (Draw large and shrink to smooth the edges.)

    Args:
        ends: (L, 2, 3) both ends of each cone, pixels.
        radii: (L, 2) radius at each end, pixels.
        colours: (L, 3) sRGB, 0 to 1.
        size: width and height in pixels.
    """
    surfaces: list[_Ball | _Flank] = []
    limbs: list[int] = []
    windows: list[Window] = []
    for limb, (cone, radius) in enumerate(zip(ends.astype(np.float64), radii.astype(np.float64), strict=True)):
        for surface in _surfaces(cone, radius):
            if (window := surface.window(size)) is not None:
                surfaces.append(surface)
                limbs.append(limb)
                windows.append(window)
    if not surfaces:
        return Shown(np.empty(0, np.intp), np.empty(0, np.intp), np.empty((0, 3), np.uint8))
    top, left = (min(window[axis].start for window in windows) for axis in (0, 1))
    bottom, right = (max(window[axis].stop for window in windows) for axis in (0, 1))
    depth = np.full((bottom - top, right - left), -np.inf, np.float32)
    owner = np.zeros(depth.shape, np.int32)
    y = np.arange(top, bottom, dtype=np.float32)[:, None] + np.float32(0.5)
    x = np.arange(left, right, dtype=np.float32) + np.float32(0.5)
    for number, (surface, window) in enumerate(zip(surfaces, windows, strict=True)):
        inner = slice(window[0].start - top, window[0].stop - top), slice(window[1].start - left, window[1].stop - left)
        for z, hit in surface.depths(x[inner[1]], y[inner[0]]):
            hit &= z > depth[inner]
            np.copyto(depth[inner], z, where=hit)
            np.copyto(owner[inner], number, where=hit)
    rows, columns = np.nonzero(depth > -np.inf)
    shown = owner[rows, columns]
    points = np.stack([x[columns], y[rows, 0], depth[rows, columns]]).T
    lit = _light(_normals(surfaces, shown, points), colours[np.array(limbs)[shown]])
    return Shown(rows + top, columns + left, lit)


@dataclass(frozen=True)
class _Ball:
    """One end of a round cone."""

    centre: NDArray[np.float64]
    radius: float

    def window(self, size: tuple[int, int]) -> Window | None:
        return _window(self.centre[None, :2], np.array([self.radius]), size)

    def depths(self, x: Floats, y: Floats) -> Iterator[Depth]:
        dx, dy = x - np.float32(self.centre[0]), y - np.float32(self.centre[1])
        height2 = (np.float32(self.radius**2) - dx * dx) - dy * dy
        hit = height2 > 0
        z = np.sqrt(np.maximum(height2, 0, out=height2), out=height2)
        yield z + np.float32(self.centre[2]), hit

    def slope(self) -> tuple[float, ...]:
        return *self.centre, 0.0, 0.0, 0.0, 1.0, 0.0


@dataclass(frozen=True)
class _Flank:
    """The cone that touches both balls: from `start`, in the direction of the unit vector `along`.

    Args:
        radii: of the balls.
        length: between their centres.
        taper: radius lost per pixel of length.
    """

    start: NDArray[np.float64]
    along: NDArray[np.float64]
    radii: NDArray[np.float64]
    length: float
    taper: float

    def window(self, size: tuple[int, int]) -> Window | None:
        return _window(np.stack([self.start, self.start + self.length * self.along])[:, :2], self.radii, size)

    def depths(self, x: Floats, y: Floats) -> Iterator[Depth]:
        """A quadratic in the depth along the ray (0, 0, -1) from the depth of the start: k2 d² + 2 k1 d + k0 = 0."""
        slant = 1 - self.taper**2
        k2 = np.float32(slant - self.along[2] ** 2)
        if abs(k2) < MIN_SLOPE:  # the balls' outline is the figure's
            return
        ux, uy, uz = self.along.astype(np.float32)
        dx, dy = x - np.float32(self.start[0]), y - np.float32(self.start[1])
        # The place along the axis of the surface point nearest to a point: `ahead` for the point at the start's depth.
        ahead = (ux * dx - np.float32(self.taper * self.radii[0])) + uy * dy
        k1 = uz * ahead
        k0 = np.float32(slant) * (dx * dx) + np.float32(slant) * (dy * dy - np.float32(self.radii[0] ** 2))
        k0 -= ahead * ahead
        k0 *= k2
        inside = k1 * k1
        inside -= k0
        outline = inside >= 0
        root = np.sqrt(np.maximum(inside, 0, out=inside), out=inside)
        # Seen along the axis from its thin end (k2 < 0) either root may be the visible one; the depth test decides.
        for signed in (-root,) if k2 > 0 else (-root, root):
            down = (signed - k1) / k2
            place = ahead - uz * down
            hit = outline & (place > 0)
            hit &= place < np.float32(self.length * slant)
            yield np.float32(self.start[2]) - down, hit

    def slope(self) -> tuple[float, ...]:
        return *self.start, *self.along, 1 - self.taper**2, self.taper * float(self.radii[0])


def _surfaces(ends: NDArray[np.float64], radii: NDArray[np.float64]) -> Iterator[_Ball | _Flank]:
    """Return both balls and the flank between them."""
    for end, radius in zip(ends, radii, strict=True):
        yield _Ball(end, float(radius))
    axis, taper = ends[1] - ends[0], float(radii[0] - radii[1])
    length = float(np.sqrt(axis @ axis))
    if length * length - taper * taper > 1e-6:  # else one ball contains the other
        yield _Flank(ends[0], axis / length, radii, length, taper / length)


def _window(ends: NDArray[np.float64], radii: NDArray[np.float64], size: tuple[int, int]) -> Window | None:
    """Return the rows and columns that balls of these centres (2D) and radii cover; None outside the picture."""
    left, top = (max(floor(min(low)), 0) for low in (ends - radii[:, None]).T.tolist())
    right, bottom = (
        min(ceil(max(high)), most) for high, most in zip((ends + radii[:, None]).T.tolist(), size, strict=True)
    )
    return (slice(top, bottom), slice(left, right)) if left < right and top < bottom else None


def _normals(surfaces: list[_Ball | _Flank], shown: NDArray[np.int32], points: Floats) -> Floats:
    """Return unit normals at points (N, 3) on the surfaces `shown` (N)."""
    # Components in the first axis: contiguous, half the time.
    slopes = np.array([surface.slope() for surface in surfaces], np.float32).T.take(shown, axis=1)  # (8, N)
    away, along = points.T - slopes[:3], slopes[3:6]
    place = away[0] * along[0] + away[1] * along[1] + away[2] * along[2] - slopes[7]
    normals = away * slopes[6] - along * place
    squared = normals[0] ** 2 + normals[1] ** 2 + normals[2] ** 2
    return (normals / np.maximum(np.sqrt(squared), 1e-6)).T


def _light(normals: Floats, colours: Floats) -> NDArray[np.uint8]:
    """Return sRGB colours of points with these unit normals and colours, (N, 3)."""
    wrapped = np.clip(normals @ (KEY / np.linalg.norm(KEY)) * 0.75 + 0.25, 0, 1)  # wrap light: soft, like clay
    rim = np.clip(normals @ (RIM / np.linalg.norm(RIM)), 0, 1) ** 2
    lit = AMBIENT + SKY * np.clip(-normals[:, 1], -0.6, 1) + DIFFUSE * wrapped
    shaded = colours * (EXPOSURE * lit)[:, None] + (RIM_STRENGTH * rim * (1 - normals[:, 2]))[:, None]
    return (np.clip(shaded, 0, 1) * 255 + 0.5).astype(np.uint8)
