"""Configurations: what the paper gives in `paper`, ours elsewhere, and files that contradict themselves."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from marey.core.errors import InvalidFile
from marey.models.mogo.config import PAPER, STARTER, TINY, named_config
from marey.training.config_file import open_config


def test_paper_is_what_the_paper_gives_and_nothing_of_ours() -> None:
    t = PAPER.tokenizer
    assert (t.levels, t.codes, t.code_width, t.scale) == (6, 8192, 128, "elementwise")
    assert (t.rotation_weight, t.position_weight, t.velocity_weight, t.world_weight) == (1, 0, 0, 0)
    assert (PAPER.ahead, PAPER.steers, PAPER.rollouts, PAPER.first_level) == ((), 0, 0, 1)
    assert (PAPER.crops, STARTER.crops, TINY.crops) == (0, 0.4, 0.4)
    assert "crops" not in STARTER.to_dict(), "earlier releases read the bundle"
    assert (PAPER.transformer.level_gain, PAPER.transformer.joint, PAPER.depth.layers) == (False, False, 0)
    assert (PAPER.condition.every_frame, PAPER.condition.clock, PAPER.condition.noise) == (False, False, 0)
    assert PAPER.train_tokenizer.ema == PAPER.train_transformer.ema == 0
    for config in (STARTER, TINY):
        t = config.tokenizer
        assert (t.position_weight, t.velocity_weight, t.world_weight) == (5, 0.5, 2)


def test_sizes_that_contradict_each_other_are_refused_in_a_file(tmp_path: Path) -> None:
    for text, said in (
        ("fps = 12.5", "layout: humanml3d-263 has 263 features of 22 joints at 20 fps, not 263 of 22 at 12.5"),
        ("[transformer]\nheads = 5", "transformer.heads: 5 does not divide the width, 32"),
        ("[transformer]\njoint = true\n[depth]\nlayers = 0", "transformer.joint: one sequence for all levels needs"),
        ("[inference]\nwindow = 25", "inference.window: 25 is over max_frames, 24"),
        ("windows = []", "windows: must be multiples of 1, the frames of a token, at least one"),
    ):
        file = tmp_path / "mine.toml"
        file.write_text(f'preset = "tiny"\n{text}\n', encoding="utf-8")
        with pytest.raises(InvalidFile, match=re.escape(said)):
            open_config(named_config, str(file))
