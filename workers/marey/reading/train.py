"""Train the reader of actions: `python -m marey.reading.train`, some minutes of one core.

It writes `action_reader.safetensors`, and prints how many of the development prompts are read right.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from safetensors.numpy import save
from torch import Tensor, nn

from marey.checks.reader_prompts import outside_prompts, sequence_prompts
from marey.motion.files import write_atomically
from marey.reading.texts import LabelledText, labelled_texts
from marey.referee.prompts import development_prompts
from marey.text.action_reader import FILE, OUTSIDE, SEVERAL, ActionReader, inputs_of
from marey.text.encoders import TextEncoder, find_encoder
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.parsed import without_punctuation
from marey.vocabulary.entries import load_vocabulary

HIDDEN, MEMBERS = 200, 3
"""Units of each of the networks whose scores are averaged; side by side they are one network."""
EPOCHS, BATCH, RATE, DECAY, DROPOUT = 45, 1024, 3e-3, 0.02, 0.4
SMOOTHING = 0.05
BALANCE = 0.5
"""Exponent of a class's number of texts by which each of them weighs less."""

Float32 = NDArray[np.float32]


def fit(inputs: Float32, classes: Sequence[int], weights: Float32, count: int, seed: int) -> nn.Sequential:
    """Train one network on inputs (N, I) with their classes, of `count`."""
    torch.manual_seed(seed)
    rows, wanted, shares = torch.tensor(inputs), torch.tensor(classes), torch.tensor(weights)
    network = nn.Sequential(
        nn.Dropout(DROPOUT / 2),
        nn.Linear(rows.shape[1], HIDDEN),
        nn.ReLU(),
        nn.Dropout(DROPOUT),
        nn.Linear(HIDDEN, count),
    )
    optimizer = torch.optim.AdamW(network.parameters(), lr=RATE, weight_decay=DECAY)
    loss_of = nn.CrossEntropyLoss(reduction="none", label_smoothing=SMOOTHING)
    for epoch in range(EPOCHS):
        for group in optimizer.param_groups:
            group["lr"] = RATE * (1 - epoch / EPOCHS)
        for part in torch.randperm(len(rows)).split(BATCH):
            loss: Tensor = (loss_of(network(rows[part]), wanted[part]) * shares[part]).mean()
            optimizer.zero_grad()
            loss.backward()  # pyright: ignore[reportUnknownMemberType]
            optimizer.step()
    return network.eval()


def side_by_side(networks: Sequence[nn.Sequential]) -> dict[str, Float32]:
    """Return one network whose scores are the mean of those of several."""
    first, last = ([layer_at(network, place) for network in networks] for place in (1, 4))
    parts = {
        "hidden": torch.cat([layer.weight for layer in first]),
        "hidden_bias": torch.cat([layer.bias for layer in first]),
        "out": torch.cat([layer.weight for layer in last], dim=1) / len(networks),
        "out_bias": torch.stack([layer.bias for layer in last]).mean(dim=0),
    }
    return {name: part.detach().numpy().astype(np.float32) for name, part in parts.items()}


def layer_at(network: nn.Sequential, place: int) -> nn.Linear:
    """Return the linear layer at a place of a network."""
    layer = network[place]
    assert isinstance(layer, nn.Linear)
    return layer


def train(texts: Sequence[LabelledText], encoder: TextEncoder, seed: int) -> tuple[list[str], dict[str, Float32]]:
    """Return the classes and the weights of a reader."""
    classes = [*load_vocabulary().actions, SEVERAL, OUTSIDE]
    vectors = encoder.pooled([without_punctuation(each.text) for each in texts])
    inputs = np.stack([inputs_of(each.text, vector, classes) for each, vector in zip(texts, vectors, strict=True)])
    counts = Counter(each.asks for each in texts)
    weights = np.array([each.weight / counts[each.asks] ** BALANCE for each in texts], np.float32)
    wanted = [classes.index(each.asks) for each in texts]
    networks = [fit(inputs, wanted, weights / weights.mean(), len(classes), seed + k) for k in range(MEMBERS)]
    return classes, side_by_side(networks)


def main() -> None:
    """Train and write a reader."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=FILE)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    encoder = MiniLMEncoder(find_encoder("minilm"))
    classes, weights = train(labelled_texts(chosen.seed), encoder, chosen.seed)
    facts = {"classes": json.dumps(classes), "encoder_sha256": encoder.sha256}
    write_atomically(chosen.output, save({name: part.astype(np.float16) for name, part in weights.items()}, facts))
    sys.stdout.write(_rates(ActionReader.load(chosen.output), encoder))


def _rates(reader: ActionReader, encoder: MiniLMEncoder) -> str:
    """Return how many held-out prompts are read right, and how many of those that are read as one action."""
    asked = {
        "one action": [(each.text, each.actions[0]) for each in development_prompts()],
        "several": [(text, SEVERAL) for text, _ in sequence_prompts()],
        "outside": [(text, OUTSIDE) for text in outside_prompts()],
    }
    lines: list[str] = []
    for kind, prompts in asked.items():
        vectors = encoder.pooled([without_punctuation(text) for text, _ in prompts])
        read = [reader.read(text, vector) for (text, _), vector in zip(prompts, vectors, strict=True)]
        right = sum(each.name == wanted for each, (_, wanted) in zip(read, prompts, strict=True))
        single = [each.action == wanted for each, (_, wanted) in zip(read, prompts, strict=True) if each.action]
        lines.append(f"{kind}: {right} of {len(prompts)} right; {len(single)} as one action, {sum(single)} right\n")
    return "".join(lines)


if __name__ == "__main__":
    main()
