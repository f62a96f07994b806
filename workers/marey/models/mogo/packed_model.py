"""The inference twin of a model: matrices packed or in fewer bits, steps compiled, position terms computed once; any
number of `StreamBatch` share it."""

from __future__ import annotations

import copy

import torch
import torch.nn.functional as F

from marey.models.mogo.depth import DepthStep
from marey.models.mogo.model import RQHCTransformer, TrunkStep
from marey.nn.compiled import Module, compiled
from marey.nn.packed import GroupedLinear, can_pack, cast_linears, is_small, pack_linears

MOST_GROUPED = 8
"""Sessions of one product: 48 rows. Beyond them the product takes the time, not reading the weights."""


def sessions_of_product(model: RQHCTransformer, sessions: int) -> int:
    """Return `group` of a `PackedModel` for up to `sessions` sessions: large weights are read once for all of them."""
    return 1 if is_small(model) else min(sessions, MOST_GROUPED)


class PackedModel:
    """A model prepared to draw frame by frame. Building it takes over a tenth of a second, so build it once."""

    def __init__(self, model: RQHCTransformer, *, dtype: torch.dtype = torch.float32, group: int = 1) -> None:
        """Copy and pack a model.

        Args:
            model: not changed.
            dtype: of the matrices; bfloat16 halves the memory that a frame reads. On a GPU also of the cached keys and
                values.
            group: sessions that share the products of large matrices on a CPU (see `GroupedLinear`).
        """
        self.network = copy.deepcopy(model).eval().requires_grad_(False)
        self.device = self.network.head.weight.device
        self.blocks = self.network.trunk.layers
        self.terms = [block.attention.terms(self.network.trunk.sinusoids).contiguous() for block in self.blocks]
        clock = self.network.clock
        frames = torch.arange(self.network.config.max_frames + 1, device=self.device)
        # the last row, for `UNKNOWN_TIME`, is zero
        self.times = None if clock is None else F.pad(clock(frames), (0, 0, 0, 1))
        on_cpu = self.device.type == "cpu"
        head = self.network.head
        self.kept = torch.float32 if on_cpu else dtype  # type of keys and values
        if on_cpu:
            pack_linears(self.network, dtype, group=group)
        else:
            cast_linears(self.network, dtype)
        if self.network.config.float_logits:
            self.network.add_module("head", GroupedLinear(head, group=group) if on_cpu and can_pack(head) else head)
        # elsewhere calls are recorded and replayed, and an active compiler would be recorded too
        made = compiled if on_cpu else _as_it_is
        self.steps = [made(TrunkStep(block)) for block in self.blocks]
        self.depth = None if self.network.depth is None else made(DepthStep(self.network.depth))


def _as_it_is(module: Module) -> Module:
    return module
