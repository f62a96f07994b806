"""The forward pass of MiniLM (Wang et al. 2020, arXiv 2002.10957; BERT's layers), written for short sentences.

`transformers`' BertModel gives the same numbers, but takes twice as long at batch 1 (11 ms against 5.4 ms for 12
words on one core) and two seconds to import. Int8 products take a third of that, compiled (`marey.nn.compiled`).
They are the labeller's; node features come from more exact products of the same weights, since "left hand" and "right
hand" lie closer together (cosine .9) than products in int8 are exact (cosine .98): in bfloat16 where that is fast
(cosine .99997, in two thirds of the time), else in float32.

Many texts go through one product of all their tokens (`last`), so that the weights are read once for all of them. On
a CPU the matrices are packed, and a token's bits do not depend on the texts beside it (`marey.nn.packed`).
"""

from __future__ import annotations

import copy
import itertools
import warnings
from typing import TYPE_CHECKING, Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.nn.compiled import CompiledLater
from marey.nn.devices import fast_bf16
from marey.nn.packed import PackedLinear, can_pack
from marey.nn.ragged import ROWS
from marey.text.minilm_bundle import LAYERS, WIDTH, load_tokenizer, load_weights

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from marey.bundles import Bundle

HEADS = 12
MAX_TOKENS = 256  # sentence_bert_config.json
EPS = 1e-12


class MiniLM:
    """all-MiniLM-L6-v2, frozen.

    Args:
        bundle: of `find_encoder("minilm")`.
        int8: dynamic int8 matrix products, weights per output channel.
        updates: added to matrices first: `<matrix>.up` (out, rank) times `<matrix>.down` (rank, in). In int8 inputs
            are divided by `<matrix>.smooth` (in,), where it is there, and the matrix multiplied: without that a
            few large features leave little of seven bits to the others (Xiao et al. 2022, arXiv 2211.10438).

    Raises:
        InvalidBundle: it is damaged, or holds something else.
    """

    def __init__(self, bundle: Bundle, *, int8: bool = False, updates: Mapping[str, Tensor] | None = None) -> None:
        self.tokenizer = load_tokenizer(bundle)
        weights = _updated(load_weights(bundle), updates or {})
        self._words = weights["embeddings.word_embeddings.weight"]
        self._positions = (
            weights["embeddings.position_embeddings.weight"] + weights["embeddings.token_type_embeddings.weight"][0]
        )
        self._norm = (weights["embeddings.LayerNorm.weight"], weights["embeddings.LayerNorm.bias"])
        layers = _Layers([_Layer(weights, f"encoder.layer.{i}.", int8=int8) for i in range(LAYERS)])
        self._layers = layers
        self._often = CompiledLater(layers) if int8 else None
        self._rows = ROWS if _dtype(self._words.device) == torch.bfloat16 else 1  # few rows have other bits in bfloat16

    def tuned(self, updates: Mapping[str, Tensor]) -> MiniLM:
        """Return this encoder with low-rank updates beside matrices of its layers, all of which are shared (Hu et al.
        2021, arXiv 2106.09685).

        Args:
            updates: `<layer>.<matrix>.down` (rank, in) and `.up` (out, rank); matrices are `project`, which is query,
                key and value, `attended`, `inner` and `outer`.
        """
        other = copy.copy(self)
        other._often = None
        layers = [layer for layer in self._layers.layers if isinstance(layer, _Layer)]
        other._layers = _Layers([layer.tuned(updates, f"{number}.") for number, layer in enumerate(layers)])
        return other

    @torch.inference_mode()
    def states(self, ids: list[int]) -> list[Tensor]:
        """Hidden states of one sentence: 1 + 6 tensors (T, 384), embeddings first.

        Args:
            ids: token ids with [CLS] and [SEP], at most 256.
        """
        layers = self._layers if self._often is None else self._often.get()
        return layers(self._embed(torch.tensor(ids), self._positions[: len(ids)]), [(1, len(ids))])

    @torch.inference_mode()
    def last(self, texts: Sequence[list[int]]) -> list[Tensor]:
        """Last hidden states (T, 384) of several texts.

        Args:
            texts: token ids of each, with [CLS] and [SEP], at most 256.
        """
        order = sorted(range(len(texts)), key=lambda row: len(texts[row]))
        lengths = [len(texts[row]) for row in order]
        groups = [(len(list(same)), length) for length, same in itertools.groupby(lengths)]
        more = -sum(lengths) % self._rows
        places = torch.cat([*(torch.arange(length) for length in lengths), torch.zeros(more, dtype=torch.long)])
        tokens = torch.tensor([*(token for row in order for token in texts[row]), *[0] * more])
        hidden = self._embed(tokens, self._positions[places])
        for layer in self._layers.layers:
            hidden = layer(hidden, groups)
        parts = dict(zip(order, torch.split(hidden[: sum(lengths)], lengths), strict=True))
        return [parts[row] for row in range(len(texts))]

    def _embed(self, tokens: Tensor, positions: Tensor) -> Tensor:
        return F.layer_norm(F.embedding(tokens, self._words) + positions, (WIDTH,), *self._norm, EPS)


