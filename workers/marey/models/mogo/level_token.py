"""The level as a token of its own behind the prompt (MOGO Fig. 10a, Tab. 7), for comparison with the paper's PnQ."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.model import RQHCTransformer


class LevelToken(RQHCTransformer):
    """The level as a token of its own behind the prompt, in place of its embedding beside the prompt (eq. 7).

    The token is at position 1: frames are one position further from the prompt, and the token's output predicts the
    first frame. In a crop it stands directly before the first frame that is left. It reads the first prompt alone: a
    later prompt replaces position 0, and the token keeps what it read.
    """

    leads = 2

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__(config)
        self.level_token = nn.Parameter(torch.randn_like(self.prompt.level.weight) * 0.02)
        nn.init.zeros_(self.prompt.level.weight).requires_grad_(False)

    def leading(self, first: Tensor) -> Tensor:
        """Return the prompts and behind them the token, (B, L, P + 1, w)."""
        token = self.level_token[None, :, None].expand(len(first), -1, -1, -1)
        return torch.cat([first, token.to(first.dtype)], 2)

    def states(
        self, prompts: Tensor, tokens: Tensor, *, skipped: Tensor | None = None, seam: Tensor | None = None
    ) -> Tensor:
        """Return the trunk's states; arguments as in `RQHCTransformer`."""
        first, frames = self.inputs(prompts, tokens, skipped, seam)
        x = torch.cat([self.leading(first), frames], 2).flatten(0, 1)
        later = None if seam is None else seam + 1
        states = self.trunk(x, self.reach(tokens.shape[1] + 1, prompts.shape[1], skipped, later))
        behind = states[:, prompts.shape[1] :]
        return behind.view(len(tokens), self.lanes, tokens.shape[1] + 1, -1).transpose(1, 2)


def build_transformer(config: MOGOConfig) -> RQHCTransformer:
    """Build the transformer of a configuration, freshly initialised."""
    return LevelToken(config) if config.transformer.level_token else RQHCTransformer(config)
