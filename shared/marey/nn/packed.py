"""Linear layers packed for inference on a CPU: faster on few rows, and a row's bits do not depend on other rows.

`torch.nn.functional.linear` uses other kernels, with another order of addition, for fewer than about 18 rows. oneDNN's
packed product in float32 does so for a single row alone: measured with torch 2.13 on AVX-512 for 16 shapes, 2 to 192
rows give equal bits; 6 rows by 1024 x 3072 take 0.6 ms in place of 0.9. Many rows at once (128 and more) are 5 % faster
than with torch's own product, which packs the weights anew each time, and give the very same bits.

Each call costs 50 µs, though, and in bfloat16, which halves the memory traffic, bits do depend on the number of rows
while they are few. So code that draws frame by frame uses `GroupedLinear`: products of one shape. Other devices need
none of this: there `cast_linears` halves the memory traffic.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
import torch.nn.functional as F
from torch import Tensor, nn

SMALL = 2**19
"""Number of weights of a matrix that stays in the processor's cache: torch's own product of a few rows takes 20 µs
there in place of 80, and smaller weights gain nothing."""


class PackedLinear(nn.Module):
    """Inference replacement of a linear layer; its weights can be neither trained nor read.

    In float32 a row's bits do not depend on the others; in bfloat16 they do while rows are few.
    """

    def __init__(self, linear: nn.Linear, dtype: torch.dtype = torch.float32, *, gelu: bool = False) -> None:
        """Pack a layer.

        Args:
            linear: the layer.
            dtype: of the weights, float32 or bfloat16; input and output have one type, float32 or this.
            gelu: GELU follows, in the same pass.
        """
        super().__init__()
        self.dtype = dtype
        self.activation = "gelu" if gelu else "none"
        self.packed: Tensor = torch.ops.mkldnn._reorder_linear_weight(linear.weight.detach().to(dtype), None)
        bias = _bias(linear)
        self.bias = None if bias is None else bias.to(dtype)

    def forward(self, x: Tensor) -> Tensor:
        """(…, in) -> (…, out), no gradient."""
        if x.numel() == x.shape[-1] and self.dtype == torch.float32:
            row = self._product(x.reshape(1, -1).expand(2, -1))[0]
            for _ in range(x.dim() - 1):
                row = row[None]
            return row
        return self._product(x.to(self.dtype)).to(x.dtype)

    def _product(self, x: Tensor) -> Tensor:
        return torch.ops.mkldnn._linear_pointwise(x, self.packed, self.bias, self.activation, [], "none")


class SmallLinear(nn.Module):
    """Inference replacement of a linear layer whose matrix is small: torch's own product, on its columns."""

    def __init__(self, linear: nn.Linear) -> None:
        super().__init__()
        self.columns = linear.weight.detach().float().T.contiguous()  # (in, out)
        bias = _bias(linear)
        self.bias = self.columns.new_zeros(linear.out_features) if bias is None else bias.float()

    def forward(self, x: Tensor) -> Tensor:
        """(R, in) -> (R, out), no gradient."""
        return torch.addmm(self.bias, x, self.columns)


class GroupedLinear(nn.Module):
    """Inference replacement of a linear layer for a varying number of sessions, which changes no session's bits.

    (S, R, in) are S sessions of R rows; every product has the rows of `group` sessions, padded with zeros. More
    sessions in a group share one reading of the weights; a single session pays for all of them. (R, in) is a product of
    its own.
    """

    def __init__(self, linear: nn.Linear, dtype: torch.dtype = torch.float32, *, group: int = 1) -> None:
        """Pack a layer.

        Args:
            linear: the layer.
            dtype: of the weights of large matrices (`SMALL`), float32 or bfloat16; input and output are float32.
            group: sessions of one product.
        """
        super().__init__()
        self.group = group
        small = linear.weight.numel() <= SMALL
        self.product = SmallLinear(linear) if small else PackedLinear(linear, dtype)

    def forward(self, x: Tensor) -> Tensor:
        """(S, R, in) -> (S, R, out), or (R, in) -> (R, out); no gradient."""
        if x.dim() == 2:
            return self.product(x)
        sessions, rows = x.size(0), x.size(1)
        if sessions == self.group:
            return self.product(x.flatten(0, 1)).view(sessions, rows, -1)
        missing = (self.group - sessions % self.group) % self.group
        whole = F.pad(x, (0, 0, 0, 0, 0, missing)).view(-1, self.group * rows, x.size(2))
        products = torch.stack([self.product(part) for part in whole.unbind()])
        return products.view(sessions + missing, rows, -1)[:sessions]


class CastLinear(nn.Module):
    """Inference replacement of a linear layer with weights in fewer bits than its input and output: for devices with
    fast low-precision matrix products."""

    def __init__(self, linear: nn.Linear, dtype: torch.dtype) -> None:
        """Cast a layer's weights to `dtype`."""
        super().__init__()
        self.weight = linear.weight.detach().to(dtype)
        bias = _bias(linear)
        self.bias = None if bias is None else bias.to(dtype)

    def forward(self, x: Tensor) -> Tensor:
        """(…, in) -> (…, out), no gradient."""
        return F.linear(x.to(self.weight.dtype), self.weight, self.bias).to(x.dtype)


def is_small(module: nn.Module) -> bool:
    """Return True if all matrices are small: per-session products on one thread then cost next to nothing extra."""
    return all(part.weight.numel() <= SMALL for part in module.modules() if isinstance(part, nn.Linear))


def can_pack(module: nn.Module) -> bool:
    """Return True if the module's layers can be packed: on a CPU with oneDNN."""
    return torch.backends.mkldnn.is_available() and all(p.device.type == "cpu" for p in module.parameters())


def packed_gelu(linear: nn.Module, gelu: nn.Module, dtype: torch.dtype) -> tuple[nn.Module, nn.Module]:
    """Pack a linear layer and the GELU after it into one pass where possible."""
    if isinstance(linear, nn.Linear) and can_pack(linear):
        return PackedLinear(linear, dtype, gelu=True), nn.Identity()
    return linear, gelu


def pack_linears(module: nn.Module, dtype: torch.dtype = torch.float32, *, group: int | None = None) -> None:
    """Replace every linear layer in `module` where possible (`can_pack`); elsewhere change nothing.

    Args:
        module: changed in place.
        dtype: of the weights.
        group: None = `PackedLinear`, else `GroupedLinear` of so many sessions.
    """
    if can_pack(module):
        _replace(module, lambda each: GroupedLinear(each, dtype, group=group) if group else PackedLinear(each, dtype))


def cast_linears(module: nn.Module, dtype: torch.dtype) -> None:
    """Replace every linear layer in `module` by one with weights of `dtype`, on any device."""
    _replace(module, lambda each: CastLinear(each, dtype))


def _replace(module: nn.Module, twin: Callable[[nn.Linear], nn.Module]) -> None:
    for parent in list(module.modules()):
        for name, child in list(parent.named_children()):
            if isinstance(child, nn.Linear):
                setattr(parent, name, twin(child))


def _bias(linear: nn.Linear) -> Tensor | None:
    biased = linear.bias is not None  # pyright: ignore[reportUnnecessaryComparison]
    return linear.bias.detach() if biased else None
