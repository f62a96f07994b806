"""Conversion through the formats that are installed."""

from __future__ import annotations

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates
from marey.exporters.convert import convert, read_motion
from marey.motion.io.bvh import read_bvh, write_bvh
from marey.motion.io.convert import clip_from_bvh
from tests.support.plugins import installed, write_distribution
from tests.support.walker import walker

TOY = """
from marey.exporters import Exporter, exporter_of


def encode(clip, coordinates):
    return f"{coordinates.unit} {coordinates.up} ".encode() + exporter_of("npz").encode(clip, coordinates)


def decode(data, where, coordinates):
    return exporter_of("npz").decode(data.split(b" ", 2)[2], where, coordinates)


READ = Exporter("toy", "text/x-toy", "ty", True, encode, decode)
WRITTEN = Exporter("written", "text/x-toy", "wr", False, encode)
"""


@pytest.fixture
def plugin(tmp_path_factory):
    """Two formats of a plug-in."""
    folder = tmp_path_factory.mktemp("plugin")
    entries = "[marey.exporters]\ntoy = toy_converted:READ\nwritten = toy_converted:WRITTEN\n"
    with installed(write_distribution(folder, "toy_converted", {"toy_converted": TOY}, entries)):
        yield


@pytest.mark.usefixtures("plugin")
def test_a_format_of_a_plugin_is_converted_to_and_from(tmp_path):
    clip = walker()
    clip.save_npz(tmp_path / "a.npz")
    assert convert(tmp_path / "a.npz", tmp_path / "b.ty", unit="in", up="z") == ()
    assert (tmp_path / "b.ty").read_bytes() == b"in z " + clip.to_npz()
    convert(tmp_path / "b.ty", tmp_path / "c.npz")
    assert (tmp_path / "c.npz").read_bytes() == clip.to_npz()
    convert(tmp_path / "b.ty", tmp_path / "d.ty", fps=30)
    assert read_motion(tmp_path / "d.ty", Coordinates()).fps == 30
    write_bvh(tmp_path / "e.bvh", clip)
    convert(tmp_path / "e.bvh", tmp_path / "f.TY")  # the encoder gets a clip, not what a BVH held
    read = read_motion(tmp_path / "f.TY", Coordinates())
    assert read.manifest["origin"] == "e.bvh"
    expected = clip_from_bvh(read_bvh(tmp_path / "e.bvh"), "e.bvh")
    np.testing.assert_array_equal(read.joints, expected.joints)


@pytest.mark.usefixtures("plugin")
def test_a_format_that_is_only_written_is_not_read(tmp_path):
    walker().save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.wr")
    with pytest.raises(InvalidInput, match="can be written, but not read"):
        convert(tmp_path / "b.wr", tmp_path / "c.npz")
    with pytest.raises(
        InvalidInput,
        match=r"Known: \.bvh, \.fbx, \.gif, \.glb, \.mp4, \.npz, \.smplx\.npz, \.ty, \.usd, \.vrma, \.webp, \.wr\.",
    ):
        convert(tmp_path / "a.npz", tmp_path / "b.abc")


@pytest.mark.parametrize(
    ("folder", "message"), [("missing", "No such file or directory"), ("a.npz", "Not a directory")]
)
def test_a_target_without_a_folder_is_refused_before_anything_is_made(folder, message, tmp_path, monkeypatch):
    walker(seconds=0.2).save_npz(tmp_path / "a.npz")
    monkeypatch.setattr("marey.exporters.convert._decode", None)  # it is not read
    with pytest.raises(InvalidInput, match=f"{folder}.*: .*{message}"):
        convert(tmp_path / "a.npz", tmp_path / folder / "b.gif")
