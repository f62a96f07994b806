"""Train a motion tokenizer: losses on features and joints, windows of clips, reconstruction errors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.data.manifest import Clip
from marey.data.sampling import UNLABELLED, sampling_weights
from marey.motion.features import layout
from marey.nn.convolution import frame_mask
from marey.nn.motion_tokenizer import MotionTokenizer, biased_std
from marey.nn.quantizer import Quantized
from marey.training.joints import heading_joints, unit_of, world_joints
from marey.training.motions import MotionData, dataset_of
from marey.training.optimisation import StageConfig
from marey.training.stages import StepContext


class TokenizerWeights(Protocol):
    """Fields of a tokenizer's configuration that training reads."""

    @property
    def levels(self) -> int: ...
    @property
    def codes(self) -> int: ...
    @property
    def feature_bias(self) -> float: ...
    @property
    def commitment(self) -> float: ...
    @property
    def rotation_weight(self) -> float: ...
    @property
    def position_weight(self) -> float: ...
    @property
    def velocity_weight(self) -> float: ...
    @property
    def world_weight(self) -> float: ...
    @property
    def swing_weight(self) -> float: ...


class TokenizerTraining(Protocol):
    """Fields of a model's configuration that training reads."""

    @property
    def layout(self) -> str: ...
    @property
    def features(self) -> int: ...
    @property
    def joints(self) -> int: ...
    @property
    def fps(self) -> float: ...
    @property
    def tokenizer(self) -> TokenizerWeights: ...
    @property
    def windows(self) -> tuple[int, ...]: ...
    @property
    def train_tokenizer(self) -> StageConfig: ...


@dataclass(frozen=True)
class TokenizerLoss:
    """The terms of the training objective, each already averaged over valid frames."""

    total: Tensor
    features: Tensor  # L1 of normalised features (eq. 2, first term)
    commitment: Tensor  # eq. 2, second term, without β
    position: Tensor  # metres, in the heading frame
    velocity: Tensor  # m/s, in the heading frame
    world: Tensor  # metres, in space: with the drift of the root since the window's start


def tokenizer_loss(
    model: MotionTokenizer,
    config: TokenizerTraining,
    features: Tensor,
    lengths: Tensor | None = None,
    world: float | Tensor = 1.0,
) -> tuple[TokenizerLoss, Quantized]:
    """Compute eq. 2 of HGM³, eq. 6 of MOGO without its last term, plus terms on the joints (ours), which metrics
    measure.

    Args:
        model: the tokenizer.
        config: weights of the terms.
        features: (B, T, D) in their own units.
        lengths: (B,) frames, or None where every window is full.
        world: factor of the term in space; see `world_share`.
    """
    t = config.tokenizer
    output, quantized = model(features, lengths)
    target = model.normalize(features)
    valid = torch.ones_like(features[..., 0]) if lengths is None else frame_mask(lengths, features.shape[1]).float()
    joint_weights = swing_weights(config.layout, features.device, t.swing_weight)  # (J,), their mean is 1
    weights = feature_weights(config, joint_weights)  # (D,)
    l1 = valid_mean(((output - target).abs() * weights).sum(-1) / weights.sum(), valid)

    restored, body = model.restore(output), (config.joints, unit_of(config.layout))
    local = heading_joints(restored, *body) - heading_joints(features, *body)  # (B, T, J, 3)
    position = valid_mean((local.abs().sum(-1) * joint_weights).mean(-1), valid)
    velocity = valid_mean((local.diff(dim=1).abs().sum(-1) * joint_weights).mean(-1) * config.fps, valid[:, 1:])
    drift = world_joints(restored, *body) - world_joints(features, *body)
    in_space = valid_mean(drift.abs().sum(-1).mean(-1), valid)
    total = (
        l1
        + t.commitment * quantized.commitment
        + t.position_weight * position
        + t.velocity_weight * velocity
        + t.world_weight * world * in_space
    )
    terms = (l1, quantized.commitment, position, velocity, in_space)
    return TokenizerLoss(total, *(term.detach() for term in terms)), quantized


