"""Windows of clips, from which tokenizers learn."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from marey.training.motions import MotionData
from marey.training.tokenizing import ClipWindows
from tests.support.prepared import write_prepared

RATE = 4


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> MotionData:
    """Clips of 36 to 99 frames."""
    return MotionData.load(write_prepared(tmp_path_factory.mktemp("windows") / "prepared"), torch.device("cpu"))


def test_a_batch_has_one_size_and_about_as_many_frames_as_any_other(data: MotionData) -> None:
    windows, rng = ClipWindows(data, RATE, (16, 32, 64, 128), 6), np.random.default_rng(0)
    shapes = {windows.draw(rng)[0].shape[:2] for _ in range(40)}
    assert shapes == {(6, 16), (3, 32), (1, 64), (1, 128)}


def test_windows_lie_in_training_clips(data: MotionData) -> None:
    windows, rng = ClipWindows(data, RATE, (40,), 24), np.random.default_rng(0)
    clips = [clip for clip in data.prepared.split("train") if not clip.spliced]
    starts = set[tuple[str, int]]()
    for _ in range(8):
        features, lengths = windows.draw(rng)
        for window, length in zip(features, lengths, strict=True):
            (begin,) = (data.features[:, None] == window[0]).all(-1).nonzero()[:, 0].tolist()
            (clip,) = (clip for clip in clips if clip.start <= begin < clip.start + clip.length)
            assert length == min(40, clip.length - clip.length % RATE)
            assert torch.equal(window[:length], data.features[begin : begin + length])
            assert begin + length <= clip.start + clip.length
            starts.add((clip.id, begin - clip.start))
    assert {name for name, _ in starts} == {clip.id for clip in clips}
    assert {begin for name, begin in starts if name == "clip0"} == {0}  # 36 frames: shorter than a window
    assert {begin for name, begin in starts if name == "clip1"} == {0, 1, 2, 3, 4}  # 44 of 45 frames
