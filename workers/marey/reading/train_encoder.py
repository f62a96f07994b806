"""Train the encoder of the readers: `python -m marey.reading.train_encoder`, some half an hour of one core.

It writes `reading_encoder.safetensors`: low-rank updates (Hu et al. 2021, arXiv 2106.09685) of the last layers of
MiniLM, which are trained to tell where movements begin and what each part of a prompt asks for. The heads that say so
are not kept: the readers are trained anew on what the updated encoder gives.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import save
from torch import Tensor, nn

from marey.data.captions import seeded
from marey.motion.files import write_atomically
from marey.reading.networks import as_arrays, descent
from marey.reading.sequences import PartedText, TextPart, parted_texts
from marey.reading.train_sequences import LabelledTokens, batches, cut_loss, labelled, shown
from marey.reading.updates import UpdatedLayers
from marey.text.action_reader import OUTSIDE, SEVERAL, word_marks
from marey.text.clause_order import CONTEXT, without_joints
from marey.text.encoders import Encoding, find_encoder
from marey.text.minilm import MiniLM
from marey.text.minilm_bundle import LAYERS, WIDTH, load_weights
from marey.text.reading_encoder import FILE
from marey.vocabulary.entries import load_vocabulary

UPDATED = 2
"""Layers that get updates, from the last one on."""
EPOCHS, BATCH = 7, 96
RATE, HEAD_RATE, DECAY, HEAD_DECAY, WARMUP = 1e-3, 2e-3, 0.01, 0.02, 200
INPUT_DROPOUT, HEAD_DROPOUT = 0.15, 0.4
UNITS, VECTOR_SCALE, SMOOTHING = 256, 10.0, 0.05
CUT_WEIGHT = 0.5
"""Weight of the beginnings beside what the parts ask for."""


@dataclass(frozen=True)
class _Span:
    """Tokens `first` to `last` of a text with the class of what they ask for, and the marks of its words."""

    first: int
    last: int
    asks: int
    marks: Tensor
    weight: float


@dataclass(frozen=True)
class _Text:
    """States of a text below the updated layers, with labels, and its spans."""

    tokens: LabelledTokens
    spans: list[_Span]


class _Network(nn.Module):
    """The updated layers, and heads that say where movements begin and what spans of tokens ask for."""

    def __init__(self, weights: Mapping[str, Tensor], classes: int) -> None:
        super().__init__()
        self.layers = UpdatedLayers(weights, UPDATED)
        self.drop = nn.Dropout(HEAD_DROPOUT)
        self.begins, self.asks = nn.Linear(WIDTH, 2), nn.Linear(WIDTH, classes)
        self.hidden, self.out = nn.Linear(WIDTH + classes + 2, UNITS), nn.Linear(UNITS, classes)

    def forward(self, states: Tensor, real: Tensor) -> Tensor:
        """(B, T, W) states below, and (B, T) marks of tokens, to (B, T, W) states."""
        return self.layers(states, real)

    def spans(self, means: Tensor, marks: Tensor) -> Tensor:
        """(N, W) mean states of spans and (N, M) marks of their words to (N, C) classes."""
        inputs = torch.cat([F.normalize(means, dim=-1) * VECTOR_SCALE, marks], 1)
        return self.out(self.drop(F.relu(self.hidden(F.dropout(inputs, INPUT_DROPOUT, self.training)))))


def train(texts: Sequence[PartedText], encoder: MiniLM, weights: Mapping[str, Tensor], seed: int) -> dict[str, Tensor]:
    """Return the updates of the last layers, by their names in the file."""
    torch.manual_seed(seed)
    classes = [*load_vocabulary().actions, OUTSIDE, CONTEXT, SEVERAL]
    read = [_text(each, encoder, classes) for each in texts]
    counts = Counter(span.asks for each in read for span in each.spans)
    shares = {asks: count**-0.5 for asks, count in counts.items()}
    network = _Network(weights, len(classes))
    layers, heads = list(network.layers.parameters()), [network.begins, network.asks, network.hidden, network.out]
    groups = [
        {"params": layers, "lr": RATE, "weight_decay": DECAY},
        {"params": [part for head in heads for part in head.parameters()], "lr": HEAD_RATE, "weight_decay": HEAD_DECAY},
    ]
    descend = descent(groups, EPOCHS * -(-len(read) // BATCH), WARMUP)
    rng = seeded("encoder", str(seed))
    for _ in range(EPOCHS):
        for batch in batches(read, rng, BATCH, lambda each: len(each.tokens.states)):
            descend(_loss(network, batch, shares))
    return network.layers.updates()


def _text(text: PartedText, encoder: MiniLM, classes: Sequence[str]) -> _Text:
    encoded = encoder.tokenizer.encode(text.text)
    below = encoder.states(encoded.ids)[LAYERS - UPDATED].numpy()
    encoding = Encoding(below[0], below, tuple(encoded.offsets))
    return _Text(labelled(text, encoding, classes), _spans(text, encoding.offsets, classes))


def _spans(text: PartedText, offsets: Sequence[tuple[int, int]], classes: Sequence[str]) -> list[_Span]:
    """Return the spans of a text: each part, two parts together if there are more, and the whole."""
    parts, edges = text.parts, np.cumsum([0, *(len(part.text) for part in text.parts)]).tolist()
    places = [(low, low + 1, parts[low].asks) for low in range(len(parts))] if len(parts) > 1 else []
    if len(parts) > 2:
        both = [(low, low + 2, _asks_of(pair)) for low, pair in enumerate(pairwise(parts))]
        places += [place for place in both if parts[place[0]].asks != parts[place[0] + 1].asks]
    places.append((0, len(parts), _asks_of(parts)))
    found: list[_Span] = []
    for low, high, asks in places:
        begin, end = edges[low], edges[high]
        tokens = [at for at, (first, last) in enumerate(offsets) if last > first and first < end and last > begin]
        if tokens:
            words = without_joints(text.text[begin:end])
            marks = torch.from_numpy(word_marks(words, classes))
            found.append(_Span(tokens[0], tokens[-1] + 1, classes.index(asks), marks, text.weight))
    return found


def _asks_of(parts: Sequence[TextPart]) -> str:
    """Return what parts ask for together."""
    asks = {part.asks for part in parts if part.asks != CONTEXT}
    return SEVERAL if len(asks) > 1 else next(iter(asks), CONTEXT)


def _loss(network: _Network, batch: Sequence[_Text], shares: Mapping[int, float]) -> Tensor:
    tokens = [each.tokens for each in batch]
    states = network(*shown(tokens))
    spans = [(row, span) for row, each in enumerate(batch) for span in each.spans]
    means = torch.stack([states[row, span.first : span.last].mean(0) for row, span in spans])
    asked = network.spans(means, torch.stack([span.marks for _, span in spans]))
    weights = torch.tensor([span.weight * shares[span.asks] for _, span in spans])
    wanted = torch.tensor([span.asks for _, span in spans])
    losses = F.cross_entropy(asked, wanted, reduction="none", label_smoothing=SMOOTHING)
    cuts = cut_loss(network.begins(network.drop(states)), network.asks(network.drop(states)), tokens, 0.5)
    return (losses * weights).sum() / weights.sum() + CUT_WEIGHT * cuts


def main() -> None:
    """Train and write the updates."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=FILE)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    bundle = find_encoder("minilm")
    updates = as_arrays(train(parted_texts(chosen.seed), MiniLM(bundle), load_weights(bundle), chosen.seed))
    facts = {"encoder_sha256": bundle.weights_sha256}
    write_atomically(chosen.output, save({name: part.astype(np.float16) for name, part in updates.items()}, facts))
    sys.stdout.write(f"{chosen.output}: train the readers anew now\n")


if __name__ == "__main__":
    main()