def world_share(fraction: float) -> float:
    """Return the factor of the loss in space after a `fraction` of the budget: drift adds up over a window, and at
    first its gradient dominates all others."""
    return min(1.0, 2 * fraction) ** 2


_HUMANML3D = ("L_elbow", "R_elbow", "L_wrist", "R_wrist", "head")
_KIT = ("LE", "RE", "LW", "RW", "BUN")
_SNAPMOGEN = tuple(f"{side}_{part}0001_bind_JNT" for side in "LR" for part in ("armLower", "hand"))
SWINGING = frozenset((*_HUMANML3D, *_KIT, *_SNAPMOGEN, "C_head_bind_JNT"))
"""Joints whose quick swings (waves, claps, nods) are small beside the movements of the body."""


def swing_weights(name: str, device: torch.device, weight: float) -> Tensor:
    """Return the weights (J,) of the joints of a layout, `weight` times as high for `SWINGING`; their mean is 1."""
    names = layout(name).skeleton.joint_names
    weights = torch.ones(len(names), device=device)
    for number, joint in enumerate(names):
        if joint in SWINGING:
            weights[number].fill_(weight)  # an assignment would copy the number from the host
    return weights / weights.mean()


def feature_weights(config: TokenizerTraining, joint_weights: Tensor) -> Tensor:
    """Return the weight of each feature column (D,) in the L1 term: for positions that of their joint, for 6-D
    rotations `rotation_weight`, for all others 1.

    Args:
        config: the layout's sizes, and `rotation_weight`.
        joint_weights: (J,), see `swing_weights`.
    """
    weights = torch.ones(config.features, device=joint_weights.device)
    start = 4 + 3 * (config.joints - 1)
    weights[start : start + 6 * (config.joints - 1)].fill_(config.tokenizer.rotation_weight)
    weights[4:start] = joint_weights[1:].repeat_interleave(3)
    return weights


def valid_mean(values: Tensor, valid: Tensor) -> Tensor:
    """Return the mean of `values` (B, T) over valid frames; 0 without any. `valid`: (B, T), 1 for valid frames."""
    return (values * valid).sum() / valid.sum().clamp(min=1)


SHARES = {"bandai-namco/1": 0.45, "bandai-namco/2": 0.45}
"""Share of the windows drawn from a data set; all others together have the rest. The first has 6 % of the clips, each
of another content or style, and three times the error of the second if clips are drawn evenly."""


