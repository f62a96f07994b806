"""Training on a device of a given memory."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

from marey.training import loop, staging
from marey.training.memory import ROOM, MemoryModel


@contextmanager
def device_with_room_for(samples: int, model: MemoryModel) -> Generator[list[int | None]]:
    """Train on a device that fits so many samples of a stage; yield the samples a pass of each training."""
    chosen = list[int | None]()

    def watched(stage: loop.TrainingStage, options: loop.RunOptions, config: dict[str, Any]) -> dict[str, float]:
        chosen.append(options.micro_batch)
        return loop.train(stage, options, config)

    room = int(model.estimate(samples).total / ROOM) + 1
    with patch.object(staging, "device_memory", lambda _: room), patch.object(staging, "train", watched):
        yield chosen
