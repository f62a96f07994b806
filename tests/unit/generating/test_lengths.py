"""Lengths of motions: those of items before those that a rewriter proposes, within the range of the bundle."""

from __future__ import annotations

from dataclasses import replace

import pytest

from marey.generation.port import Limits
from tests.support.prepared import text_features

LIMITS = Limits(min_frames=16, max_frames=196, fps=20.0, text_width=384)


@pytest.mark.parametrize(
    ("own", "proposed", "frames"),
    [(3.0, 6.0, 60), (None, 6.0, 120), (None, 12.0, 196), (None, 0.2, 16), (None, None, None)],
)
def test_an_items_own_length_comes_before_the_proposed_one(
    own: float | None, proposed: float | None, frames: int | None
) -> None:
    assert LIMITS.frames_of(own, replace(text_features(0), seconds=proposed)) == frames
