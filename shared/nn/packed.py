"""Linear layers packed for inference on a CPU: faster on few rows, and a row's bits do not depend on the others.

`torch.nn.functional.linear` takes other kernels, which add in another order, for fewer than some 18 rows. oneDNN's
packed product in float32 does so for a single row alone: measured with torch 2.13 on AVX-512 for 16 shapes, 2 to 192
rows give equal bits; 6 rows by 1024 x 3072 take 0.6 ms in place of 0.9. In bfloat16, which halves that, bits do depend
on the number of rows while they are few, so they go in blocks of one size. Many rows at once (128 and more) are 5 %
faster than with torch's own product, which packs the weights anew each time, and give the very same bits.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_BLOCK = 48
"""Rows of one bfloat16 product: eight sessions of six levels. For one session it costs a quarter more than 6 rows."""


class PackedLinear(nn.Module):
    """The inference twin of a linear layer; its weights can be neither trained nor read."""

    def __init__(
        self, linear: nn.Linear, dtype: torch.dtype = torch.float32, *, many: bool = False, gelu: bool = False
    ) -> None:
        """Pack a layer.

        Args:
            linear: the layer.
            dtype: of the weights, float32 or bfloat16; what goes in and comes out has one type, float32 or this.
            many: there are always many rows: one product for all of them.
            gelu: GELU follows, in the same pass.
        """
        super().__init__()
        self.dtype = dtype
        self.many = many
        self.activation = "gelu" if gelu else "none"
        self.width = linear.out_features
        self.packed: Tensor = torch.ops.mkldnn._reorder_linear_weight(linear.weight.detach().to(dtype), None)
        biased = linear.bias is not None  # pyright: ignore[reportUnnecessaryComparison]
        self.bias: Tensor | None = linear.bias.detach().to(dtype) if biased else None

    def forward(self, x: Tensor) -> Tensor:
        """(…, in) -> (…, out), no gradient."""
        if self.many:
            return self._product(x.to(self.dtype)).to(x.dtype)
        rows = x.reshape(-1, x.shape[-1]).to(self.dtype)
        if len(rows) == 0:
            return x.new_zeros(*x.shape[:-1], self.width)
        block = _BLOCK if self.dtype == torch.bfloat16 else max(2, len(rows))
        padded = F.pad(rows, (0, 0, 0, -len(rows) % block))
        products = [self._product(padded[i : i + block]) for i in range(0, len(padded), block)]
        product = products[0] if len(products) == 1 else torch.cat(products)
        return product[: len(rows)].to(x.dtype).view(*x.shape[:-1], self.width)

    def _product(self, x: Tensor) -> Tensor:
        return torch.ops.mkldnn._linear_pointwise(x, self.packed, self.bias, self.activation, [], "none")


def can_pack(module: nn.Module) -> bool:
    """Whether the module's layers can be packed: on a CPU, where torch has oneDNN."""
    return torch.backends.mkldnn.is_available() and all(p.device.type == "cpu" for p in module.parameters())


def pack_linears(module: nn.Module, dtype: torch.dtype = torch.float32, *, many: bool = False) -> None:
    """Replace every linear layer in `module` where that can be done (`can_pack`); elsewhere nothing changes."""
    if not can_pack(module):
        return
    for parent in list(module.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, nn.Linear):
                setattr(parent, name, PackedLinear(child, dtype, many=many))
