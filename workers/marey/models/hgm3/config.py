"""Configurations of HGM³: `paper` and `paper-kit` (its published sizes, for HumanML3D and KIT-ML), `starter` and
`open` (two CPU cores), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from marey.core.configs import ADDED, Between, Count, ModelConfig, Momentum, Positive, Share, Weight, Whole, named
from marey.core.errors import InvalidInput
from marey.models.hgm3.spec import SPEC
from marey.training.config_checks import check_body, check_heads, check_windows
from marey.training.optimisation import StageConfig

LEVELS = 3
"""Levels of condition: motion, action, specific."""
Levels = Annotated[int, Between(2)]  # the residual transformer predicts all but the first
Steps = Annotated[int, SPEC.range_of("steps")]
Guidance = Annotated[float, SPEC.range_of("guidance")]
Temperature = Annotated[float, SPEC.range_of("temperature")]
TopK = Annotated[float, SPEC.range_of("top_k")]
Drawing = Annotated[int, SPEC.range_of("drawing")]


@dataclass(frozen=True)
class TokenizerConfig:
    """RVQ-VAE (HGM³ Sec. 3.1, 4.1; architecture and losses after MoMask)."""

    width: Count = 512  # channels of the convolutions
    depth: Count = 3  # residual blocks a stage, dilations 3^(depth-1) … 1
    stages: Count = 2  # each halves the frame rate: 4 frames a token
    dropout: Share = 0.2  # after each residual block
    levels: Levels = 6  # codebooks
    codes: Count = 512  # of a codebook
    code_width: Count = 512  # numbers of a code
    decay: Momentum = 0.99  # of the codebooks' moving averages
    level_dropout: Share = 0.2  # of the samples lose their upper levels in training
    commitment: Weight = 0.02  # β of eq. 2
    feature_bias: Positive = 5.0  # divides the std of root and contacts (MoMask), which gives them more weight
    rotation_weight: Weight = 1.0  # ours: the 6-D block is redundant, export solves rotations from positions
    position_weight: Weight = 0.0  # ours: L1 on joints in the heading frame, metres
    velocity_weight: Weight = 0.0  # ours: L1 on their velocity, m/s; against jitter and skating
    world_weight: Weight = 0.0  # ours: L1 on joints in space, metres; rises over the first half of the budget
    swing_weight: Positive = field(default=1.0, metadata=ADDED)
    """Ours: weight of elbows, wrists and head relative to the other joints, in all terms but that in space."""

    @property
    def frames_per_token(self) -> int:
        """Return the downsampling rate N/n."""
        return 2**self.stages


@dataclass(frozen=True)
class TransformerConfig:
    """One bidirectional transformer."""

    layers: Count = 6
    heads: Count = 6  # of attention; they divide the width
    width: Count = 384
    feedforward: Count = 1024  # width of the hidden layer
    dropout: Share = 0.2  # after attention and the hidden layer
    attention_dropout: Share = 0.2  # on the weights of attention
    norm_first: bool = False  # MoMask's encoders normalise after the residual


@dataclass(frozen=True)
class ConditionConfig:
    """Semantic graph to condition tokens (HGM³ Sec. 3.3)."""

    text_width: Count = 512  # of the text encoder
    max_actions: Whole = 4  # action nodes of a prompt
    max_specifics: Whole = 8  # specific nodes of a prompt
    dropout: Share = 0.1  # on the attention of the graph (GraphMotion)
    drop: Share = 0.1  # share of samples trained without condition, for guidance
    noise: Weight = 0.0  # ours: std of the noise added to standardised text features in training
    standardised: bool = field(default=True, metadata=ADDED)
    """Ours: text features have zero mean and unit deviation over the training captions; else they are the encoder's."""

    @property
    def slots(self) -> int:
        """Return S: one motion slot, then actions, then specifics."""
        return 1 + self.max_actions + self.max_specifics


