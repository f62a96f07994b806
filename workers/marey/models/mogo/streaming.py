"""Motion drawn frame by frame: cached keys and values, many sessions in one forward pass.

`SessionState` holds the whole state of the sessions as plain tensors; each `StreamBatch.step` draws one frame of all of
them. A session's cache has m + W slots for each layer and lane: slot 0 keeps position 0 (the prompt), slots up to m
other positions before the frames (a level token; usually m = 1), and frame p is in slot m + (p - 1) mod W, so an
endless motion needs no more memory and no copy. A lane is a level, twice if guidance
needs a second branch. Attention always reads all slots: tokens depend neither on the length nor on the number of the
other sessions (`marey.nn.sampling.uniform`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import torch
from torch import Tensor

from marey.core.errors import InvalidInput
from marey.models.mogo.attention import RelativeAttention
from marey.models.mogo.config import InferenceConfig
from marey.models.mogo.next_frame import NextFrame
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.plan import PLAN, ActionPlan
from marey.models.mogo.replay import Replayed
from marey.models.mogo.state import NEVER, SessionState
from marey.streams.actions import ActionStart


class StreamBatch:
    """Sessions that share the forward passes of one model; they start, stop and are steered between steps."""

    def __init__(
        self,
        packed: PackedModel,
        capacity: int,
        config: InferenceConfig | None = None,
    ) -> None:
        """Allocate `capacity` sessions.

        Args:
            packed: the model, shared with other streams.
            capacity: largest number of sessions.
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
        self.branches = 1 if self.config.guidance == self.config.upper_guidance == 1 else 2
        self.state = SessionState.empty(packed, capacity, self.branches, self.window)
        self.capacity = capacity
        self.sessions: list[int] = []  # the session in each row: the active rows come first
        self._next = NextFrame(packed, self.state, self.config)
        self._draw: Callable[[int], Tensor] = self._next
        if packed.device.type == "cuda":
            self._draw = Replayed(self._next, capacity, packed.device)
        self._plans: dict[int, ActionPlan] = {}
        self._made: dict[int, int] = {}  # frames of each session, kept on the host to avoid reading the device
        self._started = 0

    def prepare(self) -> None:
        """Do one-time work now that would delay the first frames."""
        if isinstance(self._draw, Replayed):
            self._draw.prepare()

    def start(
        self,
        sentence: Tensor,
        seed: int,
        *,
        ends_from: int = NEVER,
        lasts: Sequence[int] | None = None,
        past: Tensor | None = None,
        skipped: int = 0,
        began: ActionStart | None = None,
    ) -> int:
        """Start a session; its first frame comes with the next step.

        Args:
            sentence: (W,) sentence features, or (A, W) of actions in order: where END is drawn the next one starts.
            seed: of its random numbers.
            ends_from: frames after which END of the last action may be drawn (no length was requested).
            lasts: usual frames (A,) of each action: if another follows, it is over then even without END, and END is
                allowed only near it. None = an action continues until END is drawn.
            past: (m, V) columns drawn before, to continue from: the last window is read in one pass. The continuation
                is continuous with them, but not bit for bit the lost session's.
            skipped: number of frames before `past`.
            began: the current action at the end of `past`, with the frame at which it began; None = the first action
                begins there.

        Returns:
            the session's id in all other methods.

        Raises:
            InvalidInput: no free row, `skipped` without `past`, or an unknown or future action.
        """
        if skipped and (past is None or len(past) == 0):
            raise InvalidInput("`skipped` needs `past`: the frames to continue from are missing")
        before = 0 if past is None else len(past)
        actions = len(torch.atleast_2d(sentence))
        if began is not None and not (0 <= began.action < actions and 0 <= began.frame <= skipped + before):
            raise InvalidInput(f"{began} is not among {actions} actions and {skipped + before} frames", where="began")
        row = self._take_row()
        past = self.state.last.new_zeros(0, self.model.levels) if past is None else past[-self.window :]
        mine = self.state.row(row)
        mine["memory"].zero_()  # a NaN would spread through hidden slots
        mine["seeds"].fill_(seed)
        mine["skipped"].fill_(skipped + before - len(past))
        mine["made"].fill_(skipped + before)
        mine["last"].copy_(past[-1] if len(past) else torch.full_like(mine["last"], -1))
        session = self.sessions[row]
        plan = self._plans[session] = ActionPlan.of(sentence, ends_from, lasts)
        self._made[session] = skipped + before
        self._begin(row, plan, past, began)
        return session

    def steer(self, session: int, sentence: Tensor, lasts: Sequence[int] | None = None) -> None:
        """Replace the prompt from the next frame on: (W,) or (A, W), with `lasts` as in `start`. Position 0 alone is
        computed anew, on each level; the inputs of earlier frames stay."""
        plan = self._plans[session] = ActionPlan.of(sentence, NEVER, lasts)
        self._begin(self._row(session), plan)

    def action(self, session: int) -> int:
        """Return the number of the current action among those of the current prompt."""
        return self._plans[session].number

    def stop(self, session: int) -> None:
        """Remove a session; the last session moves to its row."""
        row, last = self._row(session), len(self.sessions) - 1
        if row != last:
            source = self.state.row(last)
            for name, target in self.state.row(row).items():
                target.copy_(source[name])
        self.sessions[row] = self.sessions[last]
        self.sessions.pop()
        del self._plans[session], self._made[session]

    def step(self, only: int | None = None) -> dict[int, Tensor]:
        """Draw one frame of every session, or of session `only`: its column (V,) of tokens, -1 where it has ended."""
        if only is not None:
            self._exchange(self._row(only), 0)
        rows = len(self.sessions) if only is None else 1
        if not rows:
            return {}
        for row, plan in self._unfinished(rows):
            if self._made[self.sessions[row]] >= plan.until:
                self._begin(row, plan)
        column = self._draw(rows)
        while due := self._due(column):
            for row, plan in due:  # the first frame of the next action replaces END; others keep their columns
                self._begin(row, plan)
            column = self._draw(rows)
        self.accept(column)
        return dict(zip(self.sessions[:rows], column.unbind(), strict=True))

    def states(self) -> Tensor:
        """Return the trunk's states (s, L, w) of the active rows, from which their next frame is drawn."""
        return self._next.states(len(self.sessions))

    def accept(self, columns: Tensor) -> None:
        """Take columns (s, V), drawn or known, as the next frame of the first s rows."""
        rows = len(columns)
        self.state.last[:rows] = columns
        self.state.made[:rows] += 1
        for session in self.sessions[:rows]:
            self._made[session] += 1

    def save(self, session: int) -> dict[str, Tensor]:
        """Return all state of a session as plain tensors in host memory; `resume` continues with exactly the tokens
        that it would have drawn."""
        tensors = {name: part.to("cpu", copy=True) for name, part in self.state.row(self._row(session)).items()}
        return {**tensors, **self._plans[session].save()}

    def resume(self, saved: Mapping[str, Tensor]) -> int:
        """Start a session from the result of `save`.

        Raises:
            InvalidInput: no free row, or a session of another model, window or guidance.
        """
        row = self._take_row()
        mine = self.state.row(row)
        tensors = {name: part for name, part in saved.items() if name not in PLAN}
        if {n: t.shape for n, t in tensors.items()} != {n: t.shape for n, t in mine.items()}:
            self.sessions.pop()
            raise InvalidInput("the saved session is of another model, window or guidance")
        for name, part in mine.items():
            part.copy_(saved[name])
        session = self.sessions[row]
        self._plans[session], self._made[session] = ActionPlan.load(saved), int(saved["made"])
        return session

    def _unfinished(self, rows: int) -> list[tuple[int, ActionPlan]]:
        """Return those of the first rows that have actions left."""
        plans = ((row, self._plans[session]) for row, session in enumerate(self.sessions[:rows]))
        return [(row, plan) for row, plan in plans if len(plan.actions)]

    def _due(self, columns: Tensor) -> list[tuple[int, ActionPlan]]:
        """Return the rows that have actions left and have just drawn END."""
        unfinished = self._unfinished(len(columns))
        ended = (columns[:, 0] < 0).tolist() if unfinished else []
        return [(row, plan) for row, plan in unfinished if ended[row]]

    def _begin(self, row: int, plan: ActionPlan, past: Tensor | None = None, began: ActionStart | None = None) -> None:
        """Start the next action of a row's plan, or the current one."""
        began = began or ActionStart(self._made[self.sessions[row]], 0)
        action = plan.take(began.frame, began.action)
        mine = self.state.row(row)
        mine["began"].fill_(began.frame)
        mine["stops"].fill_(plan.stops)
        self._read(row, action, self.state.last.new_zeros(0, self.model.levels) if past is None else past)
        shortest = began.frame + self.model.config.min_frames if began.frame or len(plan.actions) else 0
        ends_from = max(shortest, plan.earliest, 0 if len(plan.actions) else plan.ends_from)
        mine["ends_from"].fill_(ends_from)
        mine["ended"].fill_(False)

    @torch.no_grad()
    def _read(self, row: int, sentence: Tensor, past: Tensor) -> None:
        """Write position 0 and after it frames `past` (n, V) to a row's cache; one pass for all of it.

        A level token is written where the cache begins: under a later prompt it stays what it was, as in training.
        """
        null = torch.arange(self.branches, device=past.device) > 0
        prompts = sentence.expand(self.branches, -1)
        prompt, prompt_term = self.model.prompt(prompts, null)  # (branches, V, w), (branches, w)
        skipped = self.state.skipped[row]
        position = skipped + torch.arange(len(past), device=past.device)  # of each frame, less 1
        frames = self.model.columns(past[None].expand(self.branches, -1, -1)) + prompt_term[:, None, None]
        if self.packed.times is not None:
            frames[0] += self._next.time(1 + position, self.state.began[row], self.state.stops[row])
        first = prompt[:, :, None]
        if len(past) or not self._made[self.sessions[row]]:
            first = self.model.leading(first)
        before = first.shape[2]
        x = torch.cat([first, frames], 2).flatten(0, 2)  # (L · (m + n), w): one product for all of them
        self.state.prompt_term[row] = prompt_term.repeat_interleave(self.model.lanes, 0)
        reach = self.model.reach(before - 1 + len(past), skipped=skipped.expand(self.branches))
        slots = torch.cat([torch.arange(before, device=past.device), self.model.leads + position % self.window])
        for layer, block in enumerate(self.packed.blocks):

            def attend(h: Tensor, i: int = layer, attention: RelativeAttention = block.attention) -> Tensor:
                query, key, value = (part.unflatten(0, (-1, len(slots))) for part in attention.project(h))
                for kept, part in zip(self.state.memory[i, :, row], (key, value), strict=True):
                    kept[:, :, slots] = part.permute(2, 0, 1, 3).to(kept.dtype)  # (L, m + n, H, w / H), heads first
                return attention.out(attention.mix(query, key, value, self.packed.terms[i], reach).flatten(0, 1))

            x = block(x, attend)
        self.state.opening[row] = self.model.trunk.norm(x.unflatten(0, (-1, len(slots)))[:, before - 1])

    def _take_row(self) -> int:
        if len(self.sessions) == self.capacity:
            raise InvalidInput(f"all {self.capacity} sessions are taken", hint="Stop one first.")
        self._started += 1
        self.sessions.append(self._started)
        return len(self.sessions) - 1

    def _exchange(self, row: int, other: int) -> None:
        """Swap the rows of two sessions."""
        if row != other:
            second = self.state.row(other)
            for name, first in self.state.row(row).items():
                kept = first.clone()
                first.copy_(second[name])
                second[name].copy_(kept)
            self.sessions[row], self.sessions[other] = self.sessions[other], self.sessions[row]

    def _row(self, session: int) -> int:
        if session not in self.sessions:
            raise InvalidInput(f"unknown session {session}", hint="It was stopped, or never started.")
        return self.sessions.index(session)
