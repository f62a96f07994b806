"""Motion that is drawn frame by frame: cached keys and values, many sessions in one forward.

`StreamState` holds everything a session is, as plain tensors; `Streams` moves all of them on by one frame a `step`. A
session's cache has 1 + W slots for each layer and lane: slot 0 keeps position 0 (the prompt) for good, frame p stands
in slot 1 + (p - 1) mod W, so that an endless motion needs no more memory and no copy. A lane is a level, twice where
guidance wants a second branch. The attention always reads all slots: tokens depend neither on how long the sessions
beside one are, nor on how many there are (`shared.nn.sampling.uniform`).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, fields

import torch
from torch import Tensor

from shared.errors import InvalidInput
from shared.nn.packed import pack_linears
from shared.nn.sampling import guide, sample_top_k, uniform
from workers.mogo.attention import RelativeAttention
from workers.mogo.config import InferenceConfig
from workers.mogo.model import RQHCTransformer

NEVER = 2**62
"""More frames than any session makes."""
TOKEN_STREAM = 4
"""What random numbers are drawn for; 1 to 3 are HGM³'s."""


@dataclass(frozen=True)
class StreamState:
    """Sessions as rows of tensors: S of them, L lanes, V levels, W frames of window, H heads, w wide."""

    seeds: Tensor  # (S,) int64
    made: Tensor  # (S,) int64 frames drawn so far
    skipped: Tensor  # (S,) int64 frames that were made before the cache begins
    ends_from: Tensor  # (S,) int64: frames after which the session may draw END; NEVER: it runs until it is stopped
    ended: Tensor  # (S,) bool: it drew END, and from then on columns of -1
    last: Tensor  # (S, V) int64, the newest column; -1 before the first
    opening: Tensor  # (S, L, w) states of position 0, from which frame 1 is drawn
    keys: Tensor  # (layers, S, L, H, 1 + W, w / H)
    values: Tensor  # like `keys`

    @classmethod
    def empty(cls, model: RQHCTransformer, sessions: int, lanes: int, window: int) -> StreamState:
        """Room for so many sessions."""
        t, device = model.config.transformer, model.head.weight.device
        whole = torch.zeros(4, sessions, dtype=torch.long, device=device)
        cache = torch.zeros(t.layers, sessions, lanes, t.heads, 1 + window, t.width // t.heads, device=device)
        return cls(
            seeds=whole[0],
            made=whole[1],
            skipped=whole[2],
            ends_from=whole[3] + NEVER,
            ended=whole[3].bool(),
            last=torch.full((sessions, model.levels), -1, device=device),
            opening=torch.zeros(sessions, lanes, t.width, device=device),
            keys=cache,
            values=torch.zeros_like(cache),
        )

    def row(self, index: int) -> dict[str, Tensor]:
        """Views of one session's tensors."""
        names = [f.name for f in fields(self)]
        return {n: getattr(self, n)[:, index] if n in {"keys", "values"} else getattr(self, n)[index] for n in names}


class Streams:
    """Sessions that share the forward passes of one model; they join, leave and are steered between steps."""

    def __init__(
        self,
        model: RQHCTransformer,
        capacity: int,
        config: InferenceConfig | None = None,
        *,
        dtype: torch.dtype = torch.float32,
    ) -> None:
        """Make room for `capacity` sessions.

        Args:
            model: copied, and the copy packed for inference.
            capacity: sessions at most.
            config: None = the model's own.
            dtype: of the packed matrices on a CPU; bfloat16 halves what a frame reads.

        Raises:
            InvalidInput: a window beyond what the model was trained for.
        """
        self.config = config or model.config.inference
        self.window, self.farthest = self.config.window, model.config.max_frames
        if not 1 <= self.window <= self.farthest:
            raise InvalidInput(
                f"a window of {self.window} frames", hint=f"This model can look back 1 to {self.farthest} frames."
            )
        self.branches = 1 if self.config.guidance == 1 else 2
        self.state = StreamState.empty(model, capacity, self.branches * model.levels, self.window)
        self.capacity = capacity
        self.model = copy.deepcopy(model).eval().requires_grad_(False)
        self.sessions: list[int] = []  # the session in each row: the active rows come first
        self._started = 0
        self.blocks = self.model.trunk.layers
        self.terms = [block.attention.terms(self.model.trunk.sinusoids).contiguous() for block in self.blocks]
        pack_linears(self.model, dtype)

    def start(
        self, sentence: Tensor, seed: int, *, ends_from: int = NEVER, past: Tensor | None = None, skipped: int = 0
    ) -> int:
        """A new session; its first frame comes with the next step.

        Args:
            sentence: (W,) sentence features.
            seed: of its random numbers.
            ends_from: END may be drawn after so many frames (no length was asked for).
            past: (m, V) columns that were made before, to go on behind them: the last window is read in one pass.
                What it goes on with is continuous with them, not what the lost session would have drawn bit for bit.
            skipped: frames that were made before `past`.

        Returns:
            the session's name in all other methods.

        Raises:
            InvalidInput: no room, or `skipped` without `past`.
        """
        if skipped and (past is None or len(past) == 0):
            raise InvalidInput("a session goes on behind frames that are not given")
        row = self._take_row()
        before = 0 if past is None else len(past)
        past = self.state.last.new_zeros(0, self.model.levels) if past is None else past[-self.window :]
        mine = self.state.row(row)
        mine["seeds"].fill_(seed)
        mine["skipped"].fill_(skipped + before - len(past))
        mine["made"].fill_(skipped + before)
        mine["ends_from"].fill_(ends_from)
        mine["ended"].fill_(False)
        mine["last"].copy_(past[-1] if len(past) else torch.full_like(mine["last"], -1))
        self._read(row, sentence, past)
        return self.sessions[row]

    def steer(self, session: int, sentence: Tensor) -> None:
        """Another prompt (W,) from the next frame on: position 0 alone is computed anew, on each level."""
        self._read(self._row(session), sentence, self.state.last.new_zeros(0, self.model.levels))

    def stop(self, session: int) -> None:
        """Forget a session; its row goes to the last one."""
        row, last = self._row(session), len(self.sessions) - 1
        if row != last:
            source = self.state.row(last)
            for name, target in self.state.row(row).items():
                target.copy_(source[name])
        self.sessions[row] = self.sessions[last]
        self.sessions.pop()

    def step(self) -> dict[int, Tensor]:
        """Draw one frame of every session: its column (V,) of tokens, -1 in a session that has ended."""
        if not self.sessions:
            return {}
        column = self._draw(self.states())
        self.accept(column)
        return dict(zip(self.sessions, column.unbind(), strict=True))

    @torch.no_grad()
    def states(self) -> Tensor:
        """Trunk states (s, L, w) of the active rows, from which their next frame is drawn."""
        active, state = len(self.sessions), self.state
        made, skipped = state.made[:active], state.skipped[:active]
        slots = torch.arange(1, self.window + 1, device=made.device)
        back = (made[:, None] - slots) % self.window  # (s, W): frames since the slot was written
        back = back.masked_fill(back >= (made - skipped)[:, None], -1)
        distance = torch.cat([made.clamp(max=self.farthest)[:, None], back], 1)  # (s, 1 + W)
        # Before the first frame nothing is there to feed: the slot then written is overwritten before it is read.
        slot = 1 + (made - 1) % self.window
        x = self.model.columns(state.last[:active, None])[:, :, 0].repeat(1, self.branches, 1)  # (s, L, w)
        for layer, block in enumerate(self.blocks):
            x = block(x, lambda h, i=layer, b=block: self._attend(i, b.attention, h, distance, slot))
        return torch.where((made == 0)[:, None, None], state.opening[:active], self.model.trunk.norm(x))

    def accept(self, columns: Tensor) -> None:
        """Take columns (s, V) as the next frame of the active rows, drawn or known."""
        active = len(self.sessions)
        self.state.last[:active] = columns
        self.state.made[:active] += 1

    def save(self, session: int) -> dict[str, Tensor]:
        """All of a session as plain tensors; `resume` goes on with the very tokens that it would have drawn."""
        return {name: part.clone() for name, part in self.state.row(self._row(session)).items()}

    def resume(self, saved: Mapping[str, Tensor]) -> int:
        """A session from what `save` gave.

        Raises:
            InvalidInput: no room, or a session of another model, window or guidance.
        """
        row = self._take_row()
        mine = self.state.row(row)
        if {n: t.shape for n, t in saved.items()} != {n: t.shape for n, t in mine.items()}:
            self.sessions.pop()
            raise InvalidInput("the saved session is of another model, window or guidance")
        for name, part in mine.items():
            part.copy_(saved[name])
        return self.sessions[row]

    @torch.no_grad()
    def _read(self, row: int, sentence: Tensor, past: Tensor) -> None:
        """Write position 0, and behind it frames `past` (n, V), into a row's cache; one pass for all of it."""
        null = torch.arange(self.branches, device=past.device) > 0
        prompt = self.model.prompt(sentence.expand(self.branches, -1), null)[:, :, None]  # (branches, V, 1, w)
        frames = self.model.columns(past[None].expand(self.branches, -1, -1))  # (branches, V, n, w)
        x = torch.cat([prompt, frames], 2).flatten(0, 1)  # (L, 1 + n, w)
        skipped = self.state.skipped[row]
        reach = self.model.reach(len(past), skipped=skipped.expand(self.branches))
        position = skipped + torch.arange(len(past), device=past.device)  # of each frame, less 1
        slots = torch.cat([position.new_zeros(1), 1 + position % self.window])
        for layer, block in enumerate(self.blocks):

            def attend(h: Tensor, i: int = layer, attention: RelativeAttention = block.attention) -> Tensor:
                _, key, value = attention.project(h)  # (L, 1 + n, H, w / H)
                self.state.keys[i, row][:, :, slots] = key.transpose(1, 2)
                self.state.values[i, row][:, :, slots] = value.transpose(1, 2)
                return attention(h, self.terms[i], reach)

            x = block(x, attend)
        self.state.opening[row] = self.model.trunk.norm(x[:, 0])

    def _attend(self, layer: int, attention: RelativeAttention, x: Tensor, distance: Tensor, slot: Tensor) -> Tensor:
        """Put the new position's keys and values into `slot` (s,) and read the cache: (s, L, w) -> (s, L, w)."""
        query, key, value = attention.project(x)  # (s, L, H, w / H)
        active = torch.arange(len(x), device=x.device)
        keys, values = self.state.keys[layer, : len(x)], self.state.values[layer, : len(x)]
        keys[active, :, :, slot] = key
        values[active, :, :, slot] = value
        return attention.look_back(query, keys, values, self.terms[layer], distance)

    @torch.no_grad()
    def _draw(self, states: Tensor) -> Tensor:
        """Columns (s, V) from trunk states (s, L, w), level by level."""
        active, levels = len(states), self.model.levels
        states = states.view(active * self.branches, levels, -1)
        flat = self.model.score(states) if self.model.depth is None else None  # independent levels: one product
        codes = self.state.last.new_zeros(active, 0)
        ended = self.state.ended[:active]
        noise = self._noise(active)
        for level in range(levels):
            if flat is None:
                below = codes.repeat_interleave(self.branches, 0)
                refined = self.model.refine(states[:, : level + 1], below)[:, -1:]
                logits = self.model.score(refined, level)[:, 0]
            else:
                logits = flat[:, level]
            drawn = self._draw_level(logits.view(active, self.branches, -1), noise[:, level], level)
            if level == 0:
                ended |= drawn == self.model.end
            codes = torch.cat([codes, drawn.clamp(max=self.model.codes - 1)[:, None]], 1)
        return codes.masked_fill(ended[:, None], -1)

    def _noise(self, active: int) -> Tensor:
        """A number (s, V) for each session's seed, frame and level."""
        levels = torch.arange(self.model.levels, device=self.state.made.device)
        positions = self.state.made[:active, None] * len(levels) + levels  # (s, V)
        # every seed at everybody's positions, in one call; each session's own stand on the diagonal
        crossed = uniform(self.state.seeds[:active], TOKEN_STREAM, 0, positions.flatten())
        return crossed.view(active, active, -1).diagonal().T

    def _draw_level(self, logits: Tensor, noise: Tensor, level: int) -> Tensor:
        """Codes (s,) of one level from logits (s, branches, K + 1) and random numbers (s,)."""
        config, active = self.config, len(logits)
        guided = logits[:, 0] if self.branches == 1 else guide(logits[:, 0], logits[:, 1], config.guidance)
        if level == 0:
            may_end = self.state.made[:active] >= self.state.ends_from[:active]
            guided[:, self.model.end] = guided[:, self.model.end].where(may_end, -torch.inf)
        return sample_top_k(
            guided,
            noise,
            temperature=config.upper_temperature if level else config.temperature,
            share=config.upper_top_k if level else config.top_k,
        )

    def _take_row(self) -> int:
        if len(self.sessions) == self.capacity:
            raise InvalidInput(f"all {self.capacity} sessions are taken", hint="Stop one first.")
        self._started += 1
        self.sessions.append(self._started)
        return len(self.sessions) - 1

    def _row(self, session: int) -> int:
        if session not in self.sessions:
            raise InvalidInput(f"there is no session {session}", hint="It was stopped, or never started.")
        return self.sessions.index(session)
