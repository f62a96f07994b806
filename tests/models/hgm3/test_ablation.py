"""The ablation trains what it names and leaves the rest alone; its table holds means and intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from marey.bundles import find_bundle
from marey.data.prepared import PreparedData
from marey.models.hgm3.ablation import DECODINGS, table, train_variant
from marey.models.hgm3.assembly import assemble
from marey.models.hgm3.config import TINY
from marey.models.hgm3.train import train_stage
from marey.training.budget import Budget
from marey.training.motions import TokenData
from marey.training.staging import TrainOptions


def test_a_variant_differs_from_its_bundle_in_the_masked_transformer_alone(
    prepared: PreparedData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    options = TrainOptions(prepared.path, tmp_path / "run", TINY, Budget(steps=2), device="cpu", bf16=False, quiet=True)
    for stage in ("tokenizer", "masked", "residual", "length"):
        train_stage(stage, options)
    bundle = assemble(prepared.path, tmp_path / "run", tmp_path / "bundle", TINY)
    random_masks = replace(TINY, mining=replace(TINY.mining, mask="random"))
    numbers = train_variant(prepared.path, str(bundle.path), tmp_path / "variant", random_masks, options)
    assert numbers["reconstruction/specific"] > 0
    made = find_bundle(str(tmp_path / "variant" / "bundle"))
    assert made.manifest.parameters["mining"]["mask"] == "random"
    for part in ("tokenizer", "residual", "length"):
        theirs, ours = bundle.tensors(part), made.tensors(part)
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)
    theirs, ours = bundle.tensors("masked"), made.tensors("masked")
    assert not all(np.array_equal(theirs[name], ours[name]) for name in theirs)

    def encode_again(*_: object) -> None:
        raise AssertionError("the tokens of the first variant serve the second")

    monkeypatch.setattr(TokenData, "encode", encode_again)
    train_variant(prepared.path, str(bundle.path), tmp_path / "second", TINY, options)


def test_flat_decoding_has_all_its_passes_at_the_level_of_specifics() -> None:
    inference = DECODINGS["flat"].inference(TINY.inference)
    assert inference.motion_steps == inference.action_steps == 0
    assert inference.steps > 0


def test_the_table_gives_the_mean_and_the_interval_of_each_variant() -> None:
    rows = {"hard": [{"obeyed": 0.9}, {"obeyed": 0.8}, {"obeyed": 0.7}], "random": [{"obeyed": 0.5}, {"obeyed": 0.5}]}
    lines = table(rows).splitlines()
    assert lines[0] == "| variant | seeds | obeyed |"
    mean, half = (float(x) for x in lines[2].split("|")[3].split("±"))
    assert mean == pytest.approx(0.8)
    assert half == pytest.approx(1.96 * 0.1 / 3**0.5, abs=1e-3)
    assert lines[3] == "| random | 2 | 0.500 ± 0.000 |"
