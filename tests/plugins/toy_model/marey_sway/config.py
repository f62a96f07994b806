"""The configuration of Sway, as its bundle and checkpoints hold it."""

from __future__ import annotations

from dataclasses import dataclass

from marey.core.configs import ModelConfig
from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class Inference:
    """Defaults of the settings."""

    width: float = 0.1
    beats: int = 2


@dataclass(frozen=True)
class SwayConfig(ModelConfig):
    """Configuration of a bundle; `min_frames` and `max_frames` are its range of lengths."""

    name: str = "starter"
    layout: str = "humanml3d-263"
    fps: float = 20.0
    min_frames: int = 16
    max_frames: int = 196
    side: str = "left"
    inference: Inference = Inference()
    train_pose: StageConfig = StageConfig(batch=1)
