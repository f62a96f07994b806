"""Linear layers packed for inference on a CPU: faster on few rows, and a row's bits do not depend on the others.

`torch.nn.functional.linear` takes other kernels, which add in another order, for fewer than some 18 rows. oneDNN's
packed product in float32 does so for a single row alone: measured with torch 2.13 on AVX-512 for 16 shapes, 2 to 192
rows give equal bits; 6 rows by 1024 x 3072 take 0.6 ms in place of 0.9. In bfloat16, which halves that, bits do depend
on the number of rows, so they go in blocks of one size.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_BLOCK = 48
"""Rows of one bfloat16 product: eight sessions of six levels. For one session it costs a quarter more than 6 rows."""


class PackedLinear(nn.Module):
    """The inference twin of a linear layer; its weights can be neither trained nor read."""

    def __init__(self, linear: nn.Linear, dtype: torch.dtype = torch.float32) -> None:
        """`dtype` of the weights, float32 or bfloat16; what goes in and comes out is float32."""
        super().__init__()
        self.dtype = dtype
        self.width = linear.out_features
        self.packed: Tensor = torch.ops.mkldnn._reorder_linear_weight(linear.weight.detach().to(dtype), None)
        biased = linear.bias is not None  # pyright: ignore[reportUnnecessaryComparison]
        self.bias: Tensor | None = linear.bias.detach().to(dtype) if biased else None

    def forward(self, x: Tensor) -> Tensor:
        """(…, in) -> (…, out), no gradient."""
        rows = x.reshape(-1, x.shape[-1]).to(self.dtype)
        if len(rows) == 0:
            return x.new_zeros(*x.shape[:-1], self.width)
        block = _BLOCK if self.dtype == torch.bfloat16 else max(2, len(rows))
        padded = F.pad(rows, (0, 0, 0, -len(rows) % block))
        products = [self._product(padded[i : i + block]) for i in range(0, len(padded), block)]
        product = products[0] if len(products) == 1 else torch.cat(products)
        return product[: len(rows)].float().view(*x.shape[:-1], self.width)

    def _product(self, x: Tensor) -> Tensor:
        return torch.ops.mkldnn._linear_pointwise(x, self.packed, self.bias, "none", [], "")


def pack_linears(module: nn.Module, dtype: torch.dtype = torch.float32) -> None:
    """Replace every linear layer in `module`, where it is on a CPU and oneDNN is there; elsewhere nothing changes."""
    if not torch.backends.mkldnn.is_available():
        return
    for parent in list(module.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, nn.Linear) and child.weight.device.type == "cpu":
                setattr(parent, name, PackedLinear(child, dtype))
