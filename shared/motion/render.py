"""Contact sheet: motion on one sheet of paper.

A clip is a strip of poses along time, each on its own patch of the floor (grid of half metres, fixed to the world, so
that travel shows), with the root's trail, its shadow and the feet that touch lit; beside it the path from above, under
it the lanes of foot contact. Left is blue and right is orange everywhere. Several clips are rows of one sheet.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw, ImageFilter

from shared.errors import InvalidInput
from shared.motion.body import Body, Part, dress_clip, forward_of
from shared.motion.clip import MotionClip
from shared.motion.files import write_atomically
from shared.motion.kinematics import facing, global_rotations
from shared.motion.paper import Paper, Theme, blend, theme_named
from shared.motion.raster import Camera, shade
from shared.motion.rotations import to_matrix

CELL = (196, 268)  # pixels a pose
PLAN = 232
MARGIN, GAP, LANE = 44, 34, 6
SMOOTH = 2  # figures are drawn this much larger and shrunk
GRID = 0.5  # metres
LIGHT = np.array([-0.22, 1.0, 0.34])  # where the sun stands, world axes
MOST_COLUMNS = 24
PLAN_SMOOTH = 3
LEGEND: tuple[tuple[Part, str], ...] = (("left", "left"), ("right", "right"))

Projection = Callable[[NDArray[np.floating]], NDArray[np.float32]]


@dataclass(frozen=True)
class _Strip:
    """What one row shows."""

    clip: MotionClip
    frames: NDArray[np.intp]
    caption: str
    body: Body
    limbs: NDArray[np.float32]  # (F, L, 2, 3) ends, metres; X and Z from the root of the same pose
    root: NDArray[np.float32]  # (T, 3) the whole trail
    scale: float  # pixels a metre
    below: float  # pixels from the cell's bottom up to the floor point under the root
    camera: Camera


def contact_sheet(
    clips: MotionClip | Sequence[MotionClip],
    path: str | Path,
    *,
    columns: int = 8,
    frames: Sequence[int] | None = None,
    title: str | None = None,
    captions: Sequence[str] | None = None,
    theme: str = "light",
) -> Path:
    """Draw clips as strips of poses into a PNG.

    Args:
        clips: one clip, or several, which become rows.
        path: the PNG to write.
        columns: poses a clip, evenly spaced from its first frame to its last.
        frames: these frames instead.
        title: a line at the top of the sheet.
        captions: one a clip; otherwise the prompt of its manifest.
        theme: `light` or `dark`.

    Returns:
        The path written.

    Raises:
        InvalidInput: nothing to draw, a frame that is not in the clip, an unknown theme, or a path that is not a
            writable PNG.
    """
    rows = [clips] if isinstance(clips, MotionClip) else list(clips)
    path = Path(path)
    if not rows:
        raise InvalidInput("there is no clip to draw", hint="Give at least one.")
    if path.suffix.lower() != ".png":
        raise InvalidInput(f"a contact sheet is a .png, not {path.suffix or 'a name without ending'}", where=str(path))
    if not 1 <= columns <= MOST_COLUMNS:
        raise InvalidInput(f"{columns} columns; a sheet takes 1 to {MOST_COLUMNS}")
    if captions is not None and len(captions) != len(rows):
        raise InvalidInput(f"{len(captions)} captions for {len(rows)} clips")
    strips = [
        _strip(clip, _chosen(clip, columns, frames), captions[row] if captions else caption_of(clip))
        for row, clip in enumerate(rows)
    ]
    image = _sheet(strips, title, theme_named(theme))
    buffer = io.BytesIO()
    image.save(buffer, format="PNG", compress_level=5)
    write_atomically(path, buffer.getvalue())
    return path


def caption_of(clip: MotionClip) -> str:
    """The prompt a clip was made from; empty when its manifest has none."""
    return str(clip.manifest.get("prompt") or "")


def facts_of(clip: MotionClip) -> str:
    """One line about a clip: length, rate, seed, model, terms, and whether a model without training made it."""
    facts = [f"{clip.seconds:.1f} s", f"{clip.frames} frames at {clip.fps:g} fps"]
    if clip.manifest.get("seed") is not None:
        facts.append(f"seed {clip.manifest['seed']}")
    facts += [str(clip.manifest[key]) for key in ("bundle", "licence") if clip.manifest.get(key)]
    if clip.manifest.get("random_weights"):
        facts.append("RANDOM WEIGHTS")
    return "  ·  ".join(facts)


def _chosen(clip: MotionClip, columns: int, frames: Sequence[int] | None) -> NDArray[np.intp]:
    count = clip.frames
    if frames is None:
        return np.unique(np.linspace(0, count - 1, columns).round().astype(np.intp))
    wrong = [f for f in frames if not 0 <= f < count]
    if wrong or not frames:
        raise InvalidInput(f"frames {wrong} are not in a clip of {count} frames" if wrong else "no frames to draw")
    return np.array(frames, np.intp)


def _strip(clip: MotionClip, frames: NDArray[np.intp], caption: str) -> _Strip:
    body, camera = dress_clip(clip), Camera()
    joints = np.asarray(clip.joints[frames], np.float64)
    axes = to_matrix(global_rotations(clip.skeleton, np.asarray(clip.rotations[frames], np.float64)))
    limbs = body.points(joints, axes)
    limbs[..., 0] -= joints[:, :1, None, 0]
    limbs[..., 2] -= joints[:, :1, None, 2]
    limbs[..., 1] += body.sole
    seen, reach = camera.project(limbs), body.radii()
    width, height = CELL
    tilt = float(np.sin(np.radians(camera.elevation)))
    widest = float((np.abs(seen[..., 0]) + reach).max())
    # The floor patch fills the cell's width, so its lower edge is a fixed share of it below the floor point.
    below = 0.5 * width * tilt + 4
    lowest = max(float((seen[..., 1] + reach).max()), 0.02)
    highest = max(float((reach - seen[..., 1]).max()), 0.6 * body.height)
    scale = min((height - below - 8) / highest, (width / 2 - 3) / widest, below / lowest)
    return _Strip(clip, frames, caption, body, limbs, np.asarray(clip.joints[:, 0], np.float32), scale, below, camera)


def _sheet(strips: list[_Strip], title: str | None, theme: Theme) -> Image.Image:
    columns = max(len(s.frames) for s in strips)
    width = 2 * MARGIN + columns * CELL[0] + 24 + PLAN
    probe = Paper(Image.new("RGB", (1, 1)), theme)
    room = width - 2 * MARGIN - 40
    blocks = [probe.wrap(s.caption, 21, room - probe.length(facts_of(s.clip), 14), lines=2) for s in strips]
    heights = [_row_height(len(block)) for block in blocks]
    head = 64 if title else 0
    height = MARGIN - 8 + head + sum(heights) + GAP * (len(strips) - 1) + 46
    paper = Paper(Image.new("RGB", (width, height), theme.paper), theme)
    y = MARGIN - 8
    if title:
        paper.text((MARGIN, y), paper.wrap(title, 30, width - 2 * MARGIN, lines=1)[0], 30, theme.ink)
        y += head
    for strip, block, tall in zip(strips, blocks, heights, strict=True):
        _draw_row(paper, strip, block, y, width)
        y += tall + GAP
    _legend(paper, width, height)
    return paper.image


def _row_height(lines: int) -> int:
    return 27 * max(lines, 1) + 14 + CELL[1] + 24 + 2 * (LANE + 5)


def _draw_row(paper: Paper, strip: _Strip, caption: list[str], top: int, width: int) -> None:
    theme = paper.theme
    for line, text in enumerate(caption):
        paper.text((MARGIN, top + 27 * line), text, 21, theme.ink)
    paper.text((width - MARGIN, top + 5), facts_of(strip.clip), 14, theme.muted, align="right")
    top += 27 * max(len(caption), 1) + 14
    for column, frame in enumerate(strip.frames):
        left = MARGIN + column * CELL[0]
        paper.image.paste(_cell(strip, column, theme), (left, top))
        at = (left + CELL[0] / 2, top + CELL[1] + 2)
        paper.text(at, f"{frame / strip.clip.fps:.2f} s", 14, theme.muted, align="centre")
    _lanes(paper, strip, top + CELL[1] + 26)
    paper.image.paste(_plan(strip, theme), (width - MARGIN - PLAN, top))


def _cell(strip: _Strip, column: int, theme: Theme) -> Image.Image:
    """One pose on its patch of floor."""
    size = (CELL[0] * SMOOTH, CELL[1] * SMOOTH)
    scale = strip.scale * SMOOTH
    origin = np.array([size[0] / 2, size[1] - strip.below * SMOOTH, 0], np.float32)

    def pixels(points: NDArray[np.floating]) -> NDArray[np.float32]:
        return strip.camera.project(points) * scale + origin

    image = Image.new("RGB", size, theme.paper)
    radius = (CELL[0] / 2 - 4) / strip.scale
    rim = _points(pixels(_circle(radius)))
    _patch(image, strip, int(strip.frames[column]), radius, pixels, theme)
    image.paste(theme.shadow, mask=_shadow(strip, column, size, rim, pixels))
    colours = np.array([theme.parts[limb.part] for limb in strip.body.limbs]) / 255
    figure = shade(pixels(strip.limbs[column]), strip.body.radii() * scale, colours.astype(np.float32), size)
    image.paste(Image.fromarray(figure[..., :3]), mask=Image.fromarray(figure[..., 3]))
    return image.resize(CELL, Image.Resampling.BOX)


def _patch(image: Image.Image, strip: _Strip, frame: int, radius: float, pixels: Projection, theme: Theme) -> None:
    """A round piece of floor under one pose: grid, trail, lit contacts."""
    draw = ImageDraw.Draw(image)
    root = strip.root[frame]
    draw.polygon(_points(pixels(_circle(radius))), fill=theme.floor)
    for axis in (0, 2):
        first = np.ceil((root[axis] - radius) / GRID) * GRID
        for at in np.arange(first, root[axis] + radius, GRID) - root[axis]:
            half = np.sqrt(max(radius**2 - at**2, 0))
            line = np.zeros((2, 3))
            line[:, axis], line[:, 2 - axis] = at, (-half, half)
            draw.line(_points(pixels(line)), fill=theme.line, width=SMOOTH)
    trail = (strip.root - root) * np.array([1, 0, 1])
    near = np.linalg.norm(trail, axis=-1) < radius
    for t in np.flatnonzero(near[:-1] & near[1:]):
        colour = theme.muted if t < frame else blend(theme.floor, theme.muted, 0.35)
        draw.line(_points(pixels(trail[t : t + 2])), fill=colour, width=SMOOTH)
    _light_contacts(image, strip, frame, pixels, theme)


def _light_contacts(image: Image.Image, strip: _Strip, frame: int, pixels: Projection, theme: Theme) -> None:
    draw = ImageDraw.Draw(image)
    for foot, joint in enumerate(strip.clip.skeleton.feet):
        if not strip.clip.contacts[frame, foot]:
            continue
        centre = (strip.clip.joints[frame, joint] - strip.root[frame]) * np.array([1, 0, 1])
        colour = theme.parts["left" if foot < 2 else "right"]
        draw.polygon(_points(pixels(centre + _circle(0.085))), fill=blend(theme.floor, colour, 0.55))


def _shadow(
    strip: _Strip, column: int, size: tuple[int, int], rim: list[tuple[float, float]], pixels: Projection
) -> Image.Image:
    """The figure's soft shadow, as far as the patch of floor goes."""
    limbs = strip.limbs[column]
    fallen = limbs - LIGHT / LIGHT[1] * np.maximum(limbs[..., 1:2], 0)
    ends = pixels(fallen) / SMOOTH
    radii = strip.body.radii() * strip.scale
    mask = Image.new("L", (size[0] // SMOOTH, size[1] // SMOOTH))
    draw = ImageDraw.Draw(mask)
    for (a, b), reach in zip(ends[..., :2], radii, strict=True):
        draw.line([tuple(a), tuple(b)], fill=255, width=max(1, round(1.2 * float(reach.mean()))))
        for end, r in zip((a, b), reach, strict=True):
            draw.ellipse([end[0] - r, end[1] - 0.45 * r, end[0] + r, end[1] + 0.45 * r], fill=255)
    soft = mask.filter(ImageFilter.GaussianBlur(2.5)).point(lambda v: int(v * 0.34))
    patch = Image.new("L", size)
    ImageDraw.Draw(patch).polygon(rim, fill=255)
    return ImageChops.multiply(soft.resize(size, Image.Resampling.BILINEAR), patch)


def _lanes(paper: Paper, strip: _Strip, top: int) -> None:
    """Foot contact over time, one lane a side; both joints of a foot down is the full colour."""
    if not strip.clip.skeleton.feet:
        return
    draw, theme = ImageDraw.Draw(paper.image), paper.theme
    count = strip.clip.frames
    left, right = MARGIN + CELL[0] / 2, MARGIN + (len(strip.frames) - 0.5) * CELL[0]
    at = np.interp(np.arange(count + 1) - 0.5, strip.frames, np.linspace(left, right, len(strip.frames)))
    for lane, side in enumerate(("left", "right")):
        y = top + lane * (LANE + 5)
        draw.rectangle([left, y, right, y + LANE - 1], fill=theme.floor)
        paper.text((left - 9, y - 3), side[0].upper(), 11, theme.parts[side], align="right")
        down = strip.clip.contacts[:, 2 * lane : 2 * lane + 2].sum(axis=-1)
        for t in np.flatnonzero(down):
            colour = blend(theme.floor, theme.parts[side], (0.0, 0.5, 1.0)[int(down[t])])
            draw.rectangle([at[t], y, max(at[t + 1] - 1, at[t]), y + LANE - 1], fill=colour)


def _plan(strip: _Strip, theme: Theme) -> Image.Image:
    """The path from above, up is where the figure faced first (+Z), with an arrow where each pose faces."""
    big = PLAN_SMOOTH
    size = (PLAN * big, CELL[1] * big)
    image = Image.new("RGB", size, theme.paper)
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle([0, 0, size[0] - 1, size[1] - 1], radius=12 * big, fill=theme.floor)
    path = strip.root[:, [0, 2]]
    middle = (path.min(axis=0) + path.max(axis=0)) / 2
    spread = np.maximum(np.ptp(path, axis=0) + 0.9, 2.0)
    scale = min(size[0] / spread[0], (size[1] - 40 * big) / spread[1])
    step = next(s for s in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 1e9) if s * scale > 28 * big)

    def pixels(points: NDArray[np.floating]) -> NDArray[np.floating]:
        # Seen from above with +Z up the page, +X (the figure's left in frame 0) is on the left.
        return np.array([size[0] / 2, (size[1] - 20 * big) / 2]) - (points - middle) * scale

    _plan_grid(draw, middle, step, scale, size, theme)
    draw.line(_points(pixels(path)), fill=theme.muted, width=2 * big, joint="curve")
    ahead = _headings(strip)
    for frame, heading in zip(strip.frames, ahead, strict=True):
        at = pixels(path[frame])
        tip = at - heading * 13 * big
        side = np.array([-heading[1], heading[0]]) * 5 * big
        draw.polygon(_points(np.stack([tip, at + side, at - side])), fill=theme.ink)
    first = pixels(path[0])
    r = 4.5 * big
    draw.ellipse([*(first - r), *(first + r)], fill=theme.paper, outline=theme.ink, width=big)
    small = Paper(image.resize((PLAN, CELL[1]), Image.Resampling.LANCZOS), theme)
    small.text((PLAN / 2, CELL[1] - 20), f"from above  ·  grid {step:g} m", 12, theme.muted, align="centre")
    return small.image


def _plan_grid(
    draw: ImageDraw.ImageDraw,
    middle: NDArray[np.floating],
    step: float,
    scale: float,
    size: tuple[int, int],
    theme: Theme,
) -> None:
    bottom = size[1] - 24 * PLAN_SMOOTH
    centre = (size[0] / 2, (size[1] - 20 * PLAN_SMOOTH) / 2)
    inset = 4 * PLAN_SMOOTH
    for axis, (low, high) in enumerate(((inset, size[0] - inset), (inset, bottom))):
        reach = size[axis] / scale
        for line in range(int((middle[axis] - reach) // step), int((middle[axis] + reach) // step) + 2):
            pixel = float(centre[axis] - (line * step - middle[axis]) * scale)
            if low < pixel < high:
                ends = [(pixel, inset), (pixel, bottom)] if axis == 0 else [(inset, pixel), (size[0] - inset, pixel)]
                draw.line(ends, fill=theme.line, width=PLAN_SMOOTH)


def _headings(strip: _Strip) -> NDArray[np.floating]:
    """(F, 2) X and Z of where each chosen pose faces."""
    clip = strip.clip
    if clip.skeleton.facing:
        return facing(np.asarray(clip.joints[strip.frames], np.float64), clip.skeleton)[:, [0, 2]]
    return forward_of(clip.skeleton, clip.joints[strip.frames])[:, [0, 2]]


def _legend(paper: Paper, width: int, height: int) -> None:
    y = height - 34
    x: float = MARGIN
    theme = paper.theme
    draw = ImageDraw.Draw(paper.image)
    for part, label in LEGEND:
        draw.ellipse([x, y + 3, x + 10, y + 13], fill=theme.parts[part])
        paper.text((x + 16, y), label, 13, theme.muted)
        x += 16 + paper.length(label, 13) + 22
    paper.text((x, y), "a lit patch of floor is a foot in contact", 13, theme.muted)
    paper.text((width - MARGIN, y), "Marey", 13, theme.muted, align="right")


def _circle(radius: float) -> NDArray[np.float64]:
    """(73, 3) points around the origin on the floor."""
    turn = np.linspace(0, 2 * np.pi, 73)
    return radius * np.stack([np.cos(turn), 0 * turn, np.sin(turn)], axis=-1)


def _points(view: NDArray[np.floating]) -> list[tuple[float, float]]:
    return [(float(p[0]), float(p[1])) for p in view]
