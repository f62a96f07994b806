"""Motion that is drawn frame by frame: cached keys and values, many sessions in one forward.

`StreamState` holds everything a session is, as plain tensors; `Streams` moves all of them on by one frame a `step`. A
session's cache has 1 + W slots for each layer and lane: slot 0 keeps position 0 (the prompt) for good, frame p stands
in slot 1 + (p - 1) mod W, so that an endless motion needs no more memory and no copy. A lane is a level, twice where
guidance wants a second branch. The attention always reads all slots: tokens depend neither on how long the sessions
beside one are, nor on how many there are (`shared.nn.sampling.uniform`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields

import torch
import torch.nn.functional as F
from torch import Tensor

from shared.errors import InvalidInput
from shared.nn.sampling import guide, sample_top_k, uniform
from shared.streams.acts import Begun
from workers.mogo.attention import HIDDEN, RelativeAttention, Slots
from workers.mogo.clock import UNTOLD
from workers.mogo.config import InferenceConfig
from workers.mogo.depth import DepthFrame
from workers.mogo.packed_model import PackedModel

NEVER = 2**62
"""More frames than any session makes."""
TOKEN_STREAM, END_STREAM = 4, 5
"""What random numbers are drawn for; 1 to 3 are HGM³'s."""
EARLIEST, STOPS = 0.75, 1.7
"""Shares of its usual frames after which an act may end, and at which its clock stops: even long ones are over then."""


@dataclass(frozen=True)
class StreamState:
    """Sessions as rows of tensors: S of them, L lanes, V levels, W frames of window, H heads, w wide."""

    seeds: Tensor  # (S,) int64
    made: Tensor  # (S,) int64 frames drawn so far
    skipped: Tensor  # (S,) int64 frames that were made before the cache begins
    ends_from: Tensor  # (S,) int64: frames after which the session may draw END; NEVER: it runs until it is stopped
    began: Tensor  # (S,) int64 frames made when the act that plays began
    stops: Tensor  # (S,) int64 frames of it after which its clock stops; NEVER where nobody says how long it takes
    ended: Tensor  # (S,) bool: it drew END, and from then on columns of -1
    last: Tensor  # (S, V) int64, the newest column; -1 before the first
    opening: Tensor  # (S, L, w) states of position 0, from which frame 1 is drawn
    told: Tensor  # (S, L, w) what the prompt in force adds to every frame
    memory: Tensor  # (layers, 2, S, H, L, 1 + W, w / H) keys and values

    @classmethod
    def empty(cls, packed: PackedModel, sessions: int, branches: int, window: int) -> StreamState:
        """Room for so many sessions."""
        model, device = packed.network, packed.device
        t, lanes = model.config.transformer, branches * model.lanes
        whole = torch.zeros(6, sessions, dtype=torch.long, device=device)
        return cls(
            seeds=whole[0],
            made=whole[1],
            skipped=whole[2],
            ends_from=whole[3] + NEVER,
            began=whole[4],
            stops=whole[5] + NEVER,
            ended=whole[3].bool(),
            last=torch.full((sessions, model.levels), -1, device=device),
            opening=torch.zeros(sessions, lanes, t.width, device=device),
            told=torch.zeros(sessions, lanes, t.width, device=device),
            memory=torch.zeros(t.layers, 2, sessions, t.heads, lanes, 1 + window, t.width // t.heads, device=device),
        )

    def row(self, index: int) -> dict[str, Tensor]:
        """Views of one session's tensors."""
        rows = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "memory"}
        return {**rows, "memory": self.memory[:, :, index]}


PLAN = ("acts", "lasts")


@dataclass
class _Plan:
    """The acts that a session has still to come."""

    acts: Tensor  # (A, W)
    lasts: list[int]  # frames that each of them usually takes
    until: int  # frames of the session by which the act that plays is over
    ends_from: int  # of the last one
    number: int = -1  # of the act that plays; none does yet
    earliest: int = 0  # frames of the session after which the act that plays may end
    stops: int = NEVER  # frames of the act that plays after which its clock stops

    @classmethod
    def of(cls, sentence: Tensor, ends_from: int, lasts: Sequence[int] | None) -> _Plan:
        """Of a sentence (W,) or of acts (A, W); see `Streams.start`."""
        acts = torch.atleast_2d(sentence)
        return cls(acts, [NEVER] * len(acts) if lasts is None else list(lasts), 0, ends_from)

    def take(self, began: int, skipped: int = 0) -> Tensor:
        """The next act (W,), or that behind so many others; it begins at frame `began`."""
        acts, lasts = self.acts[skipped:], self.lasts[skipped:]
        self.until = began + lasts[0]
        self.earliest = began + (0 if lasts[0] == NEVER else int(EARLIEST * lasts[0]))
        self.stops = NEVER if lasts[0] == NEVER else int(STOPS * lasts[0])
        self.acts, self.lasts = acts[1:], lasts[1:]
        self.number += 1 + skipped
        return acts[0]

    def save(self) -> dict[str, Tensor]:
        """As tensors named `PLAN`."""
        return {
            "acts": self.acts.clone(),
            "lasts": torch.tensor([*self.lasts, self.until, self.ends_from, self.number]),
        }

    @classmethod
    def load(cls, saved: Mapping[str, Tensor]) -> _Plan:
        """From what `save` gave."""
        *lasts, until, ends_from, number = saved["lasts"].tolist()
        return cls(saved["acts"], lasts, until, ends_from, number)


