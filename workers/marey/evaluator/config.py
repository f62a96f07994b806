"""Configurations of the TMR-style evaluator: `paper` (its published sizes), `starter` (two CPU cores), `tiny`
(tests)."""

from __future__ import annotations

from dataclasses import dataclass

from marey.core.configs import ModelConfig, named
from marey.core.errors import InvalidInput
from marey.motion.features import layout
from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class NetworkConfig:
    """Each of the three transformers: motion encoder, text encoder, motion decoder."""

    layers: int = 6
    heads: int = 4
    width: int = 256  # of the embeddings as well
    feedforward: int = 1024
    dropout: float = 0.1


@dataclass(frozen=True)
class LossConfig:
    """Weights of the losses beside the reconstruction's 1 (SnapMoGen App. B.2)."""

    divergence: float = 1e-5  # λ_KL
    latent: float = 1e-5  # λ_E
    contrast: float = 0.1  # λ_NCE
    temperature: float = 0.1  # of InfoNCE: TMR's, the appendix does not give one


@dataclass(frozen=True)
class EvaluatorConfig(ModelConfig):
    """Configuration of one bundle."""

    name: str = "paper"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    fps: float = 20.0
    inputs: int = 67
    """I, the first numbers of a frame that the network reads: root and joint positions. The 6-D block behind them is
    not a local rotation in this layout, and velocities follow from positions."""
    min_frames: int = 16
    max_frames: int = 196
    frames_per_token: int = 1
    """Frames that are concatenated to one token of the motion encoder (ours; 1 is the paper's). No number is dropped,
    and the transformers, which are nearly all of the work, read that many times fewer tokens."""
    text_width: int = 768  # W, of T5-base in the paper
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    train_tmr: StageConfig = StageConfig(batch=64, learning_rate=1e-4)  # the batch is App. B.2's, the rate TMR's

    def __post_init__(self) -> None:
        """Refuse values that contradict the layout."""
        known = layout(self.layout)
        if (known.dim, known.fps) != (self.features, self.fps) or not 0 < self.inputs <= self.features:
            raise InvalidInput(f"does not fit {self.layout}: {known.dim} numbers at {known.fps:g} fps", where="layout")

    @property
    def width(self) -> int:
        """Return E, the width of an embedding."""
        return self.network.width


PAPER = EvaluatorConfig()

STARTER = EvaluatorConfig(
    name="starter",
    frames_per_token=4,
    text_width=384,
    # 128 wide: with five times as many test clips (928 of 640) the covariance in FID has enough samples
    network=NetworkConfig(layers=4, width=128, feedforward=512),
    train_tmr=StageConfig(batch=64, learning_rate=5e-4, decay="cosine", ema=0.997, weight_decay=1e-2),
)

TINY = EvaluatorConfig(
    name="tiny",
    frames_per_token=4,
    text_width=384,
    network=NetworkConfig(layers=1, heads=2, width=16, feedforward=32),
    train_tmr=StageConfig(batch=8, learning_rate=2e-3, ema=0.9),
)

CONFIGS: dict[str, EvaluatorConfig] = {c.name: c for c in (PAPER, STARTER, TINY)}


def named_config(name: str) -> EvaluatorConfig:
    """Return a configuration by name.

    Raises:
        InvalidInput: the name is unknown.
    """
    return named(CONFIGS, name)
