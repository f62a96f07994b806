"""Edits by MoMask++: kept frames are copied, new ones follow the seed, for both layouts of the tokenizer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.generation.export import finish
from marey.generation.shots.editor import EditModel
from marey.models.momaskpp.generate import Generator
from marey.motion import edit
from tests.models.momaskpp.test_generate import request, variant
from tests.support.prepared import text_features

__all__ = ["variant"]


@pytest.mark.parametrize(
    ("op", "kept"),
    [
        ({"op": "extend", "seconds": 2, "prompt": "jumping"}, slice(0, 80)),
        ({"op": "repaint", "from": 2, "to": 3}, slice(0, 40)),
        ({"op": "repaint", "from": 2, "to": 3, "prompt": "jumping"}, slice(0, 40)),
    ],
)
def test_kept_frames_are_copied_and_new_ones_generated(variant: Generator, op: dict, kept: slice) -> None:
    wanted = request(0, 5, 80)
    (made,) = variant.generate([wanted])
    assert made is not None
    clip = finish(variant, wanted, made, variant.settings({}))
    model = EditModel.of(variant, {}, lambda prompt: replace(text_features(1), rewritten=prompt))
    first, again, other = (edit(clip, [{**op, "force": True, "seed": seed}], model=model)[0] for seed in (1, 1, 2))
    assert np.array_equal(first.joints[kept], clip.joints[kept])
    assert first.to_npz() == again.to_npz()
    assert not np.array_equal(first.joints, other.joints)
