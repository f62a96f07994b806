"""Networks of the readers, and the command that trains one."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.numpy import save
from torch import Tensor, nn

from marey.motion.files import write_atomically
from marey.text.encoders import find_encoder
from marey.text.minilm_encoder import MiniLMEncoder
from marey.text.reader_file import Float32
from marey.text.reading_encoder import reading_encoder

CLIPPED = 1.0
"""Norm to which gradients are clipped in `descent`."""
Trained = tuple[list[str], dict[str, Float32]]
"""Classes and weights of a reader."""


@dataclass(frozen=True)
class NetworkRecipe:
    """Sizes and training of a network of two layers.

    Attributes:
        dropout: of the hidden units; half of it of the inputs.
        hidden_share: share of rows whose last `hidden_columns` inputs are zero.
    """

    units: int
    epochs: int
    batch: int
    rate: float
    decay: float
    dropout: float
    smoothing: float
    hidden_share: float = 0.0
    hidden_columns: int = 0


def fit(
    inputs: Float32, wanted: Sequence[int], weights: Float32, count: int, seed: int, recipe: NetworkRecipe
) -> nn.Sequential:
    """Train one network on inputs (N, I) with their classes, of `count`, and their weights."""
    torch.manual_seed(seed)
    rows, classes, shares = torch.tensor(inputs), torch.tensor(wanted), torch.tensor(weights / weights.mean())
    network = nn.Sequential(
        nn.Dropout(recipe.dropout / 2),
        nn.Linear(rows.shape[1], recipe.units),
        nn.ReLU(),
        nn.Dropout(recipe.dropout),
        nn.Linear(recipe.units, count),
    )
    optimizer = torch.optim.AdamW(network.parameters(), lr=recipe.rate, weight_decay=recipe.decay)
    loss_of = nn.CrossEntropyLoss(reduction="none", label_smoothing=recipe.smoothing)
    for epoch in range(recipe.epochs):
        for group in optimizer.param_groups:
            group["lr"] = recipe.rate * (1 - epoch / recipe.epochs)
        for part in torch.randperm(len(rows)).split(recipe.batch):
            shown = rows[part]  # a copy
            if recipe.hidden_columns:
                shown[torch.rand(len(part)) < recipe.hidden_share, -recipe.hidden_columns :] = 0
            loss: Tensor = (loss_of(network(shown), classes[part]) * shares[part]).mean()
            optimizer.zero_grad()
            loss.backward()  # pyright: ignore[reportUnknownMemberType]
            optimizer.step()
    return network.eval()


def descent(groups: Sequence[dict[str, Any]], steps: int, warmup: int) -> Callable[[Tensor], None]:
    """Return a function that takes a step of AdamW down a loss, at rates that rise for `warmup` steps and fall over all
    `steps`.

    Args:
        groups: parameters with their rate and decay, as AdamW takes them.
    """
    optimizer = torch.optim.AdamW(groups)
    schedule = torch.optim.lr_scheduler.LambdaLR(
        optimizer, lambda step: min(1.0, (step + 1) / warmup) * max(0.02, 1 - step / steps)
    )
    parameters = [parameter for group in optimizer.param_groups for parameter in group["params"]]

    def descend(loss: Tensor) -> None:
        optimizer.zero_grad()
        loss.backward()  # pyright: ignore[reportUnknownMemberType]
        nn.utils.clip_grad_norm_(parameters, CLIPPED)
        optimizer.step()
        schedule.step()

    return descend


def side_by_side(networks: Sequence[nn.Sequential]) -> dict[str, Float32]:
    """Return one network whose scores are the mean of those of several."""
    first, last = ([_layer(network, place) for network in networks] for place in (1, 4))
    return as_arrays(
        {
            "hidden": torch.cat([layer.weight for layer in first]),
            "hidden_bias": torch.cat([layer.bias for layer in first]),
            "out": torch.cat([layer.weight for layer in last], dim=1) / len(networks),
            "out_bias": torch.stack([layer.bias for layer in last]).mean(dim=0),
        }
    )


def _layer(network: nn.Sequential, place: int) -> nn.Linear:
    layer = network[place]
    assert isinstance(layer, nn.Linear)
    return layer


def as_arrays(tensors: Mapping[str, Tensor]) -> dict[str, Float32]:
    """Return tensors as arrays."""
    return {name: tensor.detach().numpy().astype(np.float32) for name, tensor in tensors.items()}


def train_and_write(
    what: str | None,
    file: Path,
    train: Callable[[MiniLMEncoder, int], Trained],
    rates: Callable[[Path, MiniLMEncoder], str],
) -> None:
    """Run a command that trains a reader, writes it, and prints its rates.

    Args:
        what: description of the command.
        file: written if the caller names no other.
        train: returns a reader for an encoder and a seed.
        rates: returns the rates of a written reader.
    """
    parser = argparse.ArgumentParser(description=what)
    parser.add_argument("-o", "--output", type=Path, default=file)
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    torch.set_num_threads(1)
    encoder = reading_encoder(MiniLMEncoder(find_encoder("minilm")))
    classes, weights = train(encoder, chosen.seed)
    facts = {"classes": json.dumps(classes), "encoder_sha256": encoder.sha256}
    write_atomically(chosen.output, save({name: part.astype(np.float16) for name, part in weights.items()}, facts))
    sys.stdout.write(rates(chosen.output, encoder))
