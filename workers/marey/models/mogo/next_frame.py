"""The next frame of all sessions: the part that runs on the device without waiting for the host.

This code reads no tensor's value into Python, chooses no shape by one, and never moves the state: on a GPU the whole
step is recorded once and replayed (`marey.models.mogo.replay`).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor

from marey.models.mogo.attention import HIDDEN, Slots
from marey.models.mogo.clock import UNKNOWN_TIME
from marey.models.mogo.config import InferenceConfig
from marey.models.mogo.depth import DepthFrame
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.state import SessionState
from marey.nn.sampling import guide, sample_top_k, uniform

TOKEN_STREAM, END_STREAM = 4, 5
"""Streams of random numbers; 1 to 3 are HGM³'s."""


class NextFrame:
    """Drawing of a column of tokens for the first rows of a state; drawing twice gives the same result and state."""

    def __init__(self, packed: PackedModel, state: SessionState, config: InferenceConfig) -> None:
        self.packed, self.state, self.config, self._model = packed, state, config, packed.network
        self.branches = state.prompt_term.shape[1] // self._model.lanes

    @torch.no_grad()
    def __call__(self, rows: int) -> Tensor:
        """Return the next columns (rows, V), -1 in a session that has ended."""
        return self.draw(self.states(rows))

    @torch.no_grad()
    def states(self, rows: int) -> Tensor:
        """Return the trunk's states (rows, L, w), from which the next frames are drawn."""
        state, model = self.state, self._model
        slots = self._slots(rows)
        x = model.columns(state.last[:rows, None])[:, :, 0].repeat(1, self.branches, 1)  # (s, L, w)
        x = x + state.prompt_term[:rows]
        if self.packed.times is not None:
            prompt_term = self.time(state.made[:rows], state.began[:rows], state.stops[:rows])
            x[:, : model.lanes] += prompt_term[:, None]  # the unconditional branch gets no time
        for layer, step in enumerate(self.packed.steps):
            x = step(x, state.memory[layer, :, :rows], self.packed.terms[layer], slots)
        return torch.where((state.made[:rows] == 0)[:, None, None], state.opening[:rows], model.trunk.norm(x))

    def time(self, made: Tensor, began: Tensor, stops: Tensor) -> Tensor:
        """Return the time terms of frames of one action, (n, w).

        The last action of a stream continues after its end, and its clock stops: with more time on the clock the model
        would raise a hand again and again, which is a wave.
        """
        times = self.packed.times
        assert times is not None
        return times[torch.minimum(made - began, stops).clamp(UNKNOWN_TIME, self._model.config.max_frames)]

    @torch.no_grad()
    def draw(self, states: Tensor) -> Tensor:
        """Draw columns (s, V) from trunk states (s, L, w), level by level where a level depends on those below."""
        rows, levels, model = len(states), self._model.levels, self._model
        noise = self._noise(rows)
        states = states.view(rows, self.branches, model.lanes, -1)
        if model.depth is None:
            logits = model.head(states.flatten(1, 2)).view(*states.shape[:3], -1)
            ending = self._ends(logits[:, 0, 0])
            drawn = [self._pick(logits[:, :, :1], noise[:, :1]), self._pick(logits[:, :, 1:], noise[:, 1:], 1)]
        else:
            assert self.packed.depth is not None
            frame, drawn = DepthFrame(model.depth, self.packed.depth, states), list[Tensor]()
            ending = self.state.ended[:rows]
            for level in range(levels):
                if level == 1 and self.config.upper_guidance == 1:
                    frame.keep_first_branch()
                below = model.embedding(drawn[-1][:, 0].clamp(max=model.codes - 1)) if drawn else None
                logits = model.head(frame.next(below))[:, :, None]
                ending = ending if level else self._ends(logits[:, 0, 0])
                drawn.append(self._pick(logits, noise[:, level : level + 1], level))
        codes = torch.cat(drawn, 1)
        ended = self.state.ended[:rows]
        ended |= ending
        return codes.masked_fill(ended[:, None], -1)

    def _slots(self, rows: int) -> Slots:
        """Return the cache positions of the rows: first those before the frames, whose slot 0 is the prompt, then a
        window of frames."""
        window, leads, farthest = self.config.window, self._model.leads, self._model.farthest
        made, skipped = self.state.made[:rows], self.state.skipped[:rows]
        places = torch.arange(1, window + 1, device=made.device)
        back = (made[:, None] - places) % window  # (s, W): frames since the slot was written
        hidden = F.pad((back >= (made - skipped)[:, None]) * HIDDEN, (leads, 0))  # the prompt is always read
        before = torch.stack([made + leads - 1, *[made - skipped] * (leads - 1)], 1)  # (s, m)
        distance = torch.cat([before.clamp(max=farthest), back], 1)  # (s, m + W)
        # Before the first frame nothing is there to feed: the slot then written is overwritten before it is read.
        newest = leads + (made - 1) % window
        return Slots(torch.arange(rows, device=made.device), newest, distance[:, None, None], hidden[:, None, None])

    def _ends(self, logits: Tensor) -> Tensor:
        """Draw if END comes (s,), from level 0's logits (s, K + 1) under the prompt.

        END is drawn separately from the codes, with its own probability: temperatures below 1 and guidance sharpen
        codes, and would almost forbid an event with a small probability at each of many frames.
        """
        made = self.state.made[: len(logits)]
        chance = logits.float().softmax(-1)[:, self._model.end]
        drawn = uniform(self.state.seeds[: len(logits)], END_STREAM, 0, made[:, None])[:, 0]
        return (drawn < chance) & (made >= self.state.ends_from[: len(logits)])

    def _noise(self, rows: int) -> Tensor:
        """Return a random number (s, V) for each session's seed, frame and level."""
        levels = torch.arange(self._model.levels, device=self.state.made.device)
        positions = self.state.made[:rows, None] * len(levels) + levels  # (s, V)
        return uniform(self.state.seeds[:rows], TOKEN_STREAM, 0, positions)

    def _pick(self, logits: Tensor, noise: Tensor, level: int = 0) -> Tensor:
        """Draw codes (s, n) of levels with equal settings, `level` the lowest, from logits (s, branches, n, K + 1) and
        random numbers (s, n)."""
        config = self.config
        scale = config.upper_guidance if level else config.guidance
        guided = logits[:, 0] if scale == 1 else guide(logits[:, 0], logits[:, 1], scale)
        return sample_top_k(
            guided[..., : self._model.end],  # END is drawn separately
            noise,
            temperature=config.upper_temperature if level else config.temperature,
            share=config.upper_top_k if level else config.top_k,
        )
