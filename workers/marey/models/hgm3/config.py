"""Configurations of HGM³: `paper` (its published sizes), `starter` (trains on two CPU cores), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from marey.core.configs import ModelConfig, named
from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class TokenizerConfig:
    """RVQ-VAE (HGM³ Sec. 3.1, 4.1; architecture and losses after MoMask)."""

    width: int = 512
    depth: int = 3  # residual blocks a stage, dilations 3^(depth-1) … 1
    stages: int = 2  # each halves the frame rate: 4 frames a token
    dropout: float = 0.2
    levels: int = 6
    codes: int = 512
    code_width: int = 512
    decay: float = 0.99
    level_dropout: float = 0.2
    commitment: float = 0.02  # β of eq. 2
    feature_bias: float = 5.0  # divides the std of root and contacts (MoMask), which gives them more weight
    rotation_weight: float = 1.0  # ours: the 6-D block is redundant, export solves rotations from positions
    position_weight: float = 5.0  # ours: L1 on joints in the heading frame, metres
    velocity_weight: float = 0.5  # ours: L1 on their velocity, m/s; against jitter and skating
    world_weight: float = 2.0  # ours: L1 on joints in space, metres; rises over the first half of the budget

    @property
    def frames_per_token(self) -> int:
        """Return the downsampling rate N/n."""
        return 2**self.stages


@dataclass(frozen=True)
class TransformerConfig:
    """One bidirectional transformer."""

    layers: int = 6
    heads: int = 6
    width: int = 384
    feedforward: int = 1024
    dropout: float = 0.2
    attention_dropout: float = 0.2
    norm_first: bool = False  # MoMask's encoders normalise after the residual


@dataclass(frozen=True)
class ConditionConfig:
    """Semantic graph to condition tokens (HGM³ Sec. 3.3)."""

    text_width: int = 512
    max_actions: int = 4
    max_specifics: int = 8
    dropout: float = 0.1  # on the attention of the graph (GraphMotion)
    drop: float = 0.1  # share of samples trained without condition, for guidance
    noise: float = 0.0  # ours: std of the noise added to standardised text features in training

    @property
    def slots(self) -> int:
        """Return S: one motion slot, then actions, then specifics."""
        return 1 + self.max_actions + self.max_specifics


@dataclass(frozen=True)
class MiningConfig:
    """Hard token mining (HGM³ Sec. 3.2)."""

    mask: Literal["hard", "random"] = "hard"
    alpha_start: float = 0.0  # α_0
    alpha_end: float = 0.5  # α_T
    momentum: float = 0.999  # λ of eq. 6; the paper gives none
    levels_per_step: Literal[1, 3] = 3  # 1 = one condition drawn per sample: a third of the cost, unbiased
    replace_random: float = 0.0  # MoMask: share of masked tokens that show a random token instead of [MASK]
    replace_mask: float = 1.0  # MoMask: share of the rest that shows [MASK]; the others stay as they are


@dataclass(frozen=True)
class InferenceConfig:
    """Decoding (HGM³ Sec. 3.4)."""

    steps: int = 10  # L
    motion_steps: int = 2  # L_M
    action_steps: int = 5  # L_A
    guidance: float = 4.0
    temperature: float = 1.0
    top_k: float = 0.1  # share of the codes that may be drawn
    residual_guidance: float = 5.0
    residual_temperature: float = 1.0
    residual_top_k: float = 0.1


@dataclass(frozen=True)
class HGM3Config(ModelConfig):
    """Configuration of one bundle: shapes and training."""

    name: str = "paper"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    joints: int = 22
    fps: float = 20.0
    max_frames: int = 196
    min_frames: int = 16
    tokenizer: TokenizerConfig = TokenizerConfig()
    condition: ConditionConfig = ConditionConfig()
    masked: TransformerConfig = TransformerConfig()
    predictor: TransformerConfig = TransformerConfig()
    residual: TransformerConfig = TransformerConfig()
    in_order: bool = False  # ours: prompts of several actions are read in the order of time (`TextSpec.in_order`)
    compact: bool = False
    """Ours: F's output reuses its embeddings, the residual transformer's are the tokenizer's codes. Half the size."""
    residual_drop: float = 0.2  # condition drop of the residual transformer
    length_hidden: tuple[int, ...] = (512, 256, 128)
    mining: MiningConfig = MiningConfig()
    inference: InferenceConfig = InferenceConfig()
    windows: tuple[int, ...] = (64,)  # frames; the tokenizer's training windows
    train_tokenizer: StageConfig = StageConfig(batch=512, ema=0.0)
    train_masked: StageConfig = StageConfig(batch=256)
    train_residual: StageConfig = StageConfig(batch=64)
    train_length: StageConfig = StageConfig(batch=128, learning_rate=1e-3)

    @property
    def max_tokens(self) -> int:
        """Return the length of the longest clip in tokens."""
        return self.max_frames // self.tokenizer.frames_per_token

    @property
    def min_tokens(self) -> int:
        """Return the length of the shortest clip in tokens."""
        return -(-self.min_frames // self.tokenizer.frames_per_token)


PAPER = HGM3Config()

STARTER = HGM3Config(
    name="starter",
    tokenizer=TokenizerConfig(width=224, depth=2, code_width=128, dropout=0.0, rotation_weight=0.1),
    condition=ConditionConfig(text_width=384, max_actions=8, max_specifics=16, noise=0.3),
    in_order=True,
    compact=True,
    masked=TransformerConfig(
        layers=4, heads=4, width=256, feedforward=512, dropout=0.0, attention_dropout=0.0, norm_first=True
    ),
    predictor=TransformerConfig(
        layers=2, heads=4, width=192, feedforward=256, dropout=0.0, attention_dropout=0.0, norm_first=True
    ),
    residual=TransformerConfig(
        layers=4, heads=4, width=192, feedforward=384, dropout=0.0, attention_dropout=0.0, norm_first=True
    ),
    length_hidden=(128,),
    mining=MiningConfig(levels_per_step=1),
    # With all conditions from the first pass on, two actions come in order more often (docs/research/log.md).
    inference=InferenceConfig(motion_steps=0, action_steps=0, temperature=0.5, residual_temperature=0.5),
    windows=(64, 64, 128),
    train_tokenizer=StageConfig(batch=64, learning_rate=6e-4, decay="cosine", ema=0.995),
    train_masked=StageConfig(batch=64, learning_rate=6e-4, decay="cosine", ema=0.998, weight_decay=1e-2),
    train_residual=StageConfig(batch=64, learning_rate=6e-4, decay="cosine", ema=0.998, weight_decay=1e-2),
    train_length=StageConfig(batch=256, learning_rate=1e-3, decay="cosine", ema=0.99),
)

TINY = HGM3Config(
    name="tiny",
    tokenizer=TokenizerConfig(width=32, depth=1, levels=3, codes=32, code_width=16, dropout=0.0),
    condition=ConditionConfig(text_width=384, max_actions=8, max_specifics=16),
    compact=True,
    masked=TransformerConfig(
        layers=2, heads=2, width=32, feedforward=64, dropout=0.1, attention_dropout=0.0, norm_first=True
    ),
    predictor=TransformerConfig(
        layers=1, heads=2, width=32, feedforward=64, dropout=0.1, attention_dropout=0.0, norm_first=True
    ),
    residual=TransformerConfig(
        layers=1, heads=2, width=32, feedforward=64, dropout=0.1, attention_dropout=0.0, norm_first=True
    ),
    length_hidden=(32,),
    windows=(32,),
    train_tokenizer=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_masked=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_residual=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_length=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
)

CONFIGS: dict[str, HGM3Config] = {c.name: c for c in (PAPER, STARTER, TINY)}


def named_config(name: str, *, mask: Literal["hard", "random"] | None = None) -> HGM3Config:
    """Return a configuration by name; `mask` overrides its masking strategy (for the ablation).

    Raises:
        InvalidInput: no such configuration.
    """
    config = named(CONFIGS, name)
    return config if mask is None else replace(config, mining=replace(config.mining, mask=mask))
