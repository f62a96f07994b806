"""Configurations of the TMR-style evaluator: `paper` (its published sizes), `starter` (two CPU cores), `tiny`
(tests)."""

from __future__ import annotations

from dataclasses import dataclass, field

from marey.core.configs import ADDED, Count, ModelConfig, Positive, Share, Weight, named
from marey.core.errors import InvalidInput
from marey.motion.features import layout
from marey.training.config_checks import check_heads
from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class NetworkConfig:
    """Each of the three transformers: motion encoder, text encoder, motion decoder."""

    layers: Count = 6
    heads: Count = 4  # of attention; they divide the width
    width: Count = 256  # of the embeddings as well
    feedforward: Count = 1024  # width of the hidden layer
    dropout: Share = 0.1  # after attention and the hidden layer


@dataclass(frozen=True)
class LossConfig:
    """Weights of the losses beside the reconstruction's 1 (SnapMoGen App. B.2)."""

    divergence: Weight = 1e-5  # λ_KL
    latent: Weight = 1e-5  # λ_E
    contrast: Weight = 0.1  # λ_NCE
    temperature: Positive = 0.1  # of InfoNCE: TMR's, the appendix does not give one
    spare_same_label: bool = field(default=True, metadata=ADDED)
    """Ours: motions of the pair's own label are no negatives of InfoNCE; else all others of the batch are."""


@dataclass(frozen=True)
class EvaluatorConfig(ModelConfig):
    """Configuration of one bundle."""

    name: str = "paper"  # as manifests show it
    layout: str = "humanml3d-263"  # of the prepared data's features
    features: Count = 263  # D, numbers of a frame
    fps: Positive = 20.0
    inputs: Count = 67
    """I, the first numbers of a frame that the network reads: root and joint positions. The 6-D block behind them is
    not a local rotation in this layout, and velocities follow from positions."""
    min_frames: Count = 16  # shortest motion
    max_frames: Count = 196  # longest motion
    frames_per_token: Count = 1
    """Frames that are concatenated to one token of the motion encoder (ours; 1 is the paper's). No number is dropped,
    and the transformers, which are nearly all of the work, read that many times fewer tokens."""
    text_width: Count = 768  # W, of T5-base in the paper
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    train_tmr: StageConfig = StageConfig(batch=64, learning_rate=1e-4)  # the batch is App. B.2's, the rate TMR's

    def __post_init__(self) -> None:
        """Refuse values that contradict the layout."""
        known = layout(self.layout)
        if (known.dim, known.fps) != (self.features, self.fps) or not 0 < self.inputs <= self.features:
            raise InvalidInput(f"does not fit {self.layout}: {known.dim} numbers at {known.fps:g} fps", where="layout")

    def check(self) -> None:
        """Check sizes against each other; see `ModelConfig.check`."""
        check_heads("network", self.network.heads, self.network.width)
        if self.min_frames > self.max_frames:
            raise InvalidInput(f"{self.min_frames} is over max_frames, {self.max_frames}", where="min_frames")

    @property
    def width(self) -> int:
        """Return E, the width of an embedding."""
        return self.network.width


PAPER = EvaluatorConfig(loss=LossConfig(spare_same_label=False))

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
