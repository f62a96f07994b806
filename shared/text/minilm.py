"""The forward pass of MiniLM (Wang et al. 2020, arXiv 2002.10957; BERT's layers), written for short sentences.

`transformers`' BertModel gives the same numbers, but takes twice as long at batch 1 (11 ms against 5.4 ms for 12
words on one core) and two seconds to import. The int8 copy takes 1.1 ms: reading the weights is most of the work.
It is the labeller's; node features come from the float32 one, since "left hand" and "right hand" lie closer together
(cosine .9) than int8 is exact (cosine .98).

Many texts go through one product of all their tokens (`last`), so that the weights are read once for all of them. On
a CPU the float32 matrices are packed, and a token's bits do not depend on the texts beside it (`shared.nn.packed`).
"""

from __future__ import annotations

import itertools
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
import torch.nn.functional as F
from safetensors import SafetensorError
from safetensors.torch import load_file  # pyright: ignore[reportUnknownVariableType]
from tokenizers import Tokenizer
from torch import nn

from shared.errors import InvalidFile
from shared.nn.packed import PackedLinear, can_pack

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    Linear = Callable[[torch.Tensor], torch.Tensor]
    Groups = Sequence[tuple[int, int]]
    """How many texts of which number of tokens follow each other."""

WIDTH = 384
LAYERS = 6
HEADS = 12
MAX_TOKENS = 256  # sentence_bert_config.json
EPS = 1e-12


class MiniLM:
    """all-MiniLM-L6-v2, frozen.

    Args:
        folder: holds `model.safetensors` and `tokenizer.json`.
        int8: dynamic int8 matrix products, weights per output channel.

    Raises:
        InvalidFile: the folder holds something else.
    """

    def __init__(self, folder: Path, *, int8: bool = False) -> None:
        self.tokenizer = load_tokenizer(folder / "tokenizer.json")
        weights = _load(folder / "model.safetensors")
        self._words = weights["embeddings.word_embeddings.weight"]
        self._positions = (
            weights["embeddings.position_embeddings.weight"] + weights["embeddings.token_type_embeddings.weight"][0]
        )
        self._norm = (weights["embeddings.LayerNorm.weight"], weights["embeddings.LayerNorm.bias"])
        self._layers = [_Layer(weights, f"encoder.layer.{i}.", int8=int8) for i in range(LAYERS)]

    @torch.inference_mode()
    def states(self, ids: list[int]) -> list[torch.Tensor]:
        """Hidden states of one sentence: 1 + 6 tensors (T, 384), embeddings first.

        Args:
            ids: token ids with [CLS] and [SEP], at most 256.
        """
        states = [self._embed(torch.tensor(ids), torch.arange(len(ids)))]
        for layer in self._layers:
            states.append(layer(states[-1], [(1, len(ids))]))
        return states

    @torch.inference_mode()
    def last(self, texts: Sequence[list[int]]) -> list[torch.Tensor]:
        """Last hidden states (T, 384) of several texts.

        Args:
            texts: token ids of each, with [CLS] and [SEP], at most 256.
        """
        order = sorted(range(len(texts)), key=lambda row: len(texts[row]))
        lengths = [len(texts[row]) for row in order]
        groups = [(len(list(same)), length) for length, same in itertools.groupby(lengths)]
        places = torch.cat([torch.arange(length) for length in lengths])
        hidden = self._embed(torch.tensor([token for row in order for token in texts[row]]), places)
        for layer in self._layers:
            hidden = layer(hidden, groups)
        parts = dict(zip(order, torch.split(hidden, lengths), strict=True))
        return [parts[row] for row in range(len(texts))]

    def _embed(self, tokens: torch.Tensor, places: torch.Tensor) -> torch.Tensor:
        return F.layer_norm(self._words[tokens] + self._positions[places], (WIDTH,), *self._norm, EPS)


