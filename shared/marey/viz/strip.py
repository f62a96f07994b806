"""Strip: poses of a clip over time, each on its own patch of the floor, with foot-contact tracks below.

The patch has a grid of half metres, fixed to the world, so that travel shows; the root's trail; the figure's shadow;
and highlights of feet in contact. Left is blue and right is orange everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import to_matrix
from marey.viz.body import BodyShape, dress_clip
from marey.viz.paper import Paper, Theme, blend
from marey.viz.raster import Camera, shade

SMOOTH = 2  # figures are drawn this much larger and shrunk
GRID = 0.5  # metres
MOST_LINES = 200
"""Lines of the grid in one direction: around a body whose unit is wrong, of a kilometre, they are farther apart."""
BLUR, SPREAD = 2.5, 10
"""Softness of a shadow, and how far it spreads by that: pixels."""
LIGHT = np.array([-0.22, 1.0, 0.34])  # direction to the light, world axes
SOFTENED = [int(v * 0.34) for v in range(256)]  # opacity of a shadow, from its mask

Projection = Callable[[NDArray[np.floating]], NDArray[np.floating]]
Size = tuple[int, int]


@dataclass(frozen=True)
class Strip:
    """The shown poses of a clip and their scale.

    Attributes:
        cell: width and height of one pose, pixels.
        limbs: (F, L, 2, 3) ends, metres; X and Z from the centre of the same pose.
        root: (T, 3) the whole trail.
        centre: (T, 3) the middle of each pose's patch of floor; Y is not used.
        scale: pixels a metre.
        below: pixels from the cell's bottom up to the floor point under the root.
    """

    clip: MotionClip
    frames: NDArray[np.intp]
    cell: Size
    body: BodyShape
    limbs: NDArray[np.float32]
    root: NDArray[np.float32]
    centre: NDArray[np.float32]
    scale: float
    below: float
    camera: Camera


def chosen_frames(clip: MotionClip, columns: int, frames: Sequence[int] | None = None) -> NDArray[np.intp]:
    """Choose evenly spaced frames from the first to the last, `columns` of them; or the given `frames`.

    Raises:
        InvalidInput: a frame is not in the clip, or there is none.
    """
    count = clip.frames
    if frames is None:
        return np.unique(np.linspace(0, count - 1, columns).round().astype(np.intp))
    wrong = [f for f in frames if not 0 <= f < count]
    if wrong or not frames:
        raise InvalidInput(f"frames {wrong} are not in a clip of {count} frames" if wrong else "no frames to draw")
    return np.array(frames, np.intp)


def make_strip(
    clip: MotionClip, frames: NDArray[np.intp], cell: Size, centre: NDArray[np.float32] | None = None
) -> Strip:
    """Choose a scale at which every pose of the clip fits its cell.

    Args:
        centre: (T, 3) the middle of each pose's patch of floor; None = under the root.

    Raises:
        InvalidInput: the skeleton is a single joint.
    """
    body, camera = dress_clip(clip), Camera()
    if not body.limbs:
        raise InvalidInput("has no bones that could be drawn", where=clip.skeleton.name)
    root = np.asarray(clip.joints[:, 0], np.float32)
    centre = root if centre is None else centre
    joints = np.asarray(clip.joints[frames], np.float64)
    axes = to_matrix(global_rotations(clip.skeleton, np.asarray(clip.rotations[frames], np.float64)))
    limbs = body.points(joints, axes)
    limbs[..., 0] -= centre[frames, None, None, 0]
    limbs[..., 2] -= centre[frames, None, None, 2]
    limbs[..., 1] += body.sole
    seen, reach = camera.project(limbs), body.radii()
    width, height = cell
    tilt = float(np.sin(np.radians(camera.elevation)))
    widest = float((np.abs(seen[..., 0]) + reach).max())
    # The floor patch fills the cell's width, so its lower edge is a fixed share of it below the floor point.
    below = 0.5 * width * tilt + 4
    lowest = max(float((seen[..., 1] + reach).max()), 0.02)
    highest = max(float((reach - seen[..., 1]).max()), 0.6 * body.height)
    scale = min((height - below - 8) / highest, (width / 2 - 3) / widest, below / lowest)
    return Strip(clip, frames, cell, body, limbs, root, centre, scale, below, camera)


def draw_pose(strip: Strip, column: int, theme: Theme) -> Image.Image:
    """Draw one pose on its patch of floor."""
    size = (strip.cell[0] * SMOOTH, strip.cell[1] * SMOOTH)
    scale = strip.scale * SMOOTH
    origin = np.array([size[0] / 2, size[1] - strip.below * SMOOTH, 0], np.float32)

    def pixels(points: NDArray[np.floating]) -> NDArray[np.float32]:
        return strip.camera.project(points) * scale + origin

    image = Image.new("RGB", size, theme.paper)
    rim = draw_patch(image, strip, int(strip.frames[column]), pixels, theme)
    image.paste(theme.shadow, mask=_shadow(strip, column, size, rim, pixels))
    colours = np.array([theme.parts[limb.part] for limb in strip.body.limbs]) / 255
    figure = shade(pixels(strip.limbs[column]), strip.body.radii() * scale, colours.astype(np.float32), size)
    canvas = np.array(image)
    canvas[figure.rows, figure.columns] = figure.colours
    return Image.fromarray(canvas).reduce(SMOOTH)


def draw_patch(
    image: Image.Image, strip: Strip, frame: int, pixels: Projection, theme: Theme
) -> list[tuple[float, float]]:
    """Draw a round piece of floor under one pose, with grid, trail and highlighted contacts; return its rim."""
    draw = ImageDraw.Draw(image)
    radius = (strip.cell[0] / 2 - 4) / strip.scale
    centre, rim = strip.centre[frame], view_points(pixels(_circle(radius)))
    draw.polygon(rim, fill=theme.floor)
    step = GRID * 2.0 ** max(math.ceil(math.log2(2 * radius / (GRID * MOST_LINES))), 0)
    for axis in (0, 2):
        first = np.ceil((centre[axis] - radius) / step) * step
        for at in np.arange(first, centre[axis] + radius, step) - centre[axis]:
            half = np.sqrt(max(radius**2 - at**2, 0))
            line = np.zeros((2, 3))
            line[:, axis], line[:, 2 - axis] = at, (-half, half)
            draw.line(view_points(pixels(line)), fill=theme.line, width=SMOOTH)
    trail = (strip.root - centre) * np.array([1, 0, 1])
    near = np.linalg.norm(trail, axis=-1) < radius
    points, later = view_points(pixels(trail)), blend(theme.floor, theme.muted, 0.35)
    for t in np.flatnonzero(near[:-1] & near[1:]):
        draw.line(points[t : t + 2], fill=theme.muted if t < frame else later, width=SMOOTH)
    _light_contacts(image, strip, frame, pixels, theme)
    return rim


def _light_contacts(image: Image.Image, strip: Strip, frame: int, pixels: Projection, theme: Theme) -> None:
    draw = ImageDraw.Draw(image)
    for foot, joint in enumerate(strip.clip.skeleton.feet):
        if not strip.clip.contacts[frame, foot]:
            continue
        centre = (strip.clip.joints[frame, joint] - strip.centre[frame]) * np.array([1, 0, 1])
        colour = theme.parts["left" if foot < 2 else "right"]
        draw.polygon(view_points(pixels(centre + _circle(0.085))), fill=blend(theme.floor, colour, 0.55))


def _shadow(
    strip: Strip, column: int, size: tuple[int, int], rim: list[tuple[float, float]], pixels: Projection
) -> Image.Image:
    """Return the mask of the figure's soft shadow on the patch of floor."""
    soft = soft_shadow(strip, column, lambda points: pixels(points) / SMOOTH)
    patch = Image.new("L", size)
    ImageDraw.Draw(patch).polygon(rim, fill=255)
    return ImageChops.multiply(soft.resize(size, Image.Resampling.BILINEAR), patch)


