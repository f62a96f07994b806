"""Keys of files made of an npz, and what such files hold."""

from __future__ import annotations

import itertools

import pytest

from marey.core.errors import InvalidInput
from marey.exporters import registry
from marey.exporters.making import FileRecipe
from marey.motion.clip import parse_npz
from marey.motion.export_options import ExportOptions
from tests.support.walker import walker

SOURCE = "0" * 64
RECIPES = (
    FileRecipe("glb"),
    FileRecipe("bvh"),
    FileRecipe("glb", fps=24.0),
    FileRecipe("glb", fps=24000 / 1001),
    FileRecipe("glb", ExportOptions(mesh=True)),
    FileRecipe("glb", ExportOptions(root_bone=True)),
    FileRecipe("glb", ExportOptions(in_place="travel")),
    FileRecipe("glb", ExportOptions(in_place="heading")),
    FileRecipe("glb", ExportOptions(in_place="heading", mesh=True), 24.0),
)


def test_different_files_have_different_keys_and_equal_ones_the_same() -> None:
    for one, other in itertools.product(RECIPES, RECIPES):
        assert (one.key(SOURCE) == other.key(SOURCE)) == (one is other)
        assert one.key(SOURCE) != other.key("1" * 64)
    spelt_out = ExportOptions(mesh=True, in_place="heading", root_bone=False, bvh_root="zero", placement="origin")
    assert FileRecipe("glb", spelt_out, 24.0).key(SOURCE) == RECIPES[-1].key(SOURCE)


def test_a_new_version_of_the_exporter_has_other_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    before = RECIPES[0].key(SOURCE)
    registry.version_of.cache_clear()
    with monkeypatch.context() as patched:
        patched.setattr(registry.EXPORTERS, "version", lambda _: "99")
        assert RECIPES[0].key(SOURCE) != before
    registry.version_of.cache_clear()
    assert RECIPES[0].key(SOURCE) == before


def test_a_file_at_another_rate_has_the_motion_at_that_rate() -> None:
    npz = walker(seconds=1.0).to_npz()
    clip = parse_npz(FileRecipe("npz", fps=60.0).make(npz, "motion"), "made")
    assert (clip.fps, clip.frames) == (60.0, 61)
    with pytest.raises(InvalidInput, match="allowed: 1 to 240") as caught:
        FileRecipe("npz", fps=500.0).make(npz, "motion")
    assert caught.value.where == "fps"
