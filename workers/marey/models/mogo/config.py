"""Configurations of MOGO: `paper` (its published sizes), `starter` (trains on two CPU cores), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass

from marey.core.configs import ModelConfig, named
from marey.core.errors import InvalidInput
from marey.nn.scaled_quantizer import Scale
from marey.training.optimisation import StageConfig


@dataclass(frozen=True)
class TokenizerConfig:
    """MoSA-VQ (MOGO Sec. 2.1): one token column a frame."""

    width: int = 512
    depth: int = 3  # residual blocks, dilations 3^(depth-1) … 1; one stage, as in the public options
    dropout: float = 0.0
    levels: int = 6
    codes: int = 8192
    code_width: int = 128
    decay: float = 0.99
    level_dropout: float = 0.2
    scale: Scale = "elementwise"
    feature_bias: float = 5.0  # as in HGM³
    commitment: float = 0.02  # β of eq. 6
    regularizer: float = 0.02  # γ of eq. 6; the paper gives none
    rotation_weight: float = 1.0  # the rest as in HGM³ (ours): see its `TokenizerConfig`
    position_weight: float = 5.0
    velocity_weight: float = 0.5
    world_weight: float = 2.0


@dataclass(frozen=True)
class TransformerConfig:
    """The one causal transformer that all levels share."""

    layers: int = 18
    heads: int = 16
    width: int = 1024
    feedforward: int = 4096
    dropout: float = 0.15
    level_gain: bool = False
    """Ours: each level has its own gains on the shared embedding. Without them, a sum of embeddings does not show which
    level a code came from."""
    joint: bool = False
    """Ours: one sequence of whole frames for all levels; the depth head, which it needs, separates the levels. A sixth
    of the trunk's work."""


@dataclass(frozen=True)
class DepthConfig:
    """Depth head (ours): a small transformer across the levels of one frame; 0 layers draw levels independently."""

    layers: int = 0
    heads: int = 8
    width: int = 512
    feedforward: int = 1024
    share: float = 1.0  # of the frames whose loss covers all levels; the others cover level 0 alone


@dataclass(frozen=True)
class ConditionConfig:
    """The prompt, one vector per sentence."""

    text_width: int = 768
    drop: float = 0.1  # share of samples trained without prompt, for guidance
    every_frame: bool = False  # ours: the current prompt is added to every frame, beside being position 0
    noise: float = 0.0  # ours: std of the noise added to standardised text features in training
    clock: bool = False  # ours: the time since its action began is added to every frame
    clockless: float = 0.3  # share of actions without that time in training: a stream outlasts every capture


@dataclass(frozen=True)
class InferenceConfig:
    """Sampling of tokens."""

    temperature: float = 1.0  # of level 0
    top_k: float = 0.1  # share of the codes that level 0 may draw
    upper_temperature: float = 0.6  # of all other levels: against jitter
    upper_top_k: float = 0.1
    guidance: float = 1.0  # of level 0; 1 = off, anything else doubles the cost of the trunk
    upper_guidance: float = 1.0  # of all other levels: level 0 decides the action, the others its details
    window: int = 196  # frames that attention reaches back, at most `max_frames`


@dataclass(frozen=True)
class MOGOConfig(ModelConfig):
    """Configuration of one bundle."""

    name: str = "paper"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    joints: int = 22
    fps: float = 20.0
    min_frames: int = 16  # shortest motion; END is ignored before
    max_frames: int = 196  # longest training sequence: no relative distance beyond it is learned
    corruption: float = 0.5  # whole frame columns are replaced at a rate drawn from U(0, this), a sample
    first_level: float = 1.0  # weight of level 0 in the loss, to 1 of each other level
    ahead: tuple[int, ...] = ()
    """Ours: frames by which level 0 is also predicted ahead of the next one (Gloeckle et al. 2024, "Better & Faster
    Large Language Models via Multi-token Prediction"). The past determines the next frame; the prompt determines the
    frame a second later."""
    ahead_weight: float = 1.0  # of that loss, to 1 of the loss of eq. 11
    steers: int = 0  # motions whose prompt changes at any moment, made for training (ours, see `steers`)
    rollouts: int = 0  # further ones that start from the model's own motions, where training starts from a finished one
    tokenizer: TokenizerConfig = TokenizerConfig()
    condition: ConditionConfig = ConditionConfig()
    transformer: TransformerConfig = TransformerConfig()
    depth: DepthConfig = DepthConfig()
    inference: InferenceConfig = InferenceConfig()
    windows: tuple[int, ...] = (64,)  # frames; the tokenizer's training windows
    train_tokenizer: StageConfig = StageConfig(batch=256, ema=0.0)
    train_transformer: StageConfig = StageConfig(batch=64, learning_rate=1e-4)

    def __post_init__(self) -> None:
        """Refuse a joint sequence without a depth head: its levels would be indistinguishable."""
        if self.transformer.joint and not self.depth.layers:
            raise InvalidInput("one sequence for all levels needs a depth head", where="transformer.joint")


PAPER = MOGOConfig()

STARTER = MOGOConfig(
    name="starter",
    corruption=1.0,  # with .5 the last frame predicts the next so well that the model ignores prompts
    first_level=5.0,  # level 0 decides the action; the others its details
    ahead=(5, 12, 24),
    steers=4000,
    rollouts=3000,
    # 220,000 training frames cannot fill 6 x 8192 codes
    tokenizer=TokenizerConfig(width=192, codes=512, rotation_weight=0.1),
    condition=ConditionConfig(text_width=384, noise=0.3, every_frame=True, clock=True),
    transformer=TransformerConfig(
        layers=4, heads=4, width=256, feedforward=512, dropout=0.15, level_gain=True, joint=True
    ),
    depth=DepthConfig(layers=2, heads=4, width=192, feedforward=384, share=0.25),
    inference=InferenceConfig(temperature=0.8, guidance=3.5, upper_guidance=2.0),  # chosen on development prompts
    windows=(64, 64, 128),
    train_tokenizer=StageConfig(batch=48, learning_rate=6e-4, decay="cosine", ema=0.995),
    train_transformer=StageConfig(batch=24, learning_rate=8e-4, decay="cosine", ema=0.997, weight_decay=1e-2),
)

TINY = MOGOConfig(
    name="tiny",
    max_frames=24,
    ahead=(3,),
    steers=6,
    rollouts=6,
    tokenizer=TokenizerConfig(width=24, depth=2, levels=3, codes=32, code_width=16),
    condition=ConditionConfig(text_width=384, every_frame=True, clock=True),
    transformer=TransformerConfig(layers=2, heads=2, width=32, feedforward=64, dropout=0.1, level_gain=True),
    depth=DepthConfig(layers=1, heads=2, width=16, feedforward=32, share=0.5),
    inference=InferenceConfig(window=16),
    windows=(32,),
    train_tokenizer=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_transformer=StageConfig(batch=4, learning_rate=1e-3, ema=0.9),
)

CONFIGS: dict[str, MOGOConfig] = {c.name: c for c in (PAPER, STARTER, TINY)}


def named_config(name: str) -> MOGOConfig:
    """Return a configuration by name.

    Raises:
        InvalidInput: no such configuration.
    """
    return named(CONFIGS, name)