def soft_shadow(strip: Strip, column: int, pixels: Projection) -> Image.Image:
    """Return the mask of the figure's soft shadow, of the cell's size."""
    limbs = strip.limbs[column]
    ends = pixels(limbs - LIGHT / LIGHT[1] * np.maximum(limbs[..., 1:2], 0))
    radii = strip.body.radii() * strip.scale
    mask = Image.new("L", strip.cell)
    draw = ImageDraw.Draw(mask)
    for (a, b), reach in zip(ends[..., :2], radii, strict=True):
        draw.line([tuple(a), tuple(b)], fill=255, width=max(1, round(1.2 * float(reach.mean()))))
        for end, r in zip((a, b), reach, strict=True):
            draw.ellipse([end[0] - r, end[1] - 0.45 * r, end[0] + r, end[1] + 0.45 * r], fill=255)
    left, top, right, bottom = mask.getbbox() or (0, 0, 1, 1)
    box = (max(left - SPREAD, 0), max(top - SPREAD, 0), right + SPREAD, bottom + SPREAD)
    mask.paste(mask.crop(box).filter(ImageFilter.GaussianBlur(BLUR)).point(SOFTENED), box[:2])
    return mask


def draw_lanes(paper: Paper, strip: Strip, at: tuple[int, int], tall: int) -> None:
    """Draw foot contact over time, one track per side; full colour where both joints of a foot touch the floor."""
    if not strip.clip.skeleton.feet:
        return
    draw, theme = ImageDraw.Draw(paper.image), paper.theme
    count = strip.clip.frames
    left, right = at[0] + strip.cell[0] / 2, at[0] + (len(strip.frames) - 0.5) * strip.cell[0]
    across = np.interp(np.arange(count + 1) - 0.5, strip.frames, np.linspace(left, right, len(strip.frames)))
    for lane, side in enumerate(("left", "right")):
        y = at[1] + lane * (tall + 5)
        draw.rectangle([left, y, right, y + tall - 1], fill=theme.floor)
        paper.text((left - 9, y - 3), side[0].upper(), 11, theme.parts[side], align="right")
        down = strip.clip.contacts[:, 2 * lane : 2 * lane + 2].sum(axis=-1)
        for t in np.flatnonzero(down):
            colour = blend(theme.floor, theme.parts[side], (0.0, 0.5, 1.0)[int(down[t])])
            draw.rectangle([across[t], y, max(across[t + 1] - 1, across[t]), y + tall - 1], fill=colour)


@cache
def _unit_circle() -> NDArray[np.float64]:
    turn = np.linspace(0, 2 * np.pi, 73)
    return np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=-1)


def _circle(radius: float) -> NDArray[np.float64]:
    """Return points (73, 3) around the origin on the floor."""
    return radius * _unit_circle()


def view_points(view: NDArray[np.floating]) -> list[tuple[float, float]]:
    """Convert points in view coordinates to Pillow's form."""
    return [(x, y) for x, y in view[:, :2].tolist()]
