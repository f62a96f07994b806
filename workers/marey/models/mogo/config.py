"""Configurations of MOGO: `paper` and `paper-kit` (its published sizes, for HumanML3D and KIT-ML), `starter` (trains on
two CPU cores), `tiny` (tests)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated

from marey.core.configs import ADDED, Count, ModelConfig, Momentum, Part, Positive, Share, Weight, Whole, named
from marey.core.errors import InvalidInput
from marey.models.mogo.spec import SPEC
from marey.nn.scaled_quantizer import Scale
from marey.training.config_checks import check_body, check_heads, check_windows
from marey.training.optimisation import StageConfig

Guidance = Annotated[float, SPEC.range_of("guidance")]
Temperature = Annotated[float, SPEC.range_of("temperature")]
TopK = Annotated[float, SPEC.range_of("top_k")]


@dataclass(frozen=True)
class TokenizerConfig:
    """MoSA-VQ (MOGO Sec. 2.1): one token column a frame."""

    width: Count = 512  # channels of the convolutions
    depth: Count = 3  # residual blocks, dilations 3^(depth-1) … 1; one stage, as in the public options
    dropout: Share = 0.0  # after each residual block
    levels: Count = 6  # codebooks
    codes: Count = 8192  # of a codebook
    code_width: Count = 128  # numbers of a code
    decay: Momentum = 0.99  # of the codebooks' moving averages
    level_dropout: Share = 0.2  # of the samples lose their upper levels in training
    scale: Scale = "elementwise"  # of eq. 1: one a number, one a level, or none
    feature_bias: Positive = 5.0  # divides the std of root and contacts (MoMask), which gives them more weight
    commitment: Weight = 0.02  # β of eq. 6
    regularizer: Weight = 0.02  # γ of eq. 6; the paper gives none
    rotation_weight: Weight = 1.0  # ours: the 6-D block is redundant, export solves rotations from positions
    position_weight: Weight = 0.0  # ours: L1 on joints in the heading frame, metres
    velocity_weight: Weight = 0.0  # ours: L1 on their velocity, m/s; against jitter and skating
    world_weight: Weight = 0.0  # ours: L1 on joints in space, metres; rises over the first half of the budget
    swing_weight: Positive = field(default=1.0, metadata=ADDED)
    """Ours: weight of elbows, wrists and head relative to the other joints, in all terms but that in space."""


@dataclass(frozen=True)
class TransformerConfig:
    """The one causal transformer that all levels share."""

    layers: Count = 18
    heads: Count = 16  # of attention; they divide the width
    width: Count = 1024
    feedforward: Count = 4096  # width of the hidden layer
    dropout: Share = 0.15  # after attention and the hidden layer
    level_gain: bool = False
    """Ours: each level has its own gains on the shared embedding. Without them, a sum of embeddings does not show which
    level a code came from."""
    level_token: bool = field(default=False, metadata=ADDED)
    """For comparison (Tab. 7): the level is a token of its own behind the prompt, not an embedding beside it (PnQ)."""
    joint: bool = False
    """Ours: one sequence of whole frames for all levels; the depth head, which it needs, separates the levels. A sixth
    of the trunk's work."""


@dataclass(frozen=True)
class DepthConfig:
    """Depth head (ours): a small transformer across the levels of one frame; 0 layers draw levels independently."""

    layers: Whole = 0
    heads: Count = 8  # of attention; they divide the width
    width: Count = 512
    feedforward: Count = 1024  # width of the hidden layer
    share: Part = 1.0  # of the frames whose loss covers all levels; the others cover level 0 alone


@dataclass(frozen=True)
class ConditionConfig:
    """The prompt, one vector per sentence."""

    text_width: Count = 768  # of the text encoder
    drop: Share = 0.1  # share of samples trained without prompt, for guidance
    every_frame: bool = False  # ours: the current prompt is added to every frame, beside being position 0
    noise: Weight = 0.0  # ours: std of the noise added to standardised text features in training
    standardised: bool = field(default=True, metadata=ADDED)
    """Ours: text features have zero mean and unit deviation over the training captions; else they are the encoder's."""
    clock: bool = False  # ours: the time since its action began is added to every frame
    clockless: Share = 0.3  # share of actions without that time in training: a stream outlasts every capture


@dataclass(frozen=True)
class InferenceConfig:
    """Sampling of tokens."""

    temperature: Temperature = 1.0  # randomness of level 0; 0 = the likeliest code
    top_k: TopK = 0.1  # share of the codes that level 0 may draw
    upper_temperature: Temperature = 0.6  # of all other levels: against jitter
    upper_top_k: TopK = 0.1  # share of the codes that all other levels may draw
    guidance: Guidance = 1.0  # of level 0; 1 = off, anything else doubles the cost of the trunk
    upper_guidance: Guidance = 1.0  # of all other levels: level 0 decides the action, the others its details
    window: Count = 196  # frames that attention reaches back, at most `max_frames`


