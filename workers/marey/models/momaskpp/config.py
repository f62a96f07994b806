"""Configurations of MoMask++: `paper` and the two published ones, `starter` (trains on two CPU cores), `tiny` (tests).

Guo et al., "SnapMoGen: Human Motion Generation from Expressive Texts", 2025. The published configurations differ from
the paper in heads, steps and guidance; their weights need them as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Annotated, Literal

from marey.core.configs import ADDED, Count, ModelConfig, named
from marey.models.momaskpp.spec import SPEC
from marey.training.optimisation import StageConfig

Layout = Literal["padded", "own"]
Conditioning = Literal["in-context", "cross-attention"]
Steps = Annotated[int, SPEC.range_of("steps")]
Guidance = Annotated[float, SPEC.range_of("guidance")]
Temperature = Annotated[float, SPEC.range_of("temperature")]
TopK = Annotated[float, SPEC.range_of("top_k")]


@dataclass(frozen=True)
class TokenizerConfig:
    """Multi-scale RVQ-VAE with one codebook (Sec. 4.2.1)."""

    width: int = 512
    depth: int = 3  # residual blocks a stage, dilations 3^(depth-1) … 1
    stages: int = 2  # each halves the frame rate: 4 frames a token
    dropout: float = 0.2
    attention: bool = field(default=True, metadata=ADDED)  # behind the residual blocks of each stage
    attention_heads: int = 4
    attention_dropout: float = 0.1
    scales: tuple[int, ...] = (8, 4, 2, 1)  # full-scale tokens a token, coarse to fine
    layout: Layout = "own"
    """`own`: scale s of n tokens has max(1, n // s), spread over the clip (eq. 5). `padded`, as published weights need
    it: scales are spread over the longest clip, whatever the clip's length; n // s of them are read."""
    codes: int = 512  # K
    code_width: int = 512  # d
    decay: float = 0.99  # of the moving averages that codes are
    gumbel: float = 0.5  # temperature of the draw of codes in training; 0 = the nearest code
    commitment: float = 0.2  # of the mean over clips, tokens and channels: published 0.02 · 512 / T, T padded tokens
    feature_bias: float = 5.0  # divides the std of root and contacts (MoMask), which gives them more weight
    root_weight: float = 0.0  # smooth L1 once more on the root's four columns
    essential: tuple[int, int] = (4, 67)  # columns that L_ess of eq. 6 covers
    essential_weight: float = 2.0  # λ_ess
    rotation_weight: float = 1.0  # ours: of the 6-D rotations among all features, where layouts hold positions too
    position_weight: float = 0.0  # ours: L1 on joints in the heading frame, metres; 0 where the layout has no such loss
    velocity_weight: float = 0.0  # ours: L1 on their velocity, m/s
    world_weight: float = 0.0  # ours: L1 on joints in space, metres; rises over the first half of the budget
    swing_weight: float = field(default=1.0, metadata=ADDED)
    """Ours: weight of elbows, wrists and head relative to the other joints, in all terms but that in space."""

    @property
    def frames_per_token(self) -> int:
        """Return the downsampling rate N/n."""
        return 2**self.stages

    @property
    def levels(self) -> int:
        """Return the number of codebooks: all scales share one."""
        return 1


@dataclass(frozen=True)
class TextConfig:
    """Word-level states of a text encoder (Sec. 4.2.2)."""

    width: int = 768
    max_words: int = 20  # tokens of the encoder, special ones included; the rest of a prompt is not read
    noise: float = 0.0  # ours: std of the noise added to standardised states in training
    drop: float = 0.1  # share of samples trained without text, for guidance


@dataclass(frozen=True)
class TransformerConfig:
    """The masked transformer over the tokens of all scales."""

    conditioning: Conditioning = "cross-attention"
    layers: int = 8  # blocks
    heads: int = 6  # of attention
    width: int = 384  # w
    feedforward: int = 1024  # width between the two matrices of a block
    embedding: int = 512  # width of the table of tokens, before its projection
    dropout: float = 0.2
    attention_dropout: float = 0.2
    norm_first: bool = False  # norms before attention and feed-forward, not behind the residuals


@dataclass(frozen=True)
class RefinerConfig:
    """Root refiner, which predicts the root's velocity from everything else; width 0 = none."""

    width: int = 0
    depth: int = 3  # residual blocks
    dropout: float = 0.2
    window: int = 120  # frames, in training
    noise: float = 0.1  # std of the noise on its input in training, times one uniform number a batch


@dataclass(frozen=True)
class PerturbationConfig:
    """Tokens that the transformer is shown in training (MoMask's replacing and remasking, Sec. 4.2.2)."""

    replace_random: float = 0.1  # share of masked tokens that show a random token
    replace_mask: float = 0.88  # share of the other masked tokens that show [MASK]; the rest stay as they are
    perturb: float = 0.1  # share of tokens not masked that show a random token
    padded_counts: bool = False  # count masked tokens on the padded length, as published: short clips may get none


@dataclass(frozen=True)
class InferenceConfig:
    """Decoding (Sec. 4.2.2)."""

    steps: Steps = 18  # L
    guidance: Guidance = 4.0  # weight of the text; 1 = none
    temperature: Temperature = 1.0  # of the draws; 0 = the likeliest token
    top_k: TopK = 0.1  # share of the codes that may be drawn


@dataclass(frozen=True)
class MoMaskPPConfig(ModelConfig):
    """Configuration of one bundle: shapes and training."""

    name: str = "paper"
    layout: str = "humanml3d-263"
    features: int = 263  # D
    joints: int = 22
    fps: float = 20.0
    max_frames: int = 196
    min_frames: int = 16
    tokenizer: TokenizerConfig = TokenizerConfig()
    text: TextConfig = TextConfig()
    masked: TransformerConfig = TransformerConfig()
    refiner: RefinerConfig = RefinerConfig()
    length_hidden: tuple[int, ...] = ()
    """Ours: hidden widths of the length estimator, which reads the whole sentence; empty = none, as published."""
    open_frames: tuple[int, ...] = (140, 160, 180)
    """Without an estimator, a motion of no given length has one of these frames, by its seed."""
    perturbation: PerturbationConfig = PerturbationConfig()
    inference: InferenceConfig = InferenceConfig()
    windows: tuple[int, ...] = (196,)  # frames; the tokenizer's training windows, clips are whole where they fit
    phases: Count = field(default=4, metadata=ADDED)
    """Token grids of a training clip that the transformer learns, each a frame later than the one before."""
    speeds: bool = field(default=True, metadata=ADDED)
    """True: the transformer also learns clips that were made slower or faster than captured."""
    train_tokenizer: StageConfig = StageConfig(batch=256, learning_rate=3e-4, weight_decay=0.0, clip=0.5, ema=0.0)
    train_masked: StageConfig = StageConfig(batch=64, ema=0.0)
    train_refiner: StageConfig = StageConfig(batch=256, clip=0.5, ema=0.0)
    train_length: StageConfig = StageConfig(batch=128, learning_rate=1e-3)

    @property
    def max_tokens(self) -> int:
        """Return T, the length of the longest clip in tokens of the full scale."""
        return self.max_frames // self.tokenizer.frames_per_token

    @property
    def min_tokens(self) -> int:
        """Return the length of the shortest clip in tokens of the full scale."""
        return -(-self.min_frames // self.tokenizer.frames_per_token)

    @property
    def has_refiner(self) -> bool:
        """Return True if a bundle holds a root refiner."""
        return self.refiner.width > 0

    @property
    def has_length(self) -> bool:
        """Return True if a bundle holds a length estimator."""
        return bool(self.length_hidden)


PAPER = MoMaskPPConfig()

RELEASED_HUMANML3D = MoMaskPPConfig(
    name="released-humanml3d",
    tokenizer=TokenizerConfig(layout="padded", commitment=0.209, essential_weight=0.5),
    perturbation=PerturbationConfig(padded_counts=True),
    inference=InferenceConfig(steps=18, guidance=5.0),
)

RELEASED_SNAPMOGEN = MoMaskPPConfig(
    name="released-snapmogen",
    layout="snapmogen-296",
    features=296,
    joints=24,
    fps=30.0,
    max_frames=320,
    min_frames=32,
    tokenizer=TokenizerConfig(
        layout="padded",
        scales=(2, 1),
        codes=2048,
        commitment=0.128,
        feature_bias=1.0,
        root_weight=1.5,
        essential=(0, 148),
    ),
    text=TextConfig(max_words=120),
    masked=TransformerConfig(heads=8),
    refiner=RefinerConfig(width=512),
    open_frames=(208, 240, 272),
    perturbation=PerturbationConfig(padded_counts=True),
    inference=InferenceConfig(steps=16, guidance=4.0),
    windows=(320,),
)

STARTER = MoMaskPPConfig(
    name="starter",
    tokenizer=TokenizerConfig(
        width=224,
        depth=2,
        dropout=0.0,
        attention_dropout=0.0,
        code_width=128,
        gumbel=0.0,
        essential_weight=0.5,
        rotation_weight=0.1,
        position_weight=5.0,
        velocity_weight=0.5,
        world_weight=2.0,
    ),
    text=TextConfig(width=384, max_words=48, noise=0.3),
    masked=TransformerConfig(
        conditioning="in-context",
        layers=4,
        heads=4,
        width=256,
        feedforward=512,
        embedding=128,
        dropout=0.0,
        attention_dropout=0.0,
        norm_first=True,
    ),
    length_hidden=(128,),
    perturbation=PerturbationConfig(replace_random=0.0, replace_mask=1.0),
    inference=InferenceConfig(steps=10, guidance=4.0, temperature=0.5),
    windows=(64, 64, 128),
    train_tokenizer=StageConfig(batch=64, learning_rate=6e-4, decay="cosine", ema=0.995),
    train_masked=StageConfig(batch=64, learning_rate=6e-4, decay="cosine", ema=0.998, weight_decay=1e-2),
    train_length=StageConfig(batch=256, learning_rate=1e-3, decay="cosine", ema=0.99),
)

OPEN = replace(
    STARTER,
    name="open",
    tokenizer=replace(STARTER.tokenizer, codes=1024),
    # As of the other models' `open`: most actions have one to five takes and must be known by heart.
    phases=1,
    speeds=False,
)

TINY = MoMaskPPConfig(
    name="tiny",
    tokenizer=TokenizerConfig(
        width=32, depth=1, dropout=0.0, attention_dropout=0.0, codes=32, code_width=16, position_weight=1.0
    ),
    text=TextConfig(width=384, max_words=12, noise=0.1),
    masked=TransformerConfig(
        layers=2, heads=2, width=32, feedforward=64, embedding=16, dropout=0.1, attention_dropout=0.0
    ),
    refiner=RefinerConfig(width=16, depth=1, dropout=0.0, window=32),
    length_hidden=(32,),
    inference=InferenceConfig(steps=6),
    windows=(32, 64),
    train_tokenizer=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_masked=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_refiner=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
    train_length=StageConfig(batch=8, learning_rate=1e-3, ema=0.9),
)

CONFIGS: dict[str, MoMaskPPConfig] = {
    c.name: c for c in (PAPER, RELEASED_SNAPMOGEN, RELEASED_HUMANML3D, STARTER, OPEN, TINY)
}


def named_config(name: str) -> MoMaskPPConfig:
    """Return a configuration by name.

    Raises:
        InvalidInput: no such configuration.
    """
    return named(CONFIGS, name)