@dataclass(frozen=True)
class MiningConfig:
    """Hard token mining (HGM³ Sec. 3.2)."""

    mask: Literal["hard", "random"] = "hard"  # random = α is 0 throughout, and the loss predictor is not trained
    alpha_start: Share = 0.0  # α_0 of eq. 8
    alpha_end: Share = 0.5  # α_T of eq. 8
    momentum: Momentum = 0.999  # λ of eq. 6; the paper gives none
    conditions: Literal["all", "motion", "action", "specific"] = field(default="all", metadata=ADDED)
    """Levels of condition that are trained: all, or one alone for the ablation (Tab. 3); "specific" is the full one."""
    levels_per_step: Literal[1, 3] = 3  # 1 = one condition drawn per sample: a third of the cost, unbiased
    replace_random: Share = 0.0  # MoMask: share of masked tokens that show a random token instead of [MASK]
    replace_mask: Share = 1.0  # MoMask: share of the rest that shows [MASK]; the others stay as they are


@dataclass(frozen=True)
class InferenceConfig:
    """Decoding (HGM³ Sec. 3.4)."""

    steps: Steps = 10  # L, passes of the base level
    motion_steps: Annotated[int, SPEC.range_of("motion_steps")] = 2  # L_M, the last pass with the motion node alone
    action_steps: Annotated[int, SPEC.range_of("action_steps")] = 5  # L_A, the last pass without specific nodes
    guidance: Guidance = 4.0  # weight of the prompt at the base level; 1 = none
    temperature: Temperature = 1.0  # randomness of the base level; 0 = the likeliest token
    top_k: TopK = 0.1  # share of the codes that may be drawn
    residual_guidance: Guidance = 5.0  # the same three for the residual levels
    residual_temperature: Temperature = 1.0
    residual_top_k: TopK = 0.1
    drawing: Drawing = 1  # 1 = bundles that draw have rules draw movements; 0 = the network makes all

    def check(self) -> None:
        """Check that no stage ends before the one ahead of it. Raises InvalidInput."""
        if not self.motion_steps <= self.action_steps <= self.steps:
            raise InvalidInput(
                f"must not decrease: motion_steps {self.motion_steps}, action_steps {self.action_steps}, "
                f"steps {self.steps}",
                where="inference",
            )