@dataclass(frozen=True)
class MOGOConfig(ModelConfig):
    """Configuration of one bundle."""

    name: str = "paper"  # as manifests show it
    layout: str = "humanml3d-263"  # of the prepared data's features
    features: Count = 263  # D, numbers of a frame
    joints: Count = 22
    fps: Positive = 20.0
    min_frames: Count = 16  # shortest motion; END is ignored before
    max_frames: Count = 196  # longest training sequence: no relative distance beyond it is learned
    longest_frames: Whole = field(default=0, metadata=ADDED)
    """Longest motion; 0 = `max_frames`. Beyond it attention reaches back `inference.window` frames, as in streams."""
    corruption: Share = 0.5  # whole frame columns are replaced at a rate drawn from U(0, this), a sample
    first_level: Positive = 1.0  # weight of level 0 in the loss, to 1 of each other level
    ahead: tuple[Count, ...] = ()
    """Ours: frames by which level 0 is also predicted ahead of the next one (Gloeckle et al. 2024, "Better & Faster
    Large Language Models via Multi-token Prediction"). The past determines the next frame; the prompt determines the
    frame a second later."""
    ahead_weight: Weight = 1.0  # of that loss, to 1 of the loss of eq. 11
    steers: Whole = 0  # motions whose prompt changes at any moment, made for training (ours, see `steers`)
    rollouts: Whole = (
        0  # further ones that start from the model's own motions, where training starts from a finished one
    )
    crops: Share = field(default=0.4, metadata=ADDED)
    """Ours: share of the training samples that begin in motion, as a stream past its window does."""
    split_actions: bool = field(default=True, metadata=ADDED)
    """Ours: each action of a prompt is drawn by itself, one after another (`TextSpec.split_actions`); else the sentence
    is the prompt of all frames, as published."""
    float_logits: bool = field(default=False, metadata=ADDED)
    """The last matrix stays in float32 where matrices are in bfloat16, in which codes tie; earlier bundles drew so."""
    tokenizer: TokenizerConfig = TokenizerConfig()
    condition: ConditionConfig = ConditionConfig()
    transformer: TransformerConfig = TransformerConfig()
    depth: DepthConfig = DepthConfig()
    inference: InferenceConfig = InferenceConfig()
    windows: tuple[Count, ...] = (64,)  # frames; the tokenizer's training windows
    # the paper names no optimiser, batch or rate; as in HGM³, the weights are not averaged
    train_tokenizer: StageConfig = StageConfig(batch=256, ema=0.0)
    train_transformer: StageConfig = StageConfig(batch=64, learning_rate=1e-4, ema=0.0)

    def __post_init__(self) -> None:
        """Refuse a joint sequence without a depth head: its levels would be indistinguishable. It has no level that a
        token could name."""
        if self.transformer.joint and not self.depth.layers:
            raise InvalidInput("one sequence for all levels needs a depth head", where="transformer.joint")
        if self.transformer.joint and self.transformer.level_token:
            raise InvalidInput("one sequence for all levels has no level to name", where="transformer.level_token")

    @property
    def longest(self) -> int:
        """Return the frames of the longest motion."""
        return self.longest_frames or self.max_frames

    def check(self) -> None:
        """Check sizes against each other; see `ModelConfig.check`."""
        if self.longest < self.max_frames:
            raise InvalidInput(f"is under max_frames, {self.max_frames}", where="longest_frames")
        check_body(self.layout, self.features, self.joints, self.fps, (self.min_frames, self.max_frames))
        check_windows(self.windows, 1)
        check_heads("transformer", self.transformer.heads, self.transformer.width)
        check_heads("depth", self.depth.heads, self.depth.width)
        if self.inference.window > self.max_frames:
            raise InvalidInput(
                f"{self.inference.window} is over max_frames, {self.max_frames}: distances beyond are not learned",
                where="inference.window",
            )


# The paper generates up to 260 frames of cyclic motions (Sec. 5).
PAPER = MOGOConfig(
    longest_frames=260,
    crops=0.0,
    split_actions=False,
    float_logits=True,
    condition=ConditionConfig(standardised=False),
)
PAPER_KIT = replace(PAPER, name="paper-kit", layout="kit-251", features=251, joints=21, fps=12.5)
"""`paper` on KIT-ML."""

STARTER = MOGOConfig(
    name="starter",
    float_logits=True,
    corruption=1.0,  # with .5 the last frame predicts the next so well that the model ignores prompts
    first_level=5.0,  # level 0 decides the action; the others its details
    ahead=(5, 12, 24),
    steers=4000,
    rollouts=3000,
    # 220,000 training frames cannot fill 6 x 8192 codes
    tokenizer=TokenizerConfig(
        width=192, codes=512, rotation_weight=0.1, position_weight=5.0, velocity_weight=0.5, world_weight=2.0
    ),
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

OPEN = replace(STARTER, name="open")
"""`starter` on the open data sets."""

TINY = MOGOConfig(
    name="tiny",
    float_logits=True,
    max_frames=24,
    ahead=(3,),
    steers=6,
    rollouts=6,
    tokenizer=TokenizerConfig(
        width=24, depth=2, levels=3, codes=32, code_width=16, position_weight=5.0, velocity_weight=0.5, world_weight=2.0
    ),
    condition=ConditionConfig(text_width=384, every_frame=True, clock=True),
    transformer=TransformerConfig(layers=2, heads=2, width=32, feedforward=64, dropout=0.1, level_gain=True),
    depth=DepthConfig(layers=1, heads=2, width=16, feedforward=32, share=0.5),
    inference=InferenceConfig(window=16),
    windows=(32,),
    train_tokenizer=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_transformer=StageConfig(batch=4, learning_rate=1e-3, ema=0.9),
)

CONFIGS: dict[str, MOGOConfig] = {c.name: c for c in (PAPER, PAPER_KIT, STARTER, OPEN, TINY)}


def named_config(name: str) -> MOGOConfig:
    """Return a configuration by name.

    Raises:
        InvalidInput: no such configuration.
    """
    return named(CONFIGS, name)
