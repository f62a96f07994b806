"""Matrices of a bundle in 8 bits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from marey.bundles import Bundle, BundleWriter
from marey.bundles.eight_bit import quantize, restore, scale_of, write_eight_bit
from marey.cli.commands import models
from marey.core.errors import Conflict, InvalidBundle, InvalidInput

SHAPES = st.one_of(st.tuples(st.integers(1, 6), st.integers(1, 9)), st.tuples(*[st.integers(1, 5)] * 3))


@given(SHAPES.flatmap(lambda shape: arrays.arrays(np.float32, shape, elements=st.floats(-100, 100, width=32))))
def test_a_matrix_is_restored_to_half_a_step_of_its_row(matrix: np.ndarray) -> None:
    stored, scale = quantize(matrix)
    restored = restore({"a.weight": stored, "a.scale": scale, "b": scale})
    assert stored.dtype == np.int8
    assert restored.keys() == {"a.weight", "b"}
    steps = scale.reshape(-1, *[1] * (matrix.ndim - 1))
    assert (np.abs(restored["a.weight"] - matrix) <= 0.5001 * steps).all()


def test_matrices_without_fitting_scales_are_refused() -> None:
    stored, scale = quantize(np.ones((3, 2), np.float32))
    for tensors in ({"a.weight": stored}, {"a.weight": stored, "a.scale": scale[:2]}):
        with pytest.raises(InvalidBundle, match=r"'a\.weight' of 8 bits does not fit its scales"):
            restore(tensors)


@pytest.fixture
def bundle(tmp_path: Path) -> Bundle:
    rng = np.random.default_rng(0)
    large = rng.normal(size=(64, 64)).astype(np.float32)
    with BundleWriter(tmp_path / "toy") as writer:
        writer.add_part("net", {"in_proj_weight": large, "small.weight": large[:2, :2], "bias": large[0]})
        writer.add_statistics(large[0], large[1])
        writer.add_json("notes.json", {"a": 1})
        writer.add_card("# Toy\n")
        return writer.finish(
            name="toy", version="3", kind="generator", model="toy", config="tiny", parameters={"a": 1}, licence="MIT"
        )


def test_a_copy_holds_large_matrices_in_8_bits_and_the_rest_as_it_was(
    bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    models.quantize(str(bundle.path), output=tmp_path / "copy")
    copy = Bundle.open(tmp_path / "copy")
    assert capsys.readouterr().out.strip() == copy.reference
    net, before = copy.tensors("net", dtype=None), bundle.tensors("net", dtype=None)
    assert net["in_proj_weight"].dtype == np.int8
    assert net[scale_of("in_proj_weight")].shape == (64,)
    assert (net["small.weight"] == before["small.weight"]).all()
    assert (net["bias"] == before["bias"]).all()
    assert np.abs(restore(net)["in_proj_weight"] - before["in_proj_weight"]).max() < 0.02
    assert [(a == b).all() for a, b in zip(copy.statistics(), bundle.statistics(), strict=True)] == [True, True]
    assert copy.read_json("notes.json") == {"a": 1}
    assert (copy.path / "README.md").read_text() == "# Toy\n"
    manifest = copy.manifest
    assert (manifest.name, manifest.version, manifest.model, manifest.parameters) == ("copy", "3", "toy", {"a": 1})
    assert copy.manifest.files["net.safetensors"].bytes < 0.7 * bundle.manifest.files["net.safetensors"].bytes


def test_a_copy_is_not_made_twice(bundle: Bundle, tmp_path: Path) -> None:
    copy = write_eight_bit(bundle, tmp_path / "copy")
    with pytest.raises(Conflict):
        write_eight_bit(bundle, tmp_path / "copy")
    with pytest.raises(InvalidInput, match="8 bits already"):
        write_eight_bit(copy, tmp_path / "again")
    assert not (tmp_path / "again").exists()
