"""Train the reader of the order of time: `python -m marey.reading.train_order`, some ten minutes of one core.

It writes `order_reader.safetensors`, and prints how many texts that it has not seen are put in the order of time.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from safetensors.numpy import save
from torch import Tensor, nn

from marey.data.captions import seeded
from marey.motion.files import write_atomically
from marey.reading.networks import as_arrays, descent
from marey.reading.sequences import WRITTEN, PartedText, parted_texts
from marey.reading.train_sequences import batches, padded
from marey.reading.updates import UpdatedLayers
from marey.text.clause_order import CONTEXT
from marey.text.encoders import find_encoder
from marey.text.minilm import MiniLM
from marey.text.minilm_bundle import WIDTH, load_weights
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.order_reader import FILE, MOST_CLAUSES, STATE_SCALE, UPDATED, OrderReader, marked
from marey.text.reader_file import Float32
from marey.text.reading_encoder import reading_encoder

UNITS, DROPOUT = 128, 0.3
EPOCHS, BATCH, WARMUP = 6, 64, 100
RATE, HEAD_RATE, DECAY, HEAD_DECAY = 1e-3, 2e-3, 0.01, 0.02
EARLIER_WEIGHT = 1.5
"""Weight of a pair that is told in the other order, beside one that is not."""
KEPT = 10
"""One of that many written texts is kept from the training."""
IN_ORDER = 4000, 800
"""Texts in the order of time that are read: written ones, and made ones, of which there are as many in another."""


@dataclass(frozen=True)
class OrderedText:
    """States of a text below the updated layers, with the clauses that they are in, and which of these come first.

    Attributes:
        states: (T, W).
        clauses: (T,) number of the clause; -1 = none.
        pairs: (P, 2) numbers of clauses, in the order of the text.
        earlier: (P,) 1 where the second comes before the first.
        weight: of the text.
    """

    states: NDArray[np.float16]
    clauses: NDArray[np.int64]
    pairs: NDArray[np.int64]
    earlier: Float32
    weight: float


class OrderNetwork(nn.Module):
    """The updated layers, and the network of pairs."""

    def __init__(self, weights: Mapping[str, Tensor]) -> None:
        super().__init__()
        self.layers = UpdatedLayers(weights, len(UPDATED))
        self.pair, self.earlier = nn.Linear(2 * WIDTH, UNITS), nn.Linear(UNITS, 1)
        self._drop = nn.Dropout(DROPOUT)

    def forward(self, batch: Sequence[OrderedText]) -> Tensor:
        """Return the scores (P,) of the pairs of all texts, one text after the other."""
        real = padded([np.ones(len(each.states), np.bool_) for each in batch], 0)
        states = self.layers(padded([each.states.astype(np.float32) for each in batch], 0), real)
        numbers = padded([each.clauses for each in batch], -1)
        within = F.one_hot(numbers + 1, int(numbers.max()) + 2)[..., 1:].float()  # (B, T, clauses)
        vectors = F.normalize(within.transpose(1, 2) @ states, dim=-1) * STATE_SCALE
        found = [vectors[row][torch.from_numpy(each.pairs)].flatten(1) for row, each in enumerate(batch)]
        return self.earlier(self._drop(F.relu(self.pair(self._drop(torch.cat(found))))))[:, 0]


def ordered_texts(texts: Sequence[PartedText], encoder: MiniLM) -> Iterator[OrderedText]:
    """Yield the texts that have movements one after the other."""
    for text in texts:
        clauses, spans = marked([part.text for part in text.parts])
        encoded = encoder.tokenizer.encode(clauses)
        numbers = np.full(len(encoded.offsets), -1, np.int64)
        for place, (start, stop) in enumerate(encoded.offsets):
            within = [number for number, (low, high) in enumerate(spans) if low <= start < high and stop > start]
            numbers[place] = within[0] if within else -1
        places = text.places()
        asked = [number for number, part in enumerate(text.parts) if part.asks != CONTEXT and number in numbers]
        pairs = [(one, other) for one, other in itertools.combinations(asked, 2) if places[one] != places[other]]
        if pairs and len(asked) <= MOST_CLAUSES:
            states = encoder.states(encoded.ids)[UPDATED[0]].numpy().astype(np.float16)
            earlier = np.array([places[other] < places[one] for one, other in pairs], np.float32)
            yield OrderedText(states, numbers, np.array(pairs), earlier, text.weight / len(pairs))


def train(texts: Sequence[OrderedText], weights: Mapping[str, Tensor], seed: int) -> OrderNetwork:
    """Return a trained network."""
    torch.manual_seed(seed)
    network = OrderNetwork(weights)
    heads = [*network.pair.parameters(), *network.earlier.parameters()]
    groups = [
        {"params": list(network.layers.parameters()), "lr": RATE, "weight_decay": DECAY},
        {"params": heads, "lr": HEAD_RATE, "weight_decay": HEAD_DECAY},
    ]
    descend = descent(groups, EPOCHS * -(-len(texts) // BATCH), WARMUP)
    rng = seeded("order", str(seed))
    for _ in range(EPOCHS):
        for batch in batches(texts, rng, BATCH, lambda each: len(each.states)):
            earlier = torch.from_numpy(np.concatenate([each.earlier for each in batch]))
            shares = torch.tensor([each.weight for each in batch for _ in each.pairs])
            shares = shares * (1 + (EARLIER_WEIGHT - 1) * earlier)
            losses = F.binary_cross_entropy_with_logits(network(batch), earlier, reduction="none")
            descend((losses * shares).sum() / shares.sum())
    return network.eval()


def weights_of(network: OrderNetwork) -> dict[str, Float32]:
    """Return the tensors of a network by their names in the file."""
    found = network.layers.updates()
    for name, layer in (("pair", network.pair), ("earlier", network.earlier)):
        found |= {name: layer.weight, f"{name}_bias": layer.bias}
    return as_arrays(found)


def in_time(text: PartedText) -> bool:
    """Return True if a text is told in the order of time."""
    places = [place for place in text.places() if place]
    return places == sorted(places)


def chosen_texts(seed: int) -> tuple[list[PartedText], list[PartedText]]:
    """Return the texts to train on, and those that are kept from it, all of several movements."""
    rng = seeded("texts of order", str(seed))
    written, made = list[PartedText](), list[PartedText]()
    for text in parted_texts(seed):
        if sum(place > 0 for place in text.places()) > 1:
            (written if text.weight == WRITTEN else made).append(text)
    rng.shuffle(written)
    kept, shown = written[::KEPT], [text for number, text in enumerate(written) if number % KEPT]
    most_written, most_made = IN_ORDER
    return [*_mixed(shown, most_written, len(shown)), *_mixed(made, most_made, most_made)], kept


def _mixed(texts: Sequence[PartedText], in_order: int, others: int) -> list[PartedText]:
    ordered = [text for text in texts if in_time(text)]
    reordered = [text for text in texts if not in_time(text)]
    return [*ordered[:in_order], *reordered[:others]]


def main() -> None:
    """Train and write the reader."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=FILE)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    bundle = find_encoder("minilm")
    texts, kept = chosen_texts(chosen.seed)
    network = train(list(ordered_texts(texts, MiniLM(bundle))), load_weights(bundle), chosen.seed)
    facts = {"classes": "[]", "encoder_sha256": bundle.weights_sha256}
    tensors = {name: part.astype(np.float16) for name, part in weights_of(network).items()}
    write_atomically(chosen.output, save(tensors, facts))
    encoder = reading_encoder(MiniLMEncoder(bundle), chosen.output)
    sys.stdout.write(_rates(OrderReader.load(chosen.output), encoder, kept))


def _rates(reader: OrderReader, encoder: MiniLMEncoder, texts: Sequence[PartedText]) -> str:
    """Return how many texts are put in the order of time."""
    right: dict[bool, list[bool]] = {True: [], False: []}
    for text in texts:
        places = text.places()
        found = reader.order([part.text for part in text.parts], [place > 0 for place in places], encoder.encode)
        times = [places[number] for number in found]
        right[in_time(text)].append(times == sorted(times))
    names = {True: "told in the order of time", False: "told in another"}
    return "".join(f"{names[kind]}: {sum(each)} of {len(each)} right\n" for kind, each in right.items())


if __name__ == "__main__":
    main()