@dataclass(frozen=True)
class HGM3Config(ModelConfig):
    """Configuration of one bundle: shapes and training."""

    name: str = "paper"  # as manifests show it
    layout: str = "humanml3d-263"  # of the prepared data's features
    features: Count = 263  # D, numbers of a frame
    joints: Count = 22
    fps: Positive = 20.0
    max_frames: Count = 196  # longest motion
    min_frames: Count = 16  # shortest motion
    tokenizer: TokenizerConfig = TokenizerConfig()
    condition: ConditionConfig = ConditionConfig()
    masked: TransformerConfig = TransformerConfig()
    predictor: TransformerConfig = TransformerConfig()
    residual: TransformerConfig = TransformerConfig()
    in_order: bool = False  # ours: prompts of several actions are read in the order of time (`TextSpec.in_order`)
    plain_action: bool = field(default=False, metadata=ADDED)
    """Ours: the action that a prompt asks for is said first in plain words (`TextSpec.plain_action`); captions are
    learned as they are."""
    movements: bool = field(default=False, metadata=ADDED)
    """Ours: the actions of a prompt that asks for several, one after the other, are made one by one
    (`TextSpec.movements`); needs `plain_action`."""
    compact: bool = False
    """Ours: F's output reuses its embeddings, the residual transformer's are the tokenizer's codes. Half the size."""
    phases: Count = field(default=4, metadata=ADDED)
    """Ours: by how many token sequences, from its frames 0, 1, … on, both transformers learn a clip; at most the frames
    of a token. One is learned by heart in fewer steps."""
    speeds: bool = field(default=True, metadata=ADDED)
    """Ours: both transformers learn clips that `data prepare --speed` made slower or faster, too."""
    class_power: Share = field(default=0.5, metadata=ADDED)
    """Ours: how far actions with many clips are drawn more often by both transformers: 1 = as often as they have clips,
    0 = all actions equally often."""
    sequences: Share = field(default=0.46, metadata=ADDED)
    """Ours: share of draws that are sequences of several actions."""
    crops: Share = field(default=0.0, metadata=ADDED)
    """Ours: share of the draws of walks, runs, idles and other actions without beginning and end, of which both
    transformers learn a part of any length."""
    residual_drop: Share = 0.2  # condition drop of the residual transformer
    length_hidden: tuple[Count, ...] = (512, 256, 128)  # widths of the length estimator (MoMask)
    mining: MiningConfig = MiningConfig()
    inference: InferenceConfig = InferenceConfig()
    windows: tuple[Count, ...] = (64,)  # frames; the tokenizer's training windows
    # HGM³ Sec. 4.1: 500 epochs, warm-up over 2000 iterations whatever the budget, and no average of the weights
    train_tokenizer: StageConfig = StageConfig(batch=512, warmup_share=1.0, ema=0.0, epochs=500)
    train_masked: StageConfig = StageConfig(batch=256, warmup_share=1.0, ema=0.0, epochs=500)
    train_residual: StageConfig = StageConfig(batch=64, warmup_share=1.0, ema=0.0, epochs=500)
    train_length: StageConfig = StageConfig(batch=128, learning_rate=1e-3)

    @property
    def max_tokens(self) -> int:
        """Return the length of the longest clip in tokens."""
        return self.max_frames // self.tokenizer.frames_per_token

    @property
    def min_tokens(self) -> int:
        """Return the length of the shortest clip in tokens."""
        return -(-self.min_frames // self.tokenizer.frames_per_token)

    def check(self) -> None:
        """Check sizes against each other; see `ModelConfig.check`."""
        check_body(self.layout, self.features, self.joints, self.fps, (self.min_frames, self.max_frames))
        check_windows(self.windows, self.tokenizer.frames_per_token)
        for name in ("masked", "predictor", "residual"):
            check_heads(name, getattr(self, name).heads, getattr(self, name).width)
        self.inference.check()


PAPER = HGM3Config(condition=ConditionConfig(standardised=False))
PAPER_KIT = replace(
    PAPER,
    name="paper-kit",
    layout="kit-251",
    features=251,
    joints=21,
    fps=12.5,
    train_residual=replace(PAPER.train_residual, batch=32),  # HGM³ Sec. 4.1
)
"""`paper` on KIT-ML."""

STARTER = HGM3Config(
    name="starter",
    tokenizer=TokenizerConfig(
        width=224,
        depth=2,
        code_width=128,
        dropout=0.0,
        rotation_weight=0.1,
        position_weight=5.0,
        velocity_weight=0.5,
        world_weight=2.0,
    ),
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

OPEN = replace(
    STARTER,
    name="open",
    # 81 actions, most of them with one to five takes, must be known by heart: one token sequence for each clip.
    phases=1,
    speeds=False,
    plain_action=True,
    movements=True,
    # Captured walks last three seconds and more; prompts ask for two.
    crops=0.4,
    # Waves and claps must be in the first level: upper levels are drawn without regard to their neighbours.
    tokenizer=replace(STARTER.tokenizer, level_dropout=0.4, swing_weight=4.0),
    residual=replace(STARTER.residual, layers=6, feedforward=768, dropout=0.1),
    # Decoding reads the whole condition from the first pass on; hard masks cost a third of a step.
    mining=replace(STARTER.mining, conditions="specific", mask="random"),
)

TINY = HGM3Config(
    name="tiny",
    tokenizer=TokenizerConfig(
        width=32,
        depth=1,
        levels=3,
        codes=32,
        code_width=16,
        dropout=0.0,
        position_weight=5.0,
        velocity_weight=0.5,
        world_weight=2.0,
    ),
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

CONFIGS: dict[str, HGM3Config] = {c.name: c for c in (PAPER, PAPER_KIT, STARTER, OPEN, TINY)}


def named_config(name: str, *, mask: Literal["hard", "random"] | None = None) -> HGM3Config:
    """Return a configuration by name; `mask` overrides its masking strategy (for the ablation).

    Raises:
        InvalidInput: no such configuration.
    """
    config = named(CONFIGS, name)
    return config if mask is None else replace(config, mining=replace(config.mining, mask=mask))