class Streams:
    """Sessions that share the forward passes of one model; they join, leave and are steered between steps."""

    def __init__(
        self,
        packed: PackedModel,
        capacity: int,
        config: InferenceConfig | None = None,
    ) -> None:
        """Make room for `capacity` sessions.

        Args:
            packed: the model, shared with other streams.
            capacity: sessions at most.
            config: None = the model's own.

        Raises:
            InvalidInput: a window beyond what the model was trained for.
        """
        self.packed, self.model = packed, packed.network
        self.config = config or self.model.config.inference
        self.window, self.farthest = self.config.window, self.model.config.max_frames
        if not 1 <= self.window <= self.farthest:
            raise InvalidInput(
                f"a window of {self.window} frames", hint=f"This model can look back 1 to {self.farthest} frames."
            )
        self.branches = 1 if self.config.guidance == 1 else 2
        self.state = StreamState.empty(packed, capacity, self.branches, self.window)
        self.capacity = capacity
        self.sessions: list[int] = []  # the session in each row: the active rows come first
        self._plans: dict[int, _Plan] = {}
        self._started = 0

    def start(
        self,
        sentence: Tensor,
        seed: int,
        *,
        ends_from: int = NEVER,
        lasts: Sequence[int] | None = None,
        past: Tensor | None = None,
        skipped: int = 0,
        began: Begun | None = None,
    ) -> int:
        """A new session; its first frame comes with the next step.

        Args:
            sentence: (W,) sentence features, or (A, W) of acts in order: where END is drawn the next one is steered to.
            seed: of its random numbers.
            ends_from: END of the last act may be drawn after so many frames (no length was asked for).
            lasts: frames (A,) that each act usually takes: where another comes it is over then although END was not
                drawn, and END may be drawn near it only. None = an act goes on until END is drawn.
            past: (m, V) columns that were made before, to go on behind them: the last window is read in one pass.
                What it goes on with is continuous with them, not what the lost session would have drawn bit for bit.
            skipped: frames that were made before `past`.
            began: the act that plays behind `past`, and the frame of the session at which it began; None = the first
                act begins behind them.

        Returns:
            the session's name in all other methods.

        Raises:
            InvalidInput: no room, `skipped` without `past`, or an act that is none of these or still to come.
        """
        if skipped and (past is None or len(past) == 0):
            raise InvalidInput("a session goes on behind frames that are not given")
        before = 0 if past is None else len(past)
        acts = len(torch.atleast_2d(sentence))
        if began is not None and not (0 <= began.act < acts and 0 <= began.frame <= skipped + before):
            raise InvalidInput(f"{began} is no place among {acts} acts and {skipped + before} frames", where="began")
        row = self._take_row()
        past = self.state.last.new_zeros(0, self.model.levels) if past is None else past[-self.window :]
        mine = self.state.row(row)
        mine["seeds"].fill_(seed)
        mine["skipped"].fill_(skipped + before - len(past))
        mine["made"].fill_(skipped + before)
        mine["last"].copy_(past[-1] if len(past) else torch.full_like(mine["last"], -1))
        plan = self._plans[self.sessions[row]] = _Plan.of(sentence, ends_from, lasts)
        self._begin(row, plan, past, began)
        return self.sessions[row]

    def steer(self, session: int, sentence: Tensor, lasts: Sequence[int] | None = None) -> None:
        """Another prompt, (W,) or (A, W) with `lasts` as in `start`, from the next frame on: position 0 alone is
        computed anew, on each level; what the frames so far were told stays."""
        plan = self._plans[session] = _Plan.of(sentence, NEVER, lasts)
        self._begin(self._row(session), plan)

    def act(self, session: int) -> int:
        """Number of the act that plays, among those of the prompt in force."""
        return self._plans[session].number

    def stop(self, session: int) -> None:
        """Forget a session; its row goes to the last one."""
        row, last = self._row(session), len(self.sessions) - 1
        if row != last:
            source = self.state.row(last)
            for name, target in self.state.row(row).items():
                target.copy_(source[name])
        self.sessions[row] = self.sessions[last]
        self.sessions.pop()
        del self._plans[session]

    def step(self) -> dict[int, Tensor]:
        """Draw one frame of every session: its column (V,) of tokens, -1 in a session that has ended."""
        if not self.sessions:
            return {}
        for row, plan in self._unfinished():
            if int(self.state.made[row]) >= plan.until:
                self._begin(row, plan)
        column = self._draw(self.states())
        while due := [(row, plan) for row, plan in self._unfinished() if self.state.ended[row]]:
            for row, plan in due:  # the first frame of the next act comes in place of END; others draw what they drew
                self._begin(row, plan)
            column = self._draw(self.states())
        self.accept(column)
        return dict(zip(self.sessions, column.unbind(), strict=True))

    @torch.no_grad()
    def states(self) -> Tensor:
        """Trunk states (s, L, w) of the active rows, from which their next frame is drawn."""
        active, state = len(self.sessions), self.state
        slots = self._slots(active)
        x = self.model.columns(state.last[:active, None])[:, :, 0].repeat(1, self.branches, 1)  # (s, L, w)
        x = x + state.told[:active]
        if self.packed.times is not None:
            rows = (part[:active] for part in (state.made, state.began, state.stops))
            x[:, : self.model.lanes] += self._time(*rows)[:, None]  # guidance's other branch is told nothing
        for layer, step in enumerate(self.packed.steps):
            x = step(x, state.memory[layer, :, :active], self.packed.terms[layer], slots)
        return torch.where((state.made[:active] == 0)[:, None, None], state.opening[:active], self.model.trunk.norm(x))

    def accept(self, columns: Tensor) -> None:
        """Take columns (s, V) as the next frame of the active rows, drawn or known."""
        active = len(self.sessions)
        self.state.last[:active] = columns
        self.state.made[:active] += 1

    def save(self, session: int) -> dict[str, Tensor]:
        """All of a session as plain tensors; `resume` goes on with the very tokens that it would have drawn."""
        tensors = {name: part.clone() for name, part in self.state.row(self._row(session)).items()}
        return {**tensors, **self._plans[session].save()}

    def resume(self, saved: Mapping[str, Tensor]) -> int:
        """A session from what `save` gave.

        Raises:
            InvalidInput: no room, or a session of another model, window or guidance.
        """
        row = self._take_row()
        mine = self.state.row(row)
        tensors = {name: part for name, part in saved.items() if name not in PLAN}
        if {n: t.shape for n, t in tensors.items()} != {n: t.shape for n, t in mine.items()}:
            self.sessions.pop()
            raise InvalidInput("the saved session is of another model, window or guidance")
        for name, part in mine.items():
            part.copy_(saved[name])
        self._plans[self.sessions[row]] = _Plan.load(saved)
        return self.sessions[row]

    def _unfinished(self) -> list[tuple[int, _Plan]]:
        """Rows that have acts to come."""
        plans = ((row, self._plans[session]) for row, session in enumerate(self.sessions))
        return [(row, plan) for row, plan in plans if len(plan.acts)]

    def _begin(self, row: int, plan: _Plan, past: Tensor | None = None, began: Begun | None = None) -> None:
        """Tell a row the next act of its plan, or the one that plays already."""
        began = began or Begun(int(self.state.made[row]), 0)
        act = plan.take(began.frame, began.act)
        self.state.began[row], self.state.stops[row] = began.frame, plan.stops
        self._read(row, act, self.state.last.new_zeros(0, self.model.levels) if past is None else past)
        shortest = began.frame + self.model.config.min_frames if began.frame or len(plan.acts) else 0
        ends_from = max(shortest, plan.earliest, 0 if len(plan.acts) else plan.ends_from)
        self.state.ends_from[row] = ends_from
        self.state.ended[row] = False

    @torch.no_grad()
    def _read(self, row: int, sentence: Tensor, past: Tensor) -> None:
        """Write position 0, and behind it frames `past` (n, V), into a row's memory; one pass for all of it."""
        null = torch.arange(self.branches, device=past.device) > 0
        prompt, told = self.model.prompt(sentence.expand(self.branches, -1), null)  # (branches, V, w), (branches, w)
        skipped = self.state.skipped[row]
        position = skipped + torch.arange(len(past), device=past.device)  # of each frame, less 1
        frames = self.model.columns(past[None].expand(self.branches, -1, -1)) + told[:, None, None]
        if self.packed.times is not None:
            frames[0] += self._time(1 + position, self.state.began[row], self.state.stops[row])
        x = torch.cat([prompt[:, :, None], frames], 2).flatten(0, 2)  # (L · (1 + n), w): one product for all of them
        self.state.told[row] = told.repeat_interleave(self.model.lanes, 0)
        reach = self.model.reach(len(past), skipped=skipped.expand(self.branches))
        slots = torch.cat([position.new_zeros(1), 1 + position % self.window])
        for layer, block in enumerate(self.packed.blocks):

            def attend(h: Tensor, i: int = layer, attention: RelativeAttention = block.attention) -> Tensor:
                query, key, value = (part.unflatten(0, (-1, len(slots))) for part in attention.project(h))
                for kept, part in zip(self.state.memory[i, :, row], (key, value), strict=True):
                    kept[:, :, slots] = part.permute(2, 0, 1, 3)  # (L, 1 + n, H, w / H), heads first
                return attention.out(attention.mix(query, key, value, self.packed.terms[i], reach).flatten(0, 1))

            x = block(x, attend)
        self.state.opening[row] = self.model.trunk.norm(x.unflatten(0, (-1, len(slots)))[:, 0])

    def _time(self, made: Tensor, began: Tensor, stops: Tensor) -> Tensor:
        """What frames of one act are told, (n, w). The last act of a stream goes on although it is over, and its clock
        stops: whoever was told that more time passed would raise a hand again and again, which is a wave."""
        times = self.packed.times
        assert times is not None
        return times[torch.minimum(made - began, stops).clamp(UNTOLD, self.farthest)]

    def _slots(self, active: int) -> Slots:
        """Where the active rows stand. Slot p holds frame p, frame p + W, …; slot 0 the prompt."""
        made, skipped = self.state.made[:active], self.state.skipped[:active]
        places = torch.arange(1, self.window + 1, device=made.device)
        back = (made[:, None] - places) % self.window  # (s, W): frames since the slot was written
        hidden = F.pad((back >= (made - skipped)[:, None]) * HIDDEN, (1, 0))  # the prompt is always read
        distance = torch.cat([made.clamp(max=self.farthest)[:, None], back], 1)  # (s, 1 + W)
        # Before the first frame nothing is there to feed: the slot then written is overwritten before it is read.
        newest = 1 + (made - 1) % self.window
        return Slots(torch.arange(active, device=made.device), newest, distance[:, None, None], hidden[:, None, None])

    @torch.no_grad()
    def _draw(self, states: Tensor) -> Tensor:
        """Columns (s, V) from trunk states (s, L, w), level by level where a level knows those below."""
        active, levels, model = len(states), self.model.levels, self.model
        noise = self._noise(active)
        states = states.view(active, self.branches, model.lanes, -1)
        if model.depth is None:
            logits = model.head(states.flatten(1, 2)).view(*states.shape[:3], -1)
            ending = self._ends(logits[:, 0, 0])
            drawn = [self._pick(logits[:, :, :1], noise[:, :1]), self._pick(logits[:, :, 1:], noise[:, 1:], 1)]
        else:
            assert self.packed.depth is not None
            frame, drawn = DepthFrame(model.depth, self.packed.depth, states), list[Tensor]()
            ending = self.state.ended[:active]
            for level in range(levels):
                below = model.embedding(drawn[-1][:, 0].clamp(max=model.codes - 1)) if drawn else None
                logits = model.head(frame.next(below))[:, :, None]
                ending = ending if level else self._ends(logits[:, 0, 0])
                drawn.append(self._pick(logits, noise[:, level : level + 1], level))
        codes = torch.cat(drawn, 1)
        ended = self.state.ended[:active]
        ended |= ending
        return codes.masked_fill(ended[:, None], -1)

    def _ends(self, logits: Tensor) -> Tensor:
        """Whether END comes (s,), from level 0's logits (s, K + 1) under the prompt.

        It is drawn apart from the codes, with its own chance: temperatures below 1 and guidance, which sharpen codes,
        all but forbid what has a small chance at each of many frames.
        """
        made = self.state.made[: len(logits)]
        chance = logits.float().softmax(-1)[:, self.model.end]
        drawn = uniform(self.state.seeds[: len(logits)], END_STREAM, 0, made).diagonal()
        return (drawn < chance) & (made >= self.state.ends_from[: len(logits)])

    def _noise(self, active: int) -> Tensor:
        """A number (s, V) for each session's seed, frame and level."""
        levels = torch.arange(self.model.levels, device=self.state.made.device)
        positions = self.state.made[:active, None] * len(levels) + levels  # (s, V)
        # every seed at everybody's positions, in one call; each session's own stand on the diagonal
        crossed = uniform(self.state.seeds[:active], TOKEN_STREAM, 0, positions.flatten())
        return crossed.view(active, active, -1).diagonal().T

    def _pick(self, logits: Tensor, noise: Tensor, level: int = 0) -> Tensor:
        """Codes (s, n) of levels that are drawn alike, `level` the lowest, from logits (s, branches, n, K + 1) and
        random numbers (s, n)."""
        config = self.config
        guided = logits[:, 0] if self.branches == 1 else guide(logits[:, 0], logits[:, 1], config.guidance)
        guided[..., self.model.end] = -torch.inf  # drawn apart
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
