"""Configurations: the published values in `paper`, ours elsewhere, and files that contradict themselves."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from marey.core.errors import InvalidFile
from marey.models.hgm3.bundle import load_networks, random_bundle
from marey.models.hgm3.config import PAPER, STARTER, TINY, MiningConfig, named_config
from marey.training.budget import learning_rate
from marey.training.config_file import open_config


def test_paper_trains_as_published() -> None:
    t, mining = PAPER.tokenizer, PAPER.mining
    assert (mining.mask, mining.alpha_start, mining.alpha_end, mining.levels_per_step) == ("hard", 0.0, 0.5, 3)
    assert [PAPER.train_tokenizer.batch, PAPER.train_masked.batch, PAPER.train_residual.batch] == [512, 256, 64]
    for stage in (PAPER.train_tokenizer, PAPER.train_masked, PAPER.train_residual):
        assert (stage.learning_rate, stage.decay, stage.epochs, stage.ema) == (2e-4, "constant", 500, 0)
        rates = [
            learning_rate(2e-4, step / 1e5, step, warmup_steps=stage.warmup_steps, warmup_share=stage.warmup_share)
            for step in (0, 999, 1999, 50_000)
        ]
        assert rates == pytest.approx([1e-7, 1e-4, 2e-4, 2e-4]), "over 2000 iterations"
    assert (t.rotation_weight, t.position_weight, t.velocity_weight, t.world_weight) == (1, 0, 0, 0)
    assert (PAPER.in_order, PAPER.compact, PAPER.condition.noise) == (False, False, 0)


def test_all_other_configurations_train_with_the_terms_on_joints() -> None:
    for config in (STARTER, TINY):
        t = config.tokenizer
        assert (t.position_weight, t.velocity_weight, t.world_weight) == (5, 0.5, 2)


def test_sizes_that_contradict_each_other_are_refused_in_a_file(tmp_path: Path) -> None:
    for text, said in (
        ("features = 251", "layout: humanml3d-263 has 263 features of 22 joints at 20 fps, not 251 of 22 at 20"),
        ('layout = "x"', "unknown feature layout `x`"),
        ("min_frames = 197", "min_frames: 197 is over max_frames, 196"),
        ("windows = [64, 66]", "windows: must be multiples of 4, the frames of a token, at least one"),
        ("[residual]\nheads = 5", "residual.heads: 5 does not divide the width, 32"),
        ("[inference]\nsteps = 4", "inference: must not decrease: motion_steps 2, action_steps 5, steps 4"),
    ):
        file = tmp_path / "mine.toml"
        file.write_text(f'preset = "tiny"\n{text}\n', encoding="utf-8")
        with pytest.raises(InvalidFile, match=re.escape(said)):
            open_config(named_config, str(file))


def test_the_configuration_of_a_file_stands_in_the_bundle(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('preset = "tiny"\n[mining]\nalpha_end = 1\n', encoding="utf-8")
    config = open_config(named_config, str(tmp_path / "mine.toml"))
    bundle = random_bundle(tmp_path / "made", config)
    assert bundle.manifest.config == "mine"
    assert load_networks(bundle)[0] == config == replace(TINY, name="mine", mining=MiningConfig(alpha_end=1.0))
