"""The loss of SnapMoGen's appendix B.2, which is TMR's: L_rec + λ_KL L_KL + λ_E L_E + λ_NCE L_NCE.

The appendix has one equation and describes the terms in words; their exact form follows Petrovich et al. 2023 (TMR,
Sec. 3).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from marey.evaluator.model import Gaussian


def reconstruction(predicted: Tensor, target: Tensor, mask: Tensor) -> Tensor:
    """Return smooth L1 (B, T, I) summed over the numbers of existing frames, `mask` (B, T) bool.

    It is a sum so that a batch can be computed in pieces; the loss divides by the total count.
    """
    errors = F.smooth_l1_loss(predicted.float(), target.float(), reduction="none")
    return errors.masked_fill(~mask[..., None], 0.0).sum()


def divergence(of: Gaussian, beside: Gaussian | None = None) -> Tensor:
    """Return KL(of ‖ beside), mean over batch and dimensions as in TMR; None is the unit Gaussian."""
    mean, log_variance = of.mean.float(), of.log_variance.float()
    if beside is None:
        return 0.5 * (log_variance.exp() + mean.square() - 1 - log_variance).mean()
    ratio = log_variance - beside.log_variance.float()
    distance = (mean - beside.mean.float()).square() / beside.log_variance.float().exp()
    return 0.5 * (ratio.exp() + distance - 1 - ratio).mean()


def divergences(motion: Gaussian, text: Gaussian) -> Tensor:
    """Return L_KL: both towards the unit Gaussian, and towards each other."""
    return divergence(motion) + divergence(text) + divergence(motion, text) + divergence(text, motion)


def latent_distance(motion: Gaussian, text: Gaussian) -> Tensor:
    """Return L_E: smooth L1 between the mean vectors (App. B.2; TMR compares samples)."""
    return F.smooth_l1_loss(text.mean.float(), motion.mean.float())


def info_nce(text: Tensor, motion: Tensor, labels: Tensor | None, temperature: float) -> Tensor:
    """Return L_NCE on cosines of embeddings (B, E), text to motion and back, without negatives of equal meaning.

    TMR drops negatives whose sentences another language model finds similar; here clips have labels (B,), and negatives
    of the pair's own label are dropped. Labels None: none is dropped.
    """
    with torch.autocast(text.device.type, enabled=False):  # in bfloat16 cosines over 0.1 are off by up to 0.04
        cosines = F.normalize(text.float(), dim=1) @ F.normalize(motion.float(), dim=1).T
        scores = cosines / temperature
        if labels is not None:
            same = labels[:, None] == labels[None]
            same.fill_diagonal_(False)
            scores = scores.masked_fill(same, -torch.inf)
        target = torch.arange(len(scores), device=scores.device)
        return 0.5 * (F.cross_entropy(scores, target) + F.cross_entropy(scores.T, target))
