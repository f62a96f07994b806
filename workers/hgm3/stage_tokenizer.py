"""Training stage of the RVQ-VAE tokenizer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from workers.hgm3.config import HGM3Config
from workers.hgm3.data import MotionData, dataset_of
from workers.hgm3.joints import world_joints
from workers.hgm3.tokenizer import Tokenizer, biased_std, frame_mask, tokenizer_loss
from workers.training.data.manifest import Clip
from workers.training.data.sampling import sampling_weights
from workers.training.loop import StepContext

SHARES = {"bandai-namco/1": 0.45, "bandai-namco/2": 0.45}
"""Share of the windows drawn from a data set; others divide what is left. The first has 6 % of the clips, each of
another content or style, and three times the error of the second when clips are drawn evenly."""


class TokenizerStage:
    """Windows of random clips; `module` is the tokenizer itself."""

    name = "tokenizer"

    def __init__(self, config: HGM3Config, data: MotionData) -> None:
        self.config = config
        self.optimisation = config.train_tokenizer
        self.data = data
        device = data.features.device
        self.module = Tokenizer(config).to(device)
        self.module.set_statistics(data.mean, biased_std(data.std, config.tokenizer.feature_bias))
        rate = config.tokenizer.frames_per_token
        self.train_clips = [c for c in data.prepared.split("train") if not c.spliced and c.length >= rate]
        self.weights = tokenizer_weights(self.train_clips)
        self.first = np.array([c.start for c in self.train_clips])
        self.lengths = np.array([c.length - c.length % rate for c in self.train_clips])

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """One group."""
        return [list(self.module.parameters())]

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """One window size a step, the batch scaled so that the number of frames stays."""
        rng, config = context.rng, self.config
        window = int(rng.choice(config.windows))
        batch = max(1, self.optimisation.batch * min(config.windows) // window)
        chosen = rng.choice(len(self.train_clips), size=batch, p=self.weights)
        slack = np.maximum(self.lengths[chosen] - window, 0)
        offsets = np.floor(rng.random(batch) * (slack + 1)).astype(np.int64)
        lengths = np.minimum(self.lengths[chosen], window)
        device = self.data.features.device
        features = self.data.windows(torch.from_numpy(self.first[chosen] + offsets).to(device), window)
        own = None if bool((lengths == window).all()) else torch.from_numpy(lengths).to(device)
        loss, quantized = tokenizer_loss(self.module, config, features, own, context.fraction)
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
        return loss.total, logs

    def after_step(self, context: StepContext) -> None:
        """Nothing: the codebooks moved in the forward pass."""

    def validate(self) -> Mapping[str, float]:
        """Errors on the validation clips, whole."""
        return reconstruction_errors(self.module, self.config, self.data, self.data.originals("val"))


def tokenizer_weights(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Sampling weights (sum 1): longer clips more often, rare contents raised, data sets by their `SHARES`."""
    weights = sampling_weights(clips) * np.sqrt([c.length for c in clips])
    names = [dataset_of(c) for c in clips]
    named = sum(SHARES.get(n, 0.0) for n in set(names))
    others = sum(n not in SHARES for n in set(names))
    for name in sorted(set(names)):
        rows = np.array([n == name for n in names])
        weights[rows] *= SHARES.get(name, (1 - named) / max(others, 1)) / weights[rows].sum()
    return weights / weights.sum()


@torch.no_grad()
def reconstruction_errors(
    model: Tokenizer, config: HGM3Config, data: MotionData, clips: Sequence[Clip], *, batch: int = 64
) -> dict[str, float]:
    """Mean joint error of whole clips, encoded and decoded, in millimetres.

    `local_mm` with the pelvis laid over the true one in each frame, which is MoMask's MPJPE; `error_mm` in space, where
    the drift of the root adds up over a clip; both averaged over clips, and again per data set (`local_mm/{dataset}`);
    `perplexity/{level}` of the code usage.
    """
    model.eval()
    rate = config.tokenizer.frames_per_token
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
        truth, joints = world_joints(features, config.joints), world_joints(output, config.joints)
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
