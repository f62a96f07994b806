"""Checks on a device that is not the processor, each in a process of its own:

python -m tests.support.card_checks NAME FOLDER

NAME is `devices`, `training`, or a model. What only one model has is checked in its own folder of `tests/models`.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.generation.port import Request
from marey.registry import Training, model_names, resolve, trainings
from marey.training.budget import Budget
from marey.training.staging import TrainOptions
from tests.support.card import CARD, card, waits
from tests.support.models import load, random_bundle
from tests.support.prepared import text_features, write_prepared

REQUESTS = [*(Request(text_features(seed), seed, frames=24) for seed in range(3)), Request(text_features(9), 9)]
Check = Callable[[Path], None]


def devices(folder: Path) -> None:
    """Two devices in one operator are refused, and waiting is counted."""
    here = torch.ones(2, device=CARD)
    there = torch.ones(2)
    for mixed in (lambda: here + there, lambda: there[None] @ here, lambda: torch.cat([here, there])):
        with pytest.raises(RuntimeError, match="two devices"):
            mixed()
    assert waits == []
    assert float(here.sum()) == 2
    assert here.cpu().device.type == "cpu"
    assert len(waits) == 2


def training(folder: Path) -> None:
    """Every stage of all that is trained trains."""
    prepared = write_prepared(folder / "prepared")
    for name, each in trainings().items():
        for stage in each.stages:
            if stage.name != "all":
                train(each, stage.name, prepared, folder / name)


def train(training: Training, stage: str, prepared: Path, run: Path, *, warm: bool = False) -> None:
    """Train two steps of a stage."""
    config = resolve(training.config)("tiny")
    options = TrainOptions(prepared, run, config, Budget(steps=2), device=CARD, bf16=False, quiet=True, warm=warm)
    assert all(np.isfinite(value) for value in resolve(training.train)(stage, options).values())


def draws(model: str, folder: Path) -> None:
    """The model draws what it draws on the processor."""
    bundle = random_bundle(model, folder / f"random-{model}")
    wanted = load(bundle, dtype=torch.float32).generate(REQUESTS)
    found = load(bundle, device=CARD, dtype=torch.float32).generate(REQUESTS)
    for ours, theirs in zip(found, wanted, strict=True):
        assert np.array_equal(ours.tokens, theirs.tokens)
        np.testing.assert_allclose(ours.features, theirs.features, atol=1e-4)
    lowered = load(bundle, device=CARD, dtype=torch.bfloat16).generate(REQUESTS)
    assert [len(each.features) for each in lowered[:3]] == [24] * 3


def main(checks: Mapping[str, Check]) -> None:
    """Run the check that the command line names."""
    torch.set_num_threads(1)
    with card():
        checks[sys.argv[1]](Path(sys.argv[2]))


def _drawing(model: str) -> Check:
    return lambda folder: draws(model, folder)


if __name__ == "__main__":
    main({"devices": devices, "training": training, **{model: _drawing(model) for model in model_names()}})