class _Layers(nn.Module):
    """All layers, one after the other."""

    def __init__(self, layers: Sequence[_Layer]) -> None:
        super().__init__()
        self.layers = nn.ModuleList(layers)

    def forward(self, hidden: Tensor, groups: list[tuple[int, int]]) -> list[Tensor]:
        """Embeddings (N, 384) to those and the states after each layer; `groups` as in `_Layer`."""
        states = [hidden]
        for layer in self.layers:
            states.append(layer(states[-1], groups))
        return states


class _Layer(nn.Module):
    """Post-norm self-attention and feed-forward of BERT, query, key and value in one product.

    In int8 it is compiled, so it is limited to TorchScript: no globals, for example.
    """

    def __init__(self, weights: dict[str, Tensor], prefix: str, *, int8: bool) -> None:
        super().__init__()

        def linear(*names: str) -> nn.Module:
            weight = torch.cat([weights[f"{prefix}{name}.weight"] for name in names])
            bias = torch.cat([weights[f"{prefix}{name}.bias"] for name in names])
            smooth = weights.get(f"{prefix}{names[0]}.smooth")  # query, key and value have one input
            return _Int8Linear(weight, bias, smooth) if int8 else _linear(weight, bias)

        def norm(name: str) -> nn.LayerNorm:
            norm = nn.LayerNorm(WIDTH, EPS).requires_grad_(False)
            norm.weight.copy_(weights[f"{prefix}{name}.LayerNorm.weight"])
            norm.bias.copy_(weights[f"{prefix}{name}.LayerNorm.bias"])
            return norm

        self.heads = HEADS
        self.project = linear("attention.self.query", "attention.self.key", "attention.self.value")
        self.attended = linear("attention.output.dense")
        self.attended_norm = norm("attention.output")
        self.inner = linear("intermediate.dense")
        self.outer = linear("output.dense")
        self.outer_norm = norm("output")

    def tuned(self, updates: Mapping[str, Tensor], prefix: str) -> _Layer:
        """Return a layer with the same parts, and updates beside some of its matrices."""
        other = _Layer.__new__(_Layer)
        nn.Module.__init__(other)
        other.heads = self.heads
        for name, part in self.named_children():
            down, up = (updates.get(f"{prefix}{name}.{end}") for end in ("down", "up"))
            setattr(other, name, part if down is None or up is None else _Updated(part, down, up))
        return other

    def forward(self, hidden: Tensor, groups: list[tuple[int, int]]) -> Tensor:
        """Apply the layer to states (N, 384).

        Args:
            hidden: the tokens of all texts, ordered by the length of their text, and any rows behind them.
            groups: number of texts and number of their tokens, for each length.
        """
        projected = self.project(hidden)
        mixed: list[Tensor] = []
        start = 0
        for texts, tokens in groups:
            stop = start + texts * tokens
            mixed.append(_attend(projected[start:stop], texts, tokens, self.heads))
            start = stop
        if start < len(hidden):
            mixed.append(torch.zeros_like(hidden[start:]))
        attended = self.attended(mixed[0] if len(mixed) == 1 else torch.cat(mixed))
        hidden = self.attended_norm(hidden + attended)
        return self.outer_norm(hidden + self.outer(F.gelu(self.inner(hidden))))


