"""MOGO's RQHC-Transformer (Sec. 2.2, Alg. 2), read top to bottom.

    prompt + level ── Prompt (PnQ, eq. 7)                 ── position 0 of each level
    time           ── Clock (ours)                        ── added to every frame, beside the prompt
    tokens         ── RQHCTransformer.columns (eq. 8)     ── positions 1 … n: sums of the levels up to one's own
    both           ── Trunk (eq. 9-10), shared by levels  ── states
    states, codes  ── DepthHead (ours)                    ── states that know the levels drawn below
    states         ── one head                            ── logits of the next frame's codes, END on level 0

Fu et al., "MOGO: Residual Quantized Hierarchical Causal Transformer for High-Quality and Real-Time 3D Human Motion
Generation", 2025. All levels run as rows of one batch, or as one (`joint`, ours): a frame costs one pass.

Shapes: B batch, n frames, V levels, L lanes (1 or V), K codes, W text width, w transformer width, P prompts (2 where a
clip is steered).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn
from torch.utils.checkpoint import checkpoint

from marey.models.mogo.attention import LookBack, Reach, RelativeAttention, Slots
from marey.models.mogo.clock import Clock
from marey.models.mogo.config import MOGOConfig, TransformerConfig
from marey.models.mogo.depth import DepthHead
from marey.nn.convolution import frame_mask
from marey.nn.transformer import dropout, initialize, sinusoidal_positions

NOT_ASKED = -1
"""Target that counts in no loss."""
RIDGE = 100.0
TRANSITION = 10
"""Frames of the blend between joined clips of the training data."""
STRETCHES = (1, 1, 8, 24)
"""Frames that training hides together."""


def lanes(config: MOGOConfig) -> int:
    """Return L, the sequences of a clip: one per level (the paper's), or one for all levels."""
    return 1 if config.transformer.joint else config.tokenizer.levels


class Prompt(nn.Module):
    """Projection of sentence features to position 0 of every lane (eq. 7), and to every frame (ours)."""

    mean: Tensor  # (W,) of the training captions; standardising them is ours, as in HGM³
    std: Tensor  # (W,)

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__()
        width = config.transformer.width
        self.noise = config.condition.noise
        self.register_buffer("mean", torch.zeros(config.condition.text_width))
        self.register_buffer("std", torch.ones(config.condition.text_width))
        self.project = nn.Linear(config.condition.text_width, width)
        self.level = nn.Embedding(lanes(config), width)
        self.tell = nn.Linear(config.condition.text_width, width, bias=False) if config.condition.every_frame else None
        self.null = nn.Parameter(torch.zeros(width))  # in place of the prompt, the same at all levels (ours)

    def forward(self, sentence: Tensor, dropped: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Return p + q_emb, (B, W) -> (B, L, w), the null prompt where `dropped` (B,) bool; and the term that is added
        to every frame (B, w), zero where dropped."""
        x = self.standardised(sentence)
        if self.training and self.noise > 0:
            x = x + self.noise * torch.randn_like(x)
        prompt = self.project(x)
        prompt_term = torch.zeros_like(prompt) if self.tell is None else self.tell(x)
        if dropped is not None:
            prompt = torch.where(dropped[:, None], self.null.to(prompt.dtype), prompt)
            prompt_term = prompt_term.masked_fill(dropped[:, None], 0)
        return prompt[:, None] + self.level.weight, prompt_term

    def standardised(self, sentence: Tensor) -> Tensor:
        """Standardise (…, W) to zero mean and unit deviation over the training captions."""
        return (sentence.float() - self.mean) / self.std


class DurationRegression(nn.Module):
    """Duration of an action from its sentence alone (ours): ridge regression of the logarithm of its frames.

    The motion does not show locally where a clip should end: a lowered arm looks like one that has not been raised yet.
    """

    weight: Tensor  # (W,) of standardised features
    bias: Tensor  # ()

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__()
        self.least, self.most = config.min_frames, config.max_frames
        self.register_buffer("weight", torch.zeros(config.condition.text_width))
        self.register_buffer("bias", torch.tensor(4 * config.fps).log())

    def fit(self, features: Tensor, frames: Tensor) -> None:
        """Fit standardised features (N, W) of actions to their frames (N,)."""
        x, y = F.pad(features.double(), (0, 1), value=1.0), frames.double().log()
        ridge = RIDGE * torch.eye(x.shape[1], dtype=x.dtype, device=x.device)
        ridge[-1, -1] = 0
        found = torch.linalg.solve(x.T @ x + ridge, x.T @ y)
        self.weight.copy_(found[:-1])
        self.bias.copy_(found[-1])

    def forward(self, features: Tensor) -> Tensor:
        """Return frames (A,), whole numbers, of actions with standardised features (A, W)."""
        frames = (features @ self.weight + self.bias).exp()
        return frames.round().clamp(self.least, self.most).long()


class TrunkBlock(nn.Module):
    """Attention and feed-forward (GELU), each behind a norm (ours; Transformer-XL normalises after the residual)."""

    def __init__(self, config: TransformerConfig) -> None:
        super().__init__()
        self.dropout = config.dropout
        self.attention = RelativeAttention(config.width, config.heads)
        self.wide = nn.Linear(config.width, config.feedforward)
        self.narrow = nn.Linear(config.feedforward, config.width)
        self.norm1 = nn.LayerNorm(config.width)
        self.norm2 = nn.LayerNorm(config.width)

    def forward(self, x: Tensor, attend: Callable[[Tensor], Tensor]) -> Tensor:
        """Map (…, w) to (…, w); `attend` is the attention over the readable positions."""
        x = x + self._drop(attend(self.norm1(x)))
        return x + self._drop(self.narrow(self._drop(F.gelu(self.wide(self.norm2(x))))))

    def _drop(self, x: Tensor) -> Tensor:
        return dropout(x, self.dropout, training=self.training)


class TrunkStep(nn.Module):
    """A block of the trunk for one new position of each session: the same layers as in `TrunkBlock`."""

    def __init__(self, block: TrunkBlock) -> None:
        """Share the layers of `block`, packed or not."""
        super().__init__()
        self.attention = LookBack(block.attention)
        self.wide, self.narrow, self.norm1, self.norm2 = block.wide, block.narrow, block.norm1, block.norm2

    def forward(self, x: Tensor, memory: Tensor, terms: Tensor, slots: Slots) -> Tensor:
        """(S, L, w) -> (S, L, w); see `LookBack.forward`."""
        x = x + self.attention(self.norm1(x), memory, terms, slots)
        return x + self.narrow(F.gelu(self.wide(self.norm2(x))))


class Trunk(nn.Module):
    """The causal transformer that all levels share."""

    sinusoids: Tensor  # (D + 1, w) of the distances 0 … D, D the longest training sequence

    def __init__(self, config: TransformerConfig, max_distance: int) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(TrunkBlock(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.width)
        self.recompute = False  # the activations of a block in the backward pass
        table = sinusoidal_positions(max_distance + 1, config.width)
        self.register_buffer("sinusoids", table, persistent=False)

    def forward(self, x: Tensor, reach: Reach) -> Tensor:
        """Map [prompts | frames] (N, P + n, w) to states of the same shape, float32."""
        kind = x.device.type
        x = x.to(torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else x.dtype)
        through = self._through_again if self.recompute and torch.is_grad_enabled() else self._through
        for block in self.layers:
            x = through(x, block, reach)
        return self.norm(x).float()

    def _through_again(self, x: Tensor, block: TrunkBlock, reach: Reach) -> Tensor:
        return checkpoint(self._through, x, block, reach, use_reentrant=False)

    def _through(self, x: Tensor, block: TrunkBlock, reach: Reach) -> Tensor:
        terms = block.attention.terms(self.sinusoids)
        return block(x, lambda h: block.attention(h, terms, reach))

    @property
    def layers(self) -> list[TrunkBlock]:
        """Return the blocks, typed."""
        return [block for block in self.blocks if isinstance(block, TrunkBlock)]


class RQHCTransformer(nn.Module):
    """Prompt and past frames to logits of the next frame's codes on all levels."""

    leads = 1
    """Positions before the first frame where there is one prompt: position 0 alone."""
    no_end: Tensor  # (V, K + 1) bool: END on the levels that have none

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__()
        t, levels, width = config.transformer, config.tokenizer.levels, config.transformer.width
        self.config = config
        self.levels, self.lanes = levels, lanes(config)
        self.codes = config.tokenizer.codes
        self.farthest = config.max_frames + self.leads - 1  # largest distance between two positions
        self.prompt = Prompt(config)
        self.pace = DurationRegression(config)
        self.clock = Clock(width, config.max_frames, config.condition.clockless) if config.condition.clock else None
        self.embedding = nn.Embedding(self.codes, width)  # one for all levels (Alg. 2)
        # residuals get smaller from level to level
        gains = 2.0 ** (-0.5 * torch.arange(levels))[:, None].repeat(1, width)
        self.gains = nn.Parameter(gains) if t.level_gain else None
        self.trunk = Trunk(t, self.farthest)
        self.depth = DepthHead(config.depth, levels, width) if config.depth.layers else None
        self.head = nn.Linear(width, self.codes + 1)  # one for all levels; the last is END
        self.ahead = nn.ModuleList(nn.Linear(width, width) for _ in config.ahead)  # used in training alone
        no_end = torch.zeros(levels, self.codes + 1, dtype=torch.bool)
        no_end[1:, -1] = True
        self.register_buffer("no_end", no_end, persistent=False)
        initialize(self)
        if self.depth is not None:
            nn.init.zeros_(self.depth.out_proj.weight)  # starts as independent levels
        if self.prompt.tell is not None:
            nn.init.zeros_(self.prompt.tell.weight)
        if self.clock is not None:
            nn.init.zeros_(self.clock.project.weight)
        for weight in (w for w in self.ahead.parameters() if w.ndim == 2):
            nn.init.eye_(weight)  # until trained, later frames are predicted as the next one

    @property
    def end(self) -> int:
        """Return K, the token of level 0 that ends a clip; never an input."""
        return self.codes

    def forward(
        self, prompts: Tensor, tokens: Tensor, *, skipped: Tensor | None = None, seam: Tensor | None = None
    ) -> Tensor:
        """Return logits (B, V, n + 1, K + 1) of the frames 1 … n + 1 of clips, all at once; arguments as in
        `states`."""
        states = self.states(prompts, tokens, skipped=skipped, seam=seam)
        next_codes = F.pad(tokens, (0, 0, 0, 1), value=-1)[..., :-1]  # (B, n + 1, V - 1): of the frame predicted
        refined = self.refine(states.flatten(0, 1), next_codes.flatten(0, 1))
        return self.score(refined).view(*states.shape[:2], self.levels, -1).transpose(1, 2)

    def states(
        self, prompts: Tensor, tokens: Tensor, *, skipped: Tensor | None = None, seam: Tensor | None = None
    ) -> Tensor:
        """Return the trunk's states before the frames 1 … n + 1 of clips: (B, n + 1, L, w).

        In training mode the prompt of some samples is dropped and frame columns of the input are corrupted; the targets
        of the depth head are not.

        Args:
            prompts: (B, P, W) sentence features.
            tokens: (B, n, V) int64, -1 beyond a clip's own length; n at most `max_frames`.
            skipped: (B,) frames that were cut off between the prompt and the first column, None = 0.
            seam: (B,) frames made when the second prompt replaced the first, at least 1; needed where P = 2.
        """
        size, number = tokens.shape[1], prompts.shape[1]
        first, frames = self.inputs(prompts, tokens, skipped, seam)
        x = torch.cat([first, frames], 2).flatten(0, 1)  # (B · L, P + n, w)
        states = self.trunk(x, self.reach(size, number, skipped, seam))
        states = torch.cat([states[:, :1], states[:, number:]], 1)  # a second prompt predicts nothing
        return states.view(len(tokens), self.lanes, size + 1, -1).transpose(1, 2)

    def inputs(
        self, prompts: Tensor, tokens: Tensor, skipped: Tensor | None, seam: Tensor | None
    ) -> tuple[Tensor, Tensor]:
        """Return position 0 of each prompt (B, L, P, w) and the frames (B, L, n, w); arguments as in `states`."""
        training = self.training
        dropped = torch.rand(len(tokens), device=tokens.device) < self.config.condition.drop if training else None
        inputs = corrupt(tokens, self.codes, self.config.corruption) if training else tokens
        read = [self.prompt(p, dropped) for p in prompts.unbind(1)]
        first = torch.stack([opening for opening, _ in read], 2)
        prompt_term = in_force([prompt_term for _, prompt_term in read], tokens.shape[1], seam)
        if self.clock is not None:
            time = self.clock.of_actions(len(tokens), tokens.shape[1], skipped, seam)
            prompt_term = prompt_term + (time if dropped is None else time.masked_fill(dropped[:, None, None], 0))
        return first, self.columns(inputs).to(first.dtype) + prompt_term[:, None]

    def leading(self, first: Tensor) -> Tensor:
        """Return the inputs before the frames, from position 0 of each prompt (B, L, P, w): the prompts alone."""
        return first

    def natural_frames(self, actions: Tensor) -> list[int]:
        """Return the usual frames of each action (A, W) of a prompt, with the transition from the one before."""
        first, *others = self.pace(self.prompt.standardised(actions)).tolist()
        return [first, *(TRANSITION + frames for frames in others)]

    def columns(self, tokens: Tensor) -> Tensor:
        """Return inputs (B, L, n, w) of frames (B, n, V): lane l gets the sum over levels up to l, a single lane the
        sum over all; -1 adds zero."""
        x = self._embed(tokens)  # (B, n, V, w)
        x = x if self.gains is None else x * self.gains
        return x.sum(2)[:, None] if self.lanes == 1 else x.cumsum(2).transpose(1, 2)

    def refine(self, states: Tensor, codes: Tensor) -> Tensor:
        """Return states (N, m, w) of the first m levels, or of all, from those of the lanes (N, 1 or m, w), given the
        codes (N, m - 1) of the frame they predict."""
        return states if self.depth is None else self.depth(states, self._embed(codes))

    def score(self, states: Tensor, level: int = 0) -> Tensor:
        """Return logits (…, m, K + 1), float32, of states (…, m, w) of the levels `level` … `level` + m - 1."""
        hidden = self.no_end[level : level + states.shape[-2]]
        return self.head(states).float().masked_fill(hidden, torch.finfo(torch.float32).min)

    def reach(self, size: int, prompts: int = 1, skipped: Tensor | None = None, seam: Tensor | None = None) -> Reach:
        """Return the positions that `size` frames may read; see `forward`."""
        device, farthest = self.trunk.sinusoids.device, self.farthest
        if size > farthest:
            raise ValueError(f"{size} frames exceed the {farthest} learned distances")
        if (prompts == 2) != (seam is not None):
            raise ValueError("a seam needs a second prompt, and a second prompt a seam")
        position = torch.arange(1, size + 1, device=device)
        later = (position[:, None] < position)[None]  # (1, n, n)
        unread = torch.zeros(1, size, prompts, dtype=torch.bool, device=device)
        if seam is not None:
            steered = position >= seam.repeat_interleave(self.lanes)[:, None]  # (N, n)
            unread = torch.stack([steered, ~steered], -1)
        hidden = torch.cat([unread, later.expand(len(unread), -1, -1)], -1)[:, None]
        before = position[None] if skipped is None else skipped.repeat_interleave(self.lanes)[:, None] + position
        return Reach(prompts, before.clamp(max=farthest), hidden)

    def _embed(self, tokens: Tensor) -> Tensor:
        return self.embedding(tokens.clamp(min=0)) * (tokens >= 0)[..., None]


def in_force(prompt_term: Sequence[Tensor], size: int, seam: Tensor | None) -> Tensor:
    """Return the prompt term of each of `size` frames, (B, 1 or n, w), from one or two prompts' (B, w). The frame
    behind which the second prompt replaces the first gets the second, because it predicts the second's first frame."""
    if seam is None:
        return prompt_term[0][:, None]
    position = torch.arange(1, size + 1, device=seam.device)
    return torch.where((position >= seam[:, None])[..., None], prompt_term[1][:, None], prompt_term[0][:, None])


def corrupt(tokens: Tensor, codes: int, most: float) -> Tensor:
    """Replace whole frame columns of (B, n, V) by random codes, at a rate from U(0, `most`) a sample (ours).

    The public repository always replaces half of the tokens. A stream reads its own errors, and those affect whole
    frames: a wrong level 0 makes the levels above wrong. Half of the samples lose single frames, the others stretches,
    after which only the prompt shows the current action.
    """
    batch, size = tokens.shape[:2]
    device = tokens.device
    rate = most * torch.rand(batch, 1, device=device)
    kind = torch.randint(len(STRETCHES), (batch, 1), device=device)
    stretch = sum((kind == k) * frames for k, frames in enumerate(STRETCHES))
    begun = torch.randint(max(STRETCHES), (batch, 1), device=device)
    block = (torch.arange(size, device=device) + begun) // stretch  # (B, n)
    hit = torch.rand(batch, size + max(STRETCHES), device=device).gather(1, block) < rate
    return torch.where(hit[..., None] & (tokens >= 0), torch.randint_like(tokens, codes), tokens)


def next_targets(
    tokens: Tensor, lengths: Tensor, end: int, *, ends: Tensor | None = None, skipped: Tensor | None = None
) -> Tensor:
    """Return the targets of `RQHCTransformer.forward`: (B, V, n + 1), NOT_ASKED where there is none.

    Args:
        tokens: (B, n, V).
        lengths: (B,) frames of each clip.
        end: token that ends a clip, the target of level 0 behind its last frame.
        ends: (B,) bool, clips that really end there (no crop); None = all.
        skipped: (B,), as in `forward`: the first frame of a crop is no target.
    """
    size = tokens.shape[1]
    targets = tokens.masked_fill(~frame_mask(lengths, size)[..., None], NOT_ASKED)
    targets = F.pad(targets, (0, 0, 0, 1), value=NOT_ASKED)  # (B, n + 1, V)
    last = torch.arange(size + 1, device=tokens.device) == lengths[:, None]  # (B, n + 1)
    if ends is not None:
        last = last & ends[:, None]
    targets[..., 0] = targets[..., 0].masked_fill(last, end)
    if skipped is not None:
        targets[:, 0] = targets[:, 0].masked_fill((skipped > 0)[:, None], NOT_ASKED)
    return targets.transpose(1, 2)
