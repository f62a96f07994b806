"""The files that a worker stores of a motion."""

from __future__ import annotations

from marey.exporters import Coordinates, exporter_of
from marey.runtime.exporting import export_clip
from tests.support.walker import walker


def test_every_stored_format_is_written_and_films_are_not() -> None:
    clip = walker(seconds=0.2)
    files = {file.format: file.content for file in export_clip(clip, "MIT").files}
    assert files == {name: exporter_of(name).encode(clip, Coordinates()) for name in ("bvh", "npz")}
