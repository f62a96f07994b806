"""Film: every frame of a clip as a picture, in the look of the contact sheet, seen by a camera that goes along.

The floor is fixed to the world and its round patch follows the figure, so that travel shows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw

from marey.motion.clip import MotionClip
from marey.motion.filters import smooth
from marey.viz.paper import Paper, Theme, theme_named
from marey.viz.raster import Shown, shade
from marey.viz.strip import SMOOTH, Size, Strip, draw_patch, make_strip, soft_shadow

SIZE = (480, 360)
"""Width and height of a frame, pixels."""
LAG = 0.25
"""Seconds over which the camera smooths the way of the figure: with the sway of every step it would shake."""
SLACK = 1e-6
"""Share of a rate that is rounding."""


@dataclass(frozen=True, eq=False)
class Film:
    """The pictures of a clip.

    Args:
        clip: the motion.
        most: largest rate in pictures a second; of a clip with more, every second, third, … frame is shown.
        size: width and height, pixels.
        theme: `light` or `dark`.
    """

    clip: MotionClip
    most: float = 60.0
    size: Size = SIZE
    theme: Theme = field(default_factory=lambda: theme_named("light"))

    @cached_property
    def step(self) -> int:
        """Frames of the clip for each picture."""
        return max(1, math.ceil(self.clip.fps / self.most * (1 - SLACK)))

    @property
    def fps(self) -> float:
        """Pictures a second."""
        return self.clip.fps / self.step

    def __len__(self) -> int:
        return -(-self.clip.frames // self.step)

    def __iter__(self) -> Iterator[Image.Image]:
        return (self.picture(column) for column in range(len(self)))

    @cached_property
    def _strip(self) -> Strip:
        path = smooth(np.asarray(self.clip.joints[:, 0], np.float64), LAG * self.clip.fps).astype(np.float32)
        shown = np.arange(0, self.clip.frames, self.step, dtype=np.intp)
        return make_strip(self.clip, shown, self.size, path)

    @cached_property
    def _colours(self) -> NDArray[np.float32]:
        parts = [self.theme.parts[limb.part] for limb in self._strip.body.limbs]
        return np.asarray(np.array(parts) / 255, np.float32)

    def picture(self, column: int) -> Image.Image:
        """Return a picture by its number."""
        strip, frame = self._strip, int(self._strip.frames[column])
        floor = Image.new("RGB", (self.size[0] * SMOOTH, self.size[1] * SMOOTH), self.theme.paper)
        rim = draw_patch(floor, strip, frame, lambda points: self._pixels(points, SMOOTH), self.theme)
        image = floor.reduce(SMOOTH)
        patch = Image.new("L", self.size)
        ImageDraw.Draw(patch).polygon([(x / SMOOTH, y / SMOOTH) for x, y in rim], fill=255)
        shadow = soft_shadow(strip, column, lambda points: self._pixels(points, 1))
        image.paste(self.theme.shadow, mask=ImageChops.multiply(shadow, patch))
        ends, radii = self._pixels(strip.limbs[column], SMOOTH), strip.body.radii() * strip.scale * SMOOTH
        _lay_over(image, shade(ends, radii, self._colours, floor.size))
        time = f"{frame / self.clip.fps:.2f} s"
        Paper(image, self.theme).text((self.size[0] - 12, 8), time, 14, self.theme.muted, align="right")
        return image

    def _pixels(self, points: NDArray[np.floating], larger: int) -> NDArray[np.float32]:
        """Project points of the world, around the centre of their pose, to pixels of a picture that is so many times
        larger."""
        origin = np.array([self.size[0] / 2, self.size[1] - self._strip.below, 0], np.float32)
        view = self._strip.camera.project(points) * self._strip.scale + origin
        return np.asarray(view * larger, np.float32)


def _lay_over(image: Image.Image, figure: Shown) -> None:
    """Draw a figure, `SMOOTH` times as large as the image, over it: shrunk with its edges, in its own box alone."""
    if not len(figure.rows):
        return
    top, left = (int(at.min()) // SMOOTH for at in (figure.rows, figure.columns))
    bottom, right = (int(at.max()) // SMOOTH + 1 for at in (figure.rows, figure.columns))
    opaque = np.full((len(figure.colours), 4), 255, np.uint8)
    opaque[:, :3] = figure.colours
    width, height = (right - left) * SMOOTH, (bottom - top) * SMOOTH
    large = np.zeros((height, width), np.uint32)
    large[figure.rows - top * SMOOTH, figure.columns - left * SMOOTH] = opaque.view(np.uint32)[:, 0]
    drawn = Image.frombuffer("RGBa", (width, height), large.tobytes(), "raw", "RGBa", 0, 1)
    small = np.asarray(drawn.reduce(SMOOTH), np.uint16)  # colours times their opacity
    under = np.asarray(image.crop((left, top, right, bottom)), np.uint16)
    mixed = small[..., :3] + (under * (255 - small[..., 3:]) + 127) // 255
    image.paste(Image.fromarray(np.minimum(mixed, 255).astype(np.uint8)), (left, top))
