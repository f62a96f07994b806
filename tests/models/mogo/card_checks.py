"""Checks of MOGO on a device that is not the processor: `python -m tests.models.mogo.card_checks NAME FOLDER`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from marey.generation.port import NoControl
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY, DepthConfig, MOGOConfig
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.model import RQHCTransformer
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.spec import SPEC
from marey.models.mogo.streaming import StreamBatch
from tests.support.card import CARD, waits
from tests.support.card_checks import REQUESTS, main, train
from tests.support.prepared import text_features, write_prepared


def streams(folder: Path) -> None:
    """A step never waits, and a frame at most for what is shown."""
    for config in (TINY, replace(TINY, depth=DepthConfig())):
        _step_never_waits(config)
    random_bundle(folder / "random-mogo", "tiny")
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


def rollouts(folder: Path) -> None:
    """The transformer trains from what it draws itself too."""
    assert SPEC.training is not None
    prepared, run = write_prepared(folder / "prepared"), folder / "run"
    for stage in ("tokenizer", "transformer"):
        train(SPEC.training, stage, prepared, run)
    train(SPEC.training, "transformer", prepared, run, warm=True)


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


if __name__ == "__main__":
    main({"streams": streams, "rollouts": rollouts})