class ClipWindows:
    """Windows of random training clips, in whole tokens."""

    def __init__(self, data: MotionData, rate: int, sizes: Sequence[int], batch: int) -> None:
        """Take the clips of the training split.

        Args:
            data: the prepared data.
            rate: frames of a token.
            sizes: frames of windows, one of which is drawn for each batch.
            batch: windows of the smallest size; a batch of larger ones has about as many frames.
        """
        self._data, self._sizes, self._batch = data, sizes, batch
        clips = tokenizer_clips(data.prepared.split("train"), rate)
        self._weights = tokenizer_weights(clips, min(sizes))
        self._first = np.array([c.start for c in clips])
        self._lengths = np.array([c.length - c.length % rate for c in clips])

    def draw(self, rng: np.random.Generator) -> tuple[Tensor, NDArray[np.int64]]:
        """Return the features (B, T, D) of windows of one size, and the frames (B,) that are the clip's own."""
        window = int(rng.choice(self._sizes))
        batch = max(1, self._batch * min(self._sizes) // window)
        chosen = rng.choice(len(self._first), size=batch, p=self._weights)
        slack = np.maximum(self._lengths[chosen] - window, 0)
        offsets = np.floor(rng.random(batch) * (slack + 1)).astype(np.int64)
        starts = torch.from_numpy(self._first[chosen] + offsets).to(self._data.features.device)
        return self._data.windows(starts, window), np.minimum(self._lengths[chosen], window)


C = TypeVar("C", bound=TokenizerTraining)
"""A model's configuration."""
M = TypeVar("M", bound=MotionTokenizer)
"""A model's tokenizer."""


class WindowStage(ABC, Generic[C, M]):
    """Base class of the training stages of tokenizers, on windows of random clips; `module` is the tokenizer."""

    name = "tokenizer"

    def __init__(self, config: C, data: MotionData, module: M) -> None:
        """Train `module` on the data's statistics."""
        self.config = config
        self.optimisation = config.train_tokenizer
        self.data = data
        self.module = module.to(data.features.device)
        self.module.set_statistics(data.mean, biased_std(data.std, config.tokenizer.feature_bias))
        self.windows = ClipWindows(data, module.frames_per_token, config.windows, self.optimisation.batch)

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    @property
    def recordable(self) -> bool:
        """Return True."""
        return True

    def batch(self, context: StepContext) -> tuple[Tensor, Tensor, Tensor]:
        """Return the features (B, T, D) of windows, the frames (B,) that are the clips' own, and the factor of the term
        in space."""
        features, lengths = self.windows.draw(context.rng)
        device = features.device
        world = torch.tensor(world_share(context.fraction), device=device)
        return features, torch.from_numpy(lengths).to(device), world

    @abstractmethod
    def batch_loss(self, batch: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of one batch of windows."""
        return self.batch_loss(self.batch(context))

    def after_step(self, context: StepContext) -> None:
        """Do nothing: codebooks are updated in the forward pass."""

    @abstractmethod
    def errors(self, split: str) -> dict[str, float]:
        """Return errors on the whole captured clips of a split, by name."""

    def validate(self) -> Mapping[str, float]:
        """Return errors on whole validation clips."""
        return self.errors("val")

    def test(self) -> dict[str, float]:
        """Return errors on whole captured test clips."""
        return {f"test/{name}": value for name, value in self.errors("test").items()}


class TokenizerStage(WindowStage[TokenizerTraining, MotionTokenizer]):
    """Training of a tokenizer by `tokenizer_loss`."""

    def __init__(
        self,
        config: TokenizerTraining,
        data: MotionData,
        module: MotionTokenizer,
        penalty: Callable[[], Tensor] | None = None,
    ) -> None:
        """Train `module` on the data's statistics; `penalty` is added to its loss."""
        super().__init__(config, data, module)
        self.penalty = penalty

    def batch_loss(self, batch: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        features, lengths, world = batch
        return self._loss(features, lengths, world)

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of one batch of windows; full windows are not masked, which is faster."""
        features, lengths = self.windows.draw(context.rng)
        full = bool((lengths == features.shape[1]).all())
        own = None if full else torch.from_numpy(lengths).to(features.device)
        return self._loss(features, own, world_share(context.fraction))

    def _loss(
        self, features: Tensor, lengths: Tensor | None, world: float | Tensor
    ) -> tuple[Tensor, Mapping[str, Tensor]]:
        loss, quantized = tokenizer_loss(self.module, self.config, features, lengths, world)
        logs = {
            "loss": loss.total.detach(),
            "features": loss.features,
            "commitment": loss.commitment,
            "position_m": loss.position,
            "velocity_m_s": loss.velocity,
            "world_m": loss.world,
            "perplexity_0": quantized.perplexity[0],
            "perplexity_last": quantized.perplexity[-1],
        }
        return loss.total if self.penalty is None else loss.total + self.penalty(), logs

    def errors(self, split: str) -> dict[str, float]:
        """Return errors on the whole captured clips of a split; see `reconstruction_errors`."""
        return reconstruction_errors(self.module, self.config, self.data, self.data.originals(split))


def tokenizer_clips(clips: Sequence[Clip], rate: int) -> list[Clip]:
    """Return the clips of at least `rate` frames that are no part of others, and have none as parts."""
    return [clip for clip in clips if not (clip.spliced or clip.cropped) and clip.length >= rate]


def tokenizer_weights(clips: Sequence[Clip], window: int) -> NDArray[np.float64]:
    """Return sampling weights (sum 1): longer clips more often, rare classes raised; data sets with `SHARES` by those,
    and what they leave to all others together, so that a small set has no more than its clips weigh. Where no clip has
    a class, every window of `window` frames is drawn equally often, as published."""
    if all(clip.content == UNLABELLED for clip in clips):
        windows = np.maximum([clip.length - window + 1.0 for clip in clips], 1.0)
        return windows / windows.sum()
    weights = sampling_weights(clips) * np.sqrt([c.length for c in clips])
    names = (dataset_of(c) for c in clips)
    groups = np.array([name if name in SHARES else "" for name in names])
    shares = {name: share for name, share in SHARES.items() if (groups == name).any()}
    shares[""] = 1 - sum(shares.values())
    for group in np.unique(groups):
        weights[groups == group] *= shares[group] / weights[groups == group].sum()
    return weights / weights.sum()


@torch.no_grad()
def reconstruction_errors(
    model: MotionTokenizer, config: TokenizerTraining, data: MotionData, clips: Sequence[Clip], *, batch: int = 64
) -> dict[str, float]:
    """Return the mean joint error of whole clips after encoding and decoding, in millimetres.

    `local_mm` has the pelvis aligned in each frame, as MoMask's MPJPE; `error_mm` is in space, where the drift of the
    root adds up over a clip; both are averaged over clips, and again per data set (`local_mm/{dataset}`);
    `perplexity/{level}` of the code usage.
    """
    model.eval()
    rate, body = model.frames_per_token, (config.joints, unit_of(config.layout))
    order = sorted((c for c in clips if c.length >= rate), key=lambda c: c.length)
    rows: list[tuple[str, float, float]] = []
    counts = torch.zeros(config.tokenizer.levels, config.tokenizer.codes, device=data.features.device)
    for at in range(0, len(order), batch):
        part = order[at : at + batch]
        lengths = torch.tensor([c.length - c.length % rate for c in part], device=data.features.device)
        starts = torch.tensor([c.start for c in part], device=data.features.device)
        features = data.windows(starts, int(lengths.max()))
        tokens = model.encode(features, lengths)  # (B, n, V)
        output = model.decode(tokens, lengths // rate)
        truth, joints = world_joints(features, *body), world_joints(output, *body)
        mask = frame_mask(lengths, features.shape[1])
        error = _per_clip((joints - truth).norm(dim=-1).mean(-1), mask)
        local = _per_clip(((joints - joints[:, :, :1]) - (truth - truth[:, :, :1])).norm(dim=-1).mean(-1), mask)
        rows += [(dataset_of(c), float(e), float(r)) for c, e, r in zip(part, error, local, strict=True)]
        for level in range(counts.shape[0]):
            index = tokens[..., level]
            counts[level] += torch.bincount(index[index >= 0], minlength=counts.shape[1])
    result = {"error_mm": 1000 * float(np.mean([r[1] for r in rows]))}
    result["local_mm"] = 1000 * float(np.mean([r[2] for r in rows]))
    for name in sorted({r[0] for r in rows}):
        result[f"error_mm/{name}"] = 1000 * float(np.mean([r[1] for r in rows if r[0] == name]))
        result[f"local_mm/{name}"] = 1000 * float(np.mean([r[2] for r in rows if r[0] == name]))
    share = counts / counts.sum(-1, keepdim=True).clamp(min=1)
    perplexity = torch.exp(-(share * torch.log(share + 1e-10)).sum(-1))
    return result | {f"perplexity/{level}": float(p) for level, p in enumerate(perplexity)}


def _per_clip(values: Tensor, mask: Tensor) -> Tensor:
    return (values * mask).sum(1) / mask.sum(1)
