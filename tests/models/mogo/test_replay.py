"""Steps of a fixed number of rows, recorded or not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import structlog
import torch

from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import LiveSessionPool
from marey.models.mogo.packed_model import PackedModel
from marey.models.mogo.replay import Replayed
from marey.models.mogo.streaming import StreamBatch
from tests.support.prepared import text_features
from tests.support.processors import on_a_gpu

from .networks import columns, opened, prompts, transformer

CUDA = torch.device("cuda", 0)


def played(streams: StreamBatch, device: str | torch.device = "cpu") -> torch.Tensor:
    """Columns of sessions that join, are steered, leave, and make room for others."""
    asked = prompts(6)[:, 0].to(device)
    first = streams.start(asked[0], 1)
    shown = [streams.step()[first] for _ in range(5)]
    second, third = (
        streams.start(asked[1], 2, past=columns(7)[0].to(device)),
        streams.start(asked[2:4], 3, lasts=[6, 9]),
    )
    shown += [column for _ in range(12) for column in streams.step().values()]
    streams.steer(second, asked[4])
    streams.stop(first)
    shown += [column for _ in range(4) for column in streams.step().values()]
    streams.stop(third)
    streams.start(asked[5], 4)
    shown += [column for _ in range(20) for column in streams.step().values()]
    return torch.stack(shown).cpu()


@pytest.mark.parametrize("guidance", [1.0, 2.5])
def test_rows_that_nobody_sits_in_change_nothing_where_they_are_computed_along(guidance: float) -> None:
    model, config = transformer(), replace(TINY.inference, guidance=guidance)
    alone, along = (opened(model, 4, config) for _ in range(2))
    step = along._draw
    along._draw = lambda rows: step(4)[:rows].clone()
    assert torch.equal(played(along), played(alone))


def refusing(error: type[RuntimeError], monkeypatch: pytest.MonkeyPatch) -> StreamBatch:
    """Streams whose step cannot be recorded."""

    def refuse(_: Replayed) -> None:
        raise error("operation not permitted when stream is capturing")

    monkeypatch.setattr(Replayed, "_record", refuse)
    streams = opened(transformer(), 4)
    streams._draw = Replayed(streams._next, 4, CUDA)
    return streams


def test_a_step_that_cannot_be_recorded_is_run_as_it_is_and_the_log_says_so_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    streams = refusing(RuntimeError, monkeypatch)
    with structlog.testing.capture_logs() as logs:
        streams.prepare()
        assert torch.equal(played(streams), played(opened(transformer(), 4)))
    assert [(line["log_level"], line["error"]) for line in logs] == [
        ("error", "operation not permitted when stream is capturing")
    ]


def test_a_step_is_recorded_at_its_first_call_and_replayed_from_then_on(monkeypatch: pytest.MonkeyPatch) -> None:
    result, replays, recorded = torch.zeros(4, 2), list[int](), list[int]()

    def replay() -> None:
        replays.append(len(replays))
        result.fill_(len(replays))

    def record(_: Replayed) -> tuple[object, torch.Tensor]:
        recorded.append(1)
        return SimpleNamespace(replay=replay), result

    def step(rows: int) -> torch.Tensor:
        raise AssertionError(f"{rows} rows were computed beside the recording")

    monkeypatch.setattr(Replayed, "_record", record)
    replayed = Replayed(step, 4, CUDA)
    first, second = replayed(2), replayed(3)
    assert (first.shape, second.shape, recorded) == ((2, 2), (3, 2), [1])
    assert (first == 1).all()  # the next replay overwrites the result, not what was returned
    assert (second == 2).all()


def test_no_room_for_a_recorded_step_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(torch.OutOfMemoryError):
        refusing(torch.OutOfMemoryError, monkeypatch).prepare()


@pytest.mark.gpu
@on_a_gpu
@pytest.mark.parametrize("dtype", [torch.float32, torch.bfloat16])
def test_a_recorded_step_draws_what_the_step_itself_draws(dtype: torch.dtype) -> None:
    packed = PackedModel(transformer().to(CUDA), dtype=dtype)
    recorded, direct = StreamBatch(packed, 4), StreamBatch(packed, 4)
    assert isinstance(recorded._draw, Replayed)
    with structlog.testing.capture_logs() as refused:
        recorded.prepare()
    assert not refused
    step = direct._next
    direct._draw = lambda rows: step(4)[:rows].clone()
    assert torch.equal(played(recorded, CUDA), played(direct, CUDA))


@pytest.mark.gpu
@on_a_gpu
def test_recorded_steps_outlive_those_that_were_recorded_before_them() -> None:
    packed = PackedModel(transformer().to(CUDA))
    first, second = StreamBatch(packed, 4), StreamBatch(packed, 4)
    first.prepare()
    wanted = played(second, CUDA)
    del first
    torch.cuda.empty_cache()
    for session in list(second.sessions):
        second.stop(session)
    assert torch.equal(played(second, CUDA), wanted)


@pytest.mark.gpu
@on_a_gpu
def test_states_on_a_gpu_are_those_of_the_processor() -> None:
    model, tokens, asked = transformer(), columns(20)[0], prompts(1)[0, 0]
    here, there = StreamBatch(PackedModel(model), 1), StreamBatch(PackedModel(model.to(CUDA)), 1)
    here.start(asked, 1)
    there.start(asked.to(CUDA), 1)
    for column in tokens:
        torch.testing.assert_close(there.states().cpu(), here.states(), atol=1e-4, rtol=1e-4)
        here.accept(column[None])
        there.accept(column[None].to(CUDA))


@pytest.mark.gpu
@on_a_gpu
def test_a_room_on_a_gpu_shows_frames(tmp_path: Path) -> None:
    generator = Generator.load(random_bundle(tmp_path / "random", "tiny"), device="cuda")
    room = LiveSessionPool(generator, 3)
    names = [room.start(text_features(seed), seed) for seed in range(3)]
    frames = [room.step() for _ in range(30)]
    assert all(np.isfinite(shown[name].frame.root).all() for shown in frames for name in names)
