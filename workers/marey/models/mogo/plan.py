"""Plan of a session: its remaining actions, and how long it waits for the end of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from marey.models.mogo.state import NEVER

EARLIEST, STOPS = 0.75, 1.7
"""Shares of its usual frames after which an action may end, and at which its clock stops: even long actions are over
by then."""
PLAN = ("acts", "lasts")
"""Names of the tensors of `ActionPlan.save`."""


@dataclass
class ActionPlan:
    """Actions of a session, current and remaining. Frames are counted from the session's first."""

    actions: Tensor  # (A, W)
    lasts: list[int]  # usual frames of each
    until: int  # frame by which the current action is over
    ends_from: int  # frame from which the last action may end
    number: int = -1  # of the current action; -1 before the first
    earliest: int = 0  # frame after which the current action may end
    stops: int = NEVER  # frames of the current action after which its clock stops

    @classmethod
    def of(cls, sentence: Tensor, ends_from: int, lasts: Sequence[int] | None) -> ActionPlan:
        """Create a plan of a sentence (W,) or of actions (A, W); see `StreamBatch.start`."""
        actions = torch.atleast_2d(sentence)
        return cls(actions, [NEVER] * len(actions) if lasts is None else list(lasts), 0, ends_from)

    def take(self, began: int, skipped: int = 0) -> Tensor:
        """Return the next action (W,), or the one after `skipped` others; it begins at frame `began`."""
        actions, lasts = self.actions[skipped:], self.lasts[skipped:]
        self.until = began + lasts[0]
        self.earliest = began + (0 if lasts[0] == NEVER else int(EARLIEST * lasts[0]))
        self.stops = NEVER if lasts[0] == NEVER else int(STOPS * lasts[0])
        self.actions, self.lasts = actions[1:], lasts[1:]
        self.number += 1 + skipped
        return actions[0]

    def save(self) -> dict[str, Tensor]:
        """Return the plan as tensors named `PLAN`."""
        return {
            "acts": self.actions.clone(),
            "lasts": torch.tensor([*self.lasts, self.until, self.ends_from, self.number]),
        }

    @classmethod
    def load(cls, saved: Mapping[str, Tensor]) -> ActionPlan:
        """Create a plan from the result of `save`."""
        *lasts, until, ends_from, number = saved["lasts"].tolist()
        return cls(saved["acts"], lasts, until, ends_from, number)