class _Layer:
    """Post-norm self-attention and feed-forward of BERT, query, key and value in one product."""

    def __init__(self, weights: dict[str, torch.Tensor], prefix: str, *, int8: bool) -> None:
        def linear(*names: str) -> Linear:
            weight = torch.cat([weights[f"{prefix}{name}.weight"] for name in names])
            bias = torch.cat([weights[f"{prefix}{name}.bias"] for name in names])
            return _int8_linear(weight, bias) if int8 else _linear(weight, bias)

        def norm(name: str) -> tuple[torch.Tensor, torch.Tensor]:
            return weights[f"{prefix}{name}.LayerNorm.weight"], weights[f"{prefix}{name}.LayerNorm.bias"]

        self.project = linear("attention.self.query", "attention.self.key", "attention.self.value")
        self.attended = linear("attention.output.dense")
        self.attended_norm = norm("attention.output")
        self.inner = linear("intermediate.dense")
        self.outer = linear("output.dense")
        self.outer_norm = norm("output")

    def __call__(self, hidden: torch.Tensor, groups: Groups) -> torch.Tensor:
        """(N, 384) to the same; texts of equal length stand together."""
        sizes = [texts * tokens for texts, tokens in groups]
        projected = torch.split(self.project(hidden), sizes)
        mixed = torch.cat([_attend(part, *group) for part, group in zip(projected, groups, strict=True)])
        hidden = F.layer_norm(hidden + self.attended(mixed), (WIDTH,), *self.attended_norm, EPS)
        return F.layer_norm(hidden + self.outer(F.gelu(self.inner(hidden))), (WIDTH,), *self.outer_norm, EPS)


def _attend(projected: torch.Tensor, texts: int, tokens: int) -> torch.Tensor:
    """Self-attention of texts of equal length: (B T, 3 * 384) to (B T, 384)."""
    query, key, value = projected.view(texts, tokens, 3, HEADS, -1).permute(2, 0, 3, 1, 4)  # (B, H, T, 32)
    return F.scaled_dot_product_attention(query, key, value).transpose(1, 2).reshape(texts * tokens, WIDTH)


def _linear(weight: torch.Tensor, bias: torch.Tensor) -> Linear:
    linear = nn.Linear(weight.shape[1], weight.shape[0], device="meta").requires_grad_(False)
    linear.weight, linear.bias = nn.Parameter(weight, False), nn.Parameter(bias, False)
    return PackedLinear(linear) if can_pack(linear) else linear


def _int8_linear(weight: torch.Tensor, bias: torch.Tensor) -> Linear:
    scale = (weight.abs().amax(dim=1) / 127).clamp(min=1e-8).double()
    zero = torch.zeros(len(weight), dtype=torch.long)
    operators: Any = torch.ops.quantized
    with warnings.catch_warnings():  # "deprecated": torch is pinned, and its successor needs another package
        warnings.simplefilter("ignore", UserWarning)
        quantized: Any = torch.quantize_per_channel(weight, scale, zero, 0, torch.qint8)
        packed = operators.linear_prepack(quantized, bias)
    return lambda x: operators.linear_dynamic(x, packed, True)  # True: one bit less on x, no overflow without VNNI


def load_tokenizer(file: Path) -> Tokenizer:
    """A `tokenizer.json`, without the padding and truncation that may be saved in it.

    Raises:
        InvalidFile: it is missing or foreign.
    """
    try:
        tokenizer = Tokenizer.from_file(str(file))
    except Exception as error:  # the library raises bare Exception
        raise InvalidFile(f"is not a tokenizer: {error}", where=str(file), hint="Fetch the encoder again.") from error
    tokenizer.no_padding()
    tokenizer.no_truncation()
    return tokenizer


def _load(file: Path) -> dict[str, torch.Tensor]:
    try:
        weights = load_file(file)
    except (SafetensorError, OSError) as error:
        raise InvalidFile(f"cannot be read: {error}", where=str(file), hint="Fetch the encoder again.") from error
    last = f"encoder.layer.{LAYERS - 1}.output.dense.weight"
    if (
        last not in weights
        or weights[last].shape[0] != WIDTH
        or f"encoder.layer.{LAYERS}.output.dense.weight" in weights
    ):
        raise InvalidFile(
            f"is not MiniLM: {LAYERS} BERT layers of width {WIDTH} are expected",
            where=str(file),
            hint="The folder needs the files of sentence-transformers/all-MiniLM-L6-v2.",
        )
    return weights
