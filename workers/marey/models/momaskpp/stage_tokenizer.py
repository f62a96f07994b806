"""Training stage of the multi-scale RVQ-VAE (eq. 4 and 6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.motion.features import layout
from marey.nn.convolution import frame_mask
from marey.nn.motion_tokenizer import ROOT
from marey.training.joints import heading_joints, unit_of, world_joints
from marey.training.tokenizing import (
    WindowStage,
    feature_weights,
    reconstruction_errors,
    swing_weights,
    valid_mean,
)


@dataclass(frozen=True)
class Losses:
    """Terms of the training objective; all but the first without gradient."""

    total: Tensor
    features: Tensor
    essential: Tensor
    commitment: Tensor
    joints: Tensor
    perplexity: Tensor


def has_positions(config: MoMaskPPConfig) -> bool:
    """Return True if the features hold joint positions behind the root's four columns, as HumanML3D's do."""
    return "positions" in (slices := layout(config.layout).slices) and slices["positions"].start == ROOT.stop


def tokenizer_loss(
    model: Tokenizer, config: MoMaskPPConfig, features: Tensor, lengths: Tensor, world: float | Tensor
) -> Losses:
    """Compute eq. 6 with smooth L1, plus the root once more (published), plus terms on the joints (ours).

    Args:
        model: the tokenizer.
        config: weights of the terms.
        features: (B, T, D) in their own units.
        lengths: (B,) frames.
        world: factor of the term in space; see `world_share`.
    """
    t = config.tokenizer
    output, quantized = model(features, lengths)
    valid = frame_mask(lengths, features.shape[1]).float()
    error = F.smooth_l1_loss(output, model.normalize(features), reduction="none")  # (B, T, D)

    joint_weights = swing_weights(config.layout, features.device, t.swing_weight)  # (J,)
    weights = feature_weights(config, joint_weights)  # (D,)
    whole = valid_mean((error * weights).sum(-1) / weights.sum(), valid)
    essential = valid_mean(error[..., slice(*t.essential)].mean(-1), valid)
    joints = _joint_losses(model.restore(output), features, valid, joint_weights, config, world)
    total = whole + t.commitment * quantized.commitment + t.essential_weight * essential + joints
    if t.root_weight:
        total = total + t.root_weight * valid_mean(error[..., ROOT].mean(-1), valid)
    return Losses(
        total=total,
        features=whole.detach(),
        essential=essential.detach(),
        commitment=quantized.commitment.detach(),
        joints=joints.detach(),
        perplexity=quantized.perplexity[0],
    )


def _joint_losses(
    restored: Tensor,
    features: Tensor,
    valid: Tensor,
    joint_weights: Tensor,
    config: MoMaskPPConfig,
    world: float | Tensor,
) -> Tensor:
    """Return the weighted sum of the terms on joints; 0 where none has a weight."""
    t, total = config.tokenizer, features.new_zeros(())
    if not (t.position_weight or t.velocity_weight or t.world_weight):
        return total
    body = config.joints, unit_of(config.layout)
    if t.position_weight or t.velocity_weight:
        local = heading_joints(restored, *body) - heading_joints(features, *body)
        total = total + t.position_weight * valid_mean((local.abs().sum(-1) * joint_weights).mean(-1), valid)
        speed = (local.diff(dim=1).abs().sum(-1) * joint_weights).mean(-1) * config.fps
        total = total + t.velocity_weight * valid_mean(speed, valid[:, 1:])
    if t.world_weight:
        drift = world_joints(restored, *body) - world_joints(features, *body)
        total = total + t.world_weight * world * valid_mean(drift.abs().sum(-1).mean(-1), valid)
    return total


class ScaleTokenizerStage(WindowStage[MoMaskPPConfig, Tokenizer]):
    """Training of the tokenizer by `tokenizer_loss`."""

    def batch_loss(self, batch: tuple[Tensor, Tensor, Tensor]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        losses = tokenizer_loss(self.module, self.config, *batch)
        logs = {name: value.detach() for name, value in vars(losses).items() if name != "total"}
        return losses.total, {"loss": losses.total.detach(), **logs}

    @torch.no_grad()
    def errors(self, split: str) -> dict[str, float]:
        """Return errors on the captured clips of a split, each at most `max_frames` long: see `reconstruction_errors`;
        where the features hold no positions, `error` of normalised features."""
        longest = self.config.max_frames
        clips = [c.model_copy(update={"length": min(c.length, longest)}) for c in self.data.originals(split)]
        if has_positions(self.config):
            return reconstruction_errors(self.module, self.config, self.data, clips)
        rate, found = self.module.frames_per_token, list[float]()
        for clip in (c for c in clips if c.length >= rate):
            lengths = torch.tensor([clip.length - clip.length % rate], device=self.data.features.device)
            features = self.data.windows(torch.tensor([clip.start], device=lengths.device), int(lengths))
            decoded = self.module.decode(self.module.encode(features, lengths), lengths // rate)
            found.append(float((self.module.normalize(decoded) - self.module.normalize(features)).abs().mean()))
        return {"error": float(np.mean(found))}
