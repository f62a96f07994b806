"""Checks on a device that is not the processor, each in a process of its own:

python -m tests.support.card_checks NAME FOLDER
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from marey.evaluator.config import TINY as TINY_EVALUATOR
from marey.evaluator.train import train_stage as train_evaluator
from marey.generation.port import NoControl, Request
from marey.models.hgm3.bundle import random_bundle as random_hgm3
from marey.models.hgm3.config import TINY as TINY_HGM3
from marey.models.hgm3.generate import Generator as HGM3Generator
from marey.models.hgm3.train import train_stage as train_hgm3
from marey.models.mogo.bundle import random_bundle as random_mogo
from marey.models.mogo.config import TINY, DepthConfig, MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.streaming import StreamBatch
from marey.models.mogo.train import train_stage as train_mogo
from marey.training.budget import Budget
from marey.training.staging import TrainOptions
from tests.support.card import CARD, card, waits
from tests.support.prepared import text_features, write_prepared

REQUESTS = [*(Request(text_features(seed), seed, frames=24) for seed in range(3)), Request(text_features(9), 9)]


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


def mogo(folder: Path) -> None:
    """MOGO draws what it draws on the processor; a step never waits, and a frame at most for what is shown."""
    for config in (TINY, replace(TINY, depth=DepthConfig())):
        _step_never_waits(config)
    _same(Generator, random_mogo(folder / "random-mogo", "tiny").path)
    _batches_share_a_room(Generator.load(str(folder / "random-mogo"), device=CARD))
    room = LiveSessionPool(Generator.load(str(folder / "random-mogo"), device=CARD), 4)
    first, second = room.start(text_features(0), 0), room.start(text_features(1), 1)
    room.steer(first, text_features(2, actions=1))
    waits.clear()
    room.step()
    assert len(waits) <= 2, waits  # features and tokens
    room.pause(first)
    room.step()
    room.resume(first)
    room.stop(second)
    assert len(room.step()) == 1


def hgm3(folder: Path) -> None:
    """HGM³ draws what it draws on the processor."""
    _same(HGM3Generator, random_hgm3(folder / "random-hgm3").path)


def training(folder: Path) -> None:
    """Every stage of every model trains, MOGO's from what it draws itself too."""
    prepared = write_prepared(folder / "prepared")

    def train(stage: Callable[..., Any], name: str, config: Any, *, warm: bool = False) -> None:
        run = folder / type(config).__name__
        options = TrainOptions(
            prepared, run, config, Budget(steps=2), device=CARD, bf16=False, quiet=True, warm=warm
        )  # fmt: skip
        assert all(np.isfinite(value) for value in stage(name, options).values())

    for name in ("tokenizer", "masked", "residual", "length"):
        train(train_hgm3, name, TINY_HGM3)
    for name in ("tokenizer", "transformer"):
        train(train_mogo, name, TINY)
    train(train_mogo, "transformer", TINY, warm=True)
    train(train_evaluator, "tmr", TINY_EVALUATOR)


def _step_never_waits(config: MOGOConfig) -> None:
    packed = PackedModel(RQHCTransformer(config).to(CARD), dtype=torch.bfloat16)
    streams = StreamBatch(packed, 3)
    for seed in range(2):
        streams.start(torch.randn(config.condition.text_width).to(CARD), seed)
    waits.clear()
    streams.step()
    assert waits == []


class _Interrupted(NoControl):
    """Ends a batch after its first frames."""

    def progress(self, done: int, total: int) -> None:
        raise InterruptedError


def _batches_share_a_room(generator: Generator) -> None:
    first, second = (generator.generate(REQUESTS[:2]) for _ in range(2))
    assert [a.tokens.tolist() for a in first if a] == [b.tokens.tolist() for b in second if b]
    room = generator.streams(1, generator.config.inference)
    with pytest.raises(InterruptedError):
        generator.generate(REQUESTS, control=_Interrupted())
    assert generator.streams(2, generator.config.inference) is room
    assert room.sessions == []


def _same(generator: Any, bundle: Path) -> None:
    wanted = generator.load(str(bundle), device="cpu", dtype=torch.float32).generate(REQUESTS)
    found = generator.load(str(bundle), device=CARD, dtype=torch.float32).generate(REQUESTS)
    for ours, theirs in zip(found, wanted, strict=True):
        assert np.array_equal(ours.tokens, theirs.tokens)
        np.testing.assert_allclose(ours.features, theirs.features, atol=1e-4)
    lowered = generator.load(str(bundle), device=CARD, dtype=torch.bfloat16).generate(REQUESTS)
    assert [len(each.features) for each in lowered[:3]] == [24] * 3


CHECKS = {check.__name__: check for check in (devices, mogo, hgm3, training)}

if __name__ == "__main__":
    torch.set_num_threads(1)
    with card():
        CHECKS[sys.argv[1]](Path(sys.argv[2]))
