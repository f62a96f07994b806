"""The acts that a session has still to come, and how long it waits for the end of each."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from marey.models.mogo.state import NEVER

EARLIEST, STOPS = 0.75, 1.7
"""Shares of its usual frames after which an act may end, and at which its clock stops: even long ones are over then."""
PLAN = ("acts", "lasts")
"""What `Plan.save` gives."""


@dataclass
class Plan:
    """What a session plays, and what comes behind it. Frames are counted from the session's first."""

    acts: Tensor  # (A, W)
    lasts: list[int]  # frames that each of them usually takes
    until: int  # frame by which the act that plays is over
    ends_from: int  # of the last one
    number: int = -1  # of the act that plays; none does yet
    earliest: int = 0  # frame after which the act that plays may end
    stops: int = NEVER  # frames of the act that plays after which its clock stops

    @classmethod
    def of(cls, sentence: Tensor, ends_from: int, lasts: Sequence[int] | None) -> Plan:
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
    def load(cls, saved: Mapping[str, Tensor]) -> Plan:
        """From what `save` gave."""
        *lasts, until, ends_from, number = saved["lasts"].tolist()
        return cls(saved["acts"], lasts, until, ends_from, number)
