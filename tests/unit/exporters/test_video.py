"""Films of motions: rate, length, size, and what they show."""

from __future__ import annotations

import io
import sys
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image

from marey.core.errors import InvalidInput, TooLarge
from marey.exporters import Coordinates, exporter_of
from marey.exporters.convert import convert
from marey.viz import video
from marey.viz.film import SIZE, Film
from tests.support.walker import walker

SHORT = walker(seconds=0.4)


def encode(name: str, clip) -> bytes:
    return exporter_of(name).encode(clip, Coordinates())


def animated(data: bytes) -> tuple[list[np.ndarray], int]:
    """Pictures of a GIF or WebP and its length in milliseconds."""
    with Image.open(io.BytesIO(data)) as image:
        pictures, length = [], 0
        for number in range(image.n_frames):
            image.seek(number)
            pictures.append(np.asarray(image.convert("RGB"), int))
            length += image.info["duration"]
        assert image.info.get("loop") == 0
        return pictures, length


def sides(picture: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Masks of what is blue (left) and orange (right)."""
    red, _, blue = np.moveaxis(picture, -1, 0)
    return blue > red + 60, red > blue + 80


@pytest.mark.parametrize(("fps", "rate"), [(20.0, 20), (24000 / 1001, Fraction(24000, 1001)), (120.0, 60)])
def test_an_mp4_has_the_rate_and_the_length_of_the_clip(fps: float, rate: Fraction) -> None:
    av = pytest.importorskip("av")
    clip = walker(seconds=0.5, fps=fps)
    with av.open(io.BytesIO(encode("mp4", clip))) as container:
        (stream,) = container.streams
        pictures = [np.asarray(frame.to_image(), int) for frame in container.decode(stream)]
        assert stream.average_rate == rate
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert float(stream.duration * stream.time_base) == pytest.approx(len(pictures) / rate)
    assert len(pictures) == round(0.5 * rate) + 1
    assert pictures[0].shape == (SIZE[1], SIZE[0], 3)
    for picture, drawn in zip(pictures[::5], list(Film(clip, 60))[::5], strict=True):
        assert np.abs(picture - np.asarray(drawn, int)).mean() < 3


@pytest.mark.parametrize(
    ("name", "fps", "count", "length"),
    [("gif", 20.0, 9, 450), ("webp", 20.0, 9, 450), ("gif", 60.0, 13, 430), ("webp", 24.0, 11, 458)],
)
def test_an_animated_picture_has_the_length_of_the_clip(name: str, fps: float, count: int, length: int) -> None:
    pictures, shown = animated(encode(name, walker(seconds=0.4, fps=fps)))
    assert (len(pictures), shown) == (count, length)
    assert {picture.shape for picture in pictures} == {(360, 480, 3)}


@pytest.mark.parametrize("name", ["gif", "webp"])
def test_the_figure_moves_and_its_sides_have_their_colours(name: str) -> None:
    pictures, _ = animated(encode(name, SHORT))
    for before, after in pairwise(pictures):
        for one, other in zip(sides(before), sides(after), strict=True):
            assert one.sum() > 1000
            assert (one ^ other).sum() > 50


@pytest.mark.parametrize("name", ["gif", "mp4", "webp"])
def test_equal_clips_give_equal_bytes(name: str) -> None:
    if name == "mp4":
        pytest.importorskip("av")
    clip = walker(seconds=0.15)
    assert encode(name, clip) == encode(name, clip)


def test_the_camera_goes_along_and_the_floor_stays_in_the_world() -> None:
    clip = walker(seconds=4, turn=0.5)
    pictures = [np.asarray(Film(clip).picture(frame), int) for frame in (0, 40, 80)]
    for picture in pictures:
        columns = np.nonzero(sides(picture)[0] | sides(picture)[1])[1]
        assert abs(columns.mean() - SIZE[0] / 2) < 40
        assert columns.min() > 20
        assert columns.max() < SIZE[0] - 20
    floor = [picture[-40:-5, 150:330] for picture in pictures]
    assert (floor[0] != floor[1]).any(axis=-1).mean() > 0.01, "the grid does not move under the figure"


def test_a_film_too_long_for_an_animated_picture_is_refused(monkeypatch) -> None:
    monkeypatch.setattr(video, "MAX_PICTURES", 5)
    for name in ("gif", "webp"):
        with pytest.raises(TooLarge, match="9 pictures, over the limit of 5"):
            encode(name, SHORT)


def test_without_pyav_the_extra_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(InvalidInput, match=r"marey\[video\]"):
        encode("mp4", SHORT)


def test_a_motion_is_converted_to_a_film_and_not_back(tmp_path) -> None:
    SHORT.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "a.webp", fps=10)
    assert animated((tmp_path / "a.webp").read_bytes())[1] == 500
    with pytest.raises(InvalidInput, match="can be written, but not read"):
        convert(tmp_path / "a.webp", tmp_path / "b.npz")


@pytest.mark.parametrize("name", ["gif", "mp4", "webp"])
def test_a_single_pose_is_a_film_too(name: str) -> None:
    if name == "mp4":
        pytest.importorskip("av")
    assert len(encode(name, walker(seconds=0))) > 500
