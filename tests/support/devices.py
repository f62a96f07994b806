"""Stand-ins for a card, on a machine that has none."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from unittest.mock import patch

import numpy as np
import torch

from marey.training.stages import SplitStage, StepContext, TrainingStage


@contextmanager
def like_another_device() -> Generator[None]:
    """Let tensors for which no device is named have no values, and layers stay unpacked.

    The networks' own device, that of the processor, is then not the one that tensors are on by default, as a card is
    not: an operation that takes both is refused, and so is a value that is read from where there is none.
    """
    with patch.object(torch.backends.mkldnn, "is_available", return_value=False), torch.device("meta"):
        yield


@contextmanager
def unpacked() -> Generator[None]:
    """Load networks as on another device than a processor."""
    with patch.object(torch.backends.mkldnn, "is_available", return_value=False):
        yield


def check_training_elsewhere(stage: TrainingStage) -> None:
    """Compute a step of a stage, whole and in parts, where no tensor but the stage's has values."""
    context = StepContext(1, 0.5, np.random.default_rng(0))
    with like_another_device():
        stage.module.train()
        loss, _ = stage.loss(context)
        loss.backward()
        if isinstance(stage, SplitStage):
            for part, _ in stage.parts(context, 3):
                part.backward()
        stage.after_step(context)
    assert torch.isfinite(loss)