class _Updated(nn.Module):
    """A matrix with a low-rank update beside it, in products of their own: the matrix is packed."""

    def __init__(self, matrix: nn.Module, down: Tensor, up: Tensor) -> None:
        super().__init__()
        self.matrix = matrix
        self.down, self.up = (_linear(weight, torch.zeros(len(weight))) for weight in (down, up))

    def forward(self, x: Tensor) -> Tensor:
        """(N, in) to (N, out)."""
        return self.matrix(x) + self.up(self.down(x))


def _attend(projected: Tensor, texts: int, tokens: int, heads: int) -> Tensor:
    """Self-attention of texts of equal length: (B T, 3 * 384) to (B T, 384)."""
    query, key, value = projected.view(texts, tokens, 3, heads, -1).permute(2, 0, 3, 1, 4).unbind()  # (B, H, T, 32)
    return F.scaled_dot_product_attention(query, key, value).transpose(1, 2).reshape(texts * tokens, -1)


def _linear(weight: Tensor, bias: Tensor) -> nn.Module:
    linear = nn.Linear(weight.shape[1], weight.shape[0], device="meta").requires_grad_(False)
    linear.weight, linear.bias = nn.Parameter(weight, False), nn.Parameter(bias, False)
    if not can_pack(linear):
        return linear
    # with AMX, products in bfloat16 of 33 to 383 rows with 1,536 inputs have other bits than those of fewer or more
    dtype = _dtype(weight.device)
    wide = dtype == torch.bfloat16 and weight.shape[1] > WIDTH
    return _InRows(PackedLinear(linear, dtype)) if wide else PackedLinear(linear, dtype)


def _dtype(device: torch.device) -> torch.dtype:
    """Return the type of the matrices of node features."""
    return torch.bfloat16 if fast_bf16(device) else torch.float32


class _InRows(nn.Module):
    """A linear layer in products of `ROWS` rows at most."""

    def __init__(self, linear: PackedLinear) -> None:
        super().__init__()
        self.linear = linear

    def forward(self, x: Tensor) -> Tensor:
        """(N, in) to (N, out)."""
        return torch.cat([self.linear(part) for part in torch.split(x, ROWS)])


class _Int8Linear(nn.Module):
    """Weights in int8 with a scale for each output; inputs in int8 with one scale for all, found in each call."""

    def __init__(self, weight: Tensor, bias: Tensor, smooth: Tensor | None) -> None:
        super().__init__()
        self.shrink = None if smooth is None else 1 / smooth
        weight = weight if smooth is None else weight * smooth
        scale = (weight.abs().amax(dim=1) / 127).clamp(min=1e-8).double()
        zero = torch.zeros(len(weight), dtype=torch.long)
        with warnings.catch_warnings():  # "deprecated": torch is pinned, and its successor needs another package
            warnings.simplefilter("ignore", UserWarning)
            quantized: Any = torch.quantize_per_channel(weight, scale, zero, 0, torch.qint8)
            self.packed: Any = torch.ops.quantized.linear_prepack(quantized, bias)

    def forward(self, x: Tensor) -> Tensor:
        """(N, in) to (N, out)."""
        if self.shrink is not None:
            x = x * self.shrink
        # True: one bit less on x, no overflow without VNNI
        return torch.ops.quantized.linear_dynamic(x, self.packed, True)


def _updated(weights: dict[str, Tensor], updates: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The weights with low-rank updates added to some of their matrices; raises KeyError where those do not fit."""
    matrices = [name.removesuffix(".up") for name in updates if name.endswith(".up")]
    changed = {
        f"{name}.weight": weights[f"{name}.weight"] + updates[f"{name}.up"] @ updates[f"{name}.down"]
        for name in matrices
    }
    smooth = {name: vector for name, vector in updates.items() if name.endswith(".smooth")}
    return weights | changed | smooth
