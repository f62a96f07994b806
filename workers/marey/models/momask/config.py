"""Configurations of MoMask: `t2m` and `kit` (its published checkpoints), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass

from marey.core.configs import ModelConfig, named


@dataclass(frozen=True)
class TokenizerConfig:
    """RVQ-VAE (MoMask Sec. 3.1)."""

    width: int = 512
    depth: int = 3  # residual blocks a stage, dilations 3^(depth-1) … 1
    stages: int = 2  # each halves the frame rate: 4 frames a token
    levels: int = 6
    codes: int = 512
    code_width: int = 512

    @property
    def dropout(self) -> float:
        """Return 0: imported networks are not trained."""
        return 0.0

    @property
    def frames_per_token(self) -> int:
        """Return the downsampling rate N/n."""
        return 2**self.stages


@dataclass(frozen=True)
class TransformerConfig:
    """One bidirectional transformer, norms after the residuals."""

    layers: int = 8
    heads: int = 6
    width: int = 384
    feedforward: int = 1024


@dataclass(frozen=True)
class InferenceConfig:
    """Decoding (MoMask Sec. 3.4), with the values of the published evaluation on HumanML3D."""

    steps: int = 10
    guidance: float = 4.0
    temperature: float = 1.0
    top_k: float = 0.1  # share of the codes that may be drawn
    residual_guidance: float = 5.0
    residual_temperature: float = 1.0
    residual_top_k: float = 0.1


@dataclass(frozen=True)
class MoMaskConfig(ModelConfig):
    """Configuration of one bundle."""

    name: str = "t2m"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    joints: int = 22
    fps: float = 20.0
    max_frames: int = 196
    min_frames: int = 16
    text_width: int = 512
    tokenizer: TokenizerConfig = TokenizerConfig()
    masked: TransformerConfig = TransformerConfig()
    residual: TransformerConfig = TransformerConfig()
    shared: bool = True
    """The residual transformer embeds levels 1 … V - 2 with the tables that predict them (the published one does)."""
    length_hidden: tuple[int, ...] = (512, 256, 128)
    length_classes: int = 50  # class k means k tokens
    inference: InferenceConfig = InferenceConfig()

    @property
    def max_tokens(self) -> int:
        """Return the length of the longest motion in tokens."""
        return -(-self.max_frames // self.tokenizer.frames_per_token)


T2M = MoMaskConfig()

KIT = MoMaskConfig(
    name="kit",
    layout="kit-251",
    features=251,
    joints=21,
    fps=12.5,
    inference=InferenceConfig(guidance=2.0),  # of the published evaluation on KIT-ML
)

TINY = MoMaskConfig(
    name="tiny",
    text_width=384,  # MiniLM's, which tests and demos have
    tokenizer=TokenizerConfig(width=32, depth=1, levels=3, codes=32, code_width=16),
    masked=TransformerConfig(layers=2, heads=2, width=32, feedforward=64),
    residual=TransformerConfig(layers=1, heads=2, width=32, feedforward=64),
    length_hidden=(32,),
)

CONFIGS: dict[str, MoMaskConfig] = {c.name: c for c in (T2M, KIT, TINY)}


def named_config(name: str) -> MoMaskConfig:
    """Return a configuration by name.

    Raises:
        InvalidInput: no such configuration.
    """
    return named(CONFIGS, name)
