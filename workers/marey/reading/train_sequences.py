"""Train the reader of sequences: `python -m marey.reading.train_sequences`, some ten minutes of one core.

It writes `sequence_reader.safetensors`, and prints how many of the development prompts are read right.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.data.captions import seeded
from marey.reading.networks import NetworkRecipe, Trained, as_arrays, descent, fit, side_by_side, train_and_write
from marey.reading.sequences import PartedText, parted_texts
from marey.referee.prompts import development_prompts
from marey.text.action_reader import OUTSIDE
from marey.text.clause_order import CONTEXT, without_joints
from marey.text.encoders import Encoding, find_encoder
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.order_reader import FILE as ORDER_FILE
from marey.text.order_reader import order_reader
from marey.text.parsed import without_punctuation
from marey.text.reader_file import Float32
from marey.text.reading_encoder import reading_encoder
from marey.text.sequence_reader import FILE, KERNEL, STATE_SCALE, ReadMovement, SequenceReader, clause_inputs
from marey.vocabulary.bearing_words import as_written
from marey.vocabulary.entries import load_vocabulary

CUT_UNITS, CUT_EPOCHS, CUT_BATCH, CUT_DROPOUT = 160, 8, 128, 0.35
T = TypeVar("T")
RATE, DECAY, SMOOTHING, WARMUP = 2e-3, 0.02, 0.05, 100
"""Sizes and training of the network of beginnings; the others have its rate, decay and smoothing."""
ACTIONS = NetworkRecipe(
    units=256, epochs=25, batch=1024, rate=RATE, decay=DECAY, dropout=0.4, smoothing=SMOOTHING, hidden_share=0.3
)
"""Networks of actions, which read some clauses without the states around them."""
ACTION_MEMBERS = 2
"""Number of them; their scores are averaged."""


@dataclass(frozen=True)
class LabelledTokens:
    """Token states of a text with labels of each token.

    Attributes:
        states: (T, W).
        asks: (T,) classes; -1 = no word.
        begins: (T,) 1 where a part begins.
        at_once: (T,) 1 where a part begins that comes at the same time as the one before, 0 where another does; -1
            elsewhere.
    """

    states: Float32
    asks: NDArray[np.int64]
    begins: Float32
    at_once: NDArray[np.int64]
    weight: float


class _Cuts(nn.Module):
    """The network of beginnings; while it is trained, it also says what each token asks for."""

    def __init__(self, width: int, classes: int) -> None:
        super().__init__()
        units = CUT_UNITS
        self.states = nn.Linear(width, units)
        self.first = nn.Conv1d(units, units, KERNEL, padding=KERNEL // 2)
        self.second = nn.Conv1d(units, units, KERNEL, padding=KERNEL // 2)
        self.begins = nn.Linear(units, 2)
        self.asks = nn.Linear(units, classes)
        self._some, self._most = nn.Dropout(CUT_DROPOUT / 2), nn.Dropout(CUT_DROPOUT)

    def forward(self, states: Tensor, real: Tensor) -> tuple[Tensor, Tensor]:
        """(B, T, W) states and (B, T) marks of tokens to (B, T, 2) beginnings and (B, T, C) classes."""
        rows = real[..., None]
        hidden = F.relu(self.states(self._some(states * STATE_SCALE))) * rows
        for layer in (self.first, self.second):
            hidden = hidden + F.relu(layer(self._most(hidden).transpose(1, 2)).transpose(1, 2)) * rows
        hidden = self._most(hidden)
        return self.begins(hidden), self.asks(hidden)


def labelled(text: PartedText, encoding: Encoding, classes: Sequence[str]) -> LabelledTokens:
    """Return the labels of the tokens of a text."""
    count = len(encoding.offsets)
    asks, at_once = np.full(count, -1, np.int64), np.full(count, -1, np.int64)
    begins = np.zeros(count, np.float32)
    ends = np.cumsum([len(part.text) for part in text.parts])
    begun = set[int]()
    for place, (start, end) in enumerate(encoding.offsets):
        if end <= start:
            continue
        number = int(np.searchsorted(ends, start, side="right"))
        asks[place] = classes.index(text.parts[number].asks)
        if number not in begun:
            begun.add(number)
            begins[place] = 1
            at_once[place] = int(text.parts[number].at_once) if number else -1
    return LabelledTokens(encoding.tokens, asks, begins, at_once, text.weight)


def fit_cuts(texts: Sequence[LabelledTokens], classes: int, seed: int) -> _Cuts:
    """Train the network of beginnings."""
    torch.manual_seed(seed)
    network = _Cuts(texts[0].states.shape[1], classes)
    groups = [{"params": list(network.parameters()), "lr": RATE, "weight_decay": DECAY}]
    descend = descent(groups, CUT_EPOCHS * -(-len(texts) // CUT_BATCH), WARMUP)
    rng = seeded("cuts", str(seed))
    for _ in range(CUT_EPOCHS):
        for batch in batches(texts, rng, CUT_BATCH, lambda each: len(each.states)):
            begins, named = network(*shown(batch))
            descend(cut_loss(begins, named, batch))
    return network.eval()


def batches(texts: Sequence[T], rng: random.Random, size: int, length: Callable[[T], int]) -> Iterator[list[T]]:
    """Yield all texts in random batches of nearly one length."""
    order = rng.sample(range(len(texts)), len(texts))
    reach = 20 * size
    found: list[list[int]] = []
    for low in range(0, len(order), reach):
        near = sorted(order[low : low + reach], key=lambda row: length(texts[row]))
        found += [near[start : start + size] for start in range(0, len(near), size)]
    rng.shuffle(found)
    yield from ([texts[row] for row in batch] for batch in found)


def padded(rows: Sequence[NDArray[np.generic]], value: float) -> Tensor:
    """Return rows of different lengths as one tensor."""
    return nn.utils.rnn.pad_sequence([torch.from_numpy(row) for row in rows], True, value)


def shown(batch: Sequence[LabelledTokens]) -> tuple[Tensor, Tensor]:
    """Return (B, T, W) states and (B, T) marks of tokens."""
    real = padded([np.ones(len(each.states), np.bool_) for each in batch], 0)
    return padded([each.states.astype(np.float32) for each in batch], 0), real


def cut_loss(begins: Tensor, named: Tensor, batch: Sequence[LabelledTokens], asks_weight: float = 1.0) -> Tensor:
    """Return the loss of (B, T, 2) scores of beginnings and (B, T, C) of classes."""
    asks = padded([each.asks for each in batch], -1)
    at_once = padded([each.at_once for each in batch], -1)
    words = (asks >= 0).float()
    of_begins = F.binary_cross_entropy_with_logits(
        begins[..., 0], padded([each.begins for each in batch], 0), reduction="none"
    )
    of_asks = F.cross_entropy(named.transpose(1, 2), asks, ignore_index=-1, reduction="none", label_smoothing=SMOOTHING)
    of_order = F.binary_cross_entropy_with_logits(begins[..., 1], at_once.clamp(min=0).float(), reduction="none")
    means = ((2 * of_begins + asks_weight * of_asks) * words).sum(1) / words.sum(1).clamp(min=1)
    weights = torch.tensor([each.weight for each in batch])
    return ((means + 0.3 * (of_order * (at_once >= 0)).sum(1)) * weights).sum() / weights.sum()


def clauses_of(
    texts: Sequence[PartedText], encodings: Sequence[Encoding], encoder: MiniLMEncoder, classes: Sequence[str]
) -> tuple[Float32, list[int], Float32]:
    """Return the inputs (N, I) of clauses, their classes and weights: those of each part, and of two parts together,
    which ask for several."""
    several = len(classes)
    found: list[tuple[str, Encoding, tuple[int, int], int, float]] = []
    for number, (text, encoding) in enumerate(zip(texts, encodings, strict=True)):
        edges = np.cumsum([0, *(len(part.text) for part in text.parts)]).tolist()
        for place, part in enumerate(text.parts):
            wanted = classes.index(part.asks)
            found.append((part.text, encoding, (edges[place], edges[place + 1]), wanted, text.weight))
        if len(text.parts) > 1:
            place = number % (len(text.parts) - 1)
            one, other = text.parts[place : place + 2]
            if one.asks != other.asks and CONTEXT not in (one.asks, other.asks):
                span = edges[place], edges[place + 2]
                found.append((one.text + other.text, encoding, span, several, text.weight))
    bare = [without_joints(text) for text, *_ in found]
    vectors = encoder.pooled([without_punctuation(text) for text in bare])
    rows = [
        clause_inputs(text, vector, encoding, span, classes)
        for text, vector, (_, encoding, span, _, _) in zip(bare, vectors, found, strict=True)
    ]
    return np.stack(rows), [wanted for *_, wanted, _ in found], np.array([weight for *_, weight in found], np.float32)


def _weights_of(cuts: _Cuts) -> dict[str, Float32]:
    found: dict[str, Tensor] = {}
    layers = {"states": cuts.states, "first": cuts.first, "second": cuts.second, "begins": cuts.begins}
    for name, layer in layers.items():
        assert layer.bias is not None
        found |= {name: layer.weight, f"{name}_bias": layer.bias}
    return as_arrays(found)


def train(texts: Sequence[PartedText], encoder: MiniLMEncoder, seed: int) -> Trained:
    """Return the classes and the weights of a reader."""
    classes = [*load_vocabulary().actions, OUTSIDE, CONTEXT]
    encodings = encoder.encodings([text.text for text in texts])
    pairs = zip(texts, encodings, strict=True)
    cuts = fit_cuts([labelled(text, encoding, classes) for text, encoding in pairs], len(classes), seed)
    inputs, wanted, weights = clauses_of(texts, encodings, encoder, classes)
    recipe = replace(ACTIONS, hidden_columns=encoder.width)
    members = range(ACTION_MEMBERS)
    actions = [fit(inputs, wanted, weights, len(classes) + 1, seed + member, recipe) for member in members]
    return classes, {**_weights_of(cuts), **side_by_side(actions)}


def main() -> None:
    """Train and write a reader."""
    train_and_write(
        __doc__,
        FILE,
        lambda encoder, seed: train(parted_texts(seed), encoder, seed),
        lambda path, encoder: _rates(SequenceReader.load(path), encoder),
    )


def _rates(reader: SequenceReader, encoder: MiniLMEncoder) -> str:
    """Return how many held-out sequences are read right, and how many other prompts are taken for some."""

    def read(text: str) -> tuple[ReadMovement, ...]:
        bare = as_written(text)
        return reader.read(bare, reader.written_clauses(bare, encoder.encode(text), encoder.pooled), in_time)

    by_order = reading_encoder(MiniLMEncoder(find_encoder("minilm")), ORDER_FILE)
    in_time = partial(order_reader().order, encode=by_order.encode)
    right = sum([each.action for each in read(text)] == list(actions) for text, actions in sequence_prompts())
    lines = [f"sequences: {right} of {len(sequence_prompts())} right\n"]
    others = {
        "one action": [prompt.text for prompt in development_prompts()],
        "outside": list(outside_prompts()),
    }
    for kind, prompts in others.items():
        taken = sum(bool(read(text)) for text in prompts)
        lines.append(f"{kind}: {taken} of {len(prompts)} read as a sequence\n")
    return "".join(lines)


if __name__ == "__main__":
    main()
