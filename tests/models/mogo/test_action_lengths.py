"""Frames of each action of a prompt: in natural proportion, and as in a stream beyond the training length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.generation.port import Request
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.config import TINY
from marey.models.mogo.generate import Generator
from marey.models.mogo.model import TRANSITION
from marey.models.mogo.state import NEVER
from marey.models.mogo.streaming import StreamBatch
from marey.text.features import TextFeatures
from tests.support.prepared import text_features

LONGEST = 200


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Generator:
    config = replace(TINY, longest_frames=LONGEST)
    return Generator.load(random_bundle(tmp_path_factory.mktemp("mogo") / "long", config), device="cpu")


def of_actions(count: int) -> TextFeatures:
    rows = np.stack([text_features(k).nodes[0] for k in range(count)])
    return replace(text_features(0), actions=tuple(f"action {k}" for k in range(count)), action_rows=rows)


def started_with(generator: Generator, request: Request, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Arguments that the stream of a request is started with."""
    found = dict[str, Any]()
    plain = StreamBatch.start

    def start(self: StreamBatch, *args: Any, lasts: Sequence[int], **options: Any) -> int:
        found.update(lasts=list(lasts), **options)
        return plain(self, *args, lasts=lasts, **options)

    monkeypatch.setattr(StreamBatch, "start", start)
    (made,) = generator.generate([request])
    assert made is not None
    found["frames"] = len(made.features)
    return found


@pytest.mark.parametrize("count", [1, 2, 3])
def test_actions_share_a_length_in_proportion_to_their_own(
    count: int, generator: Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    natural = generator.actions(of_actions(count))[1]
    found = started_with(generator, Request(of_actions(count), 1, TINY.max_frames), monkeypatch)
    assert found["frames"] == sum(found["lasts"]) == TINY.max_frames
    shares = np.array(natural) * TINY.max_frames / sum(natural)
    assert np.abs(np.array(found["lasts"]) - shares).max() <= 1
    assert found["ends_from"] == NEVER, "a length that was asked for"


@pytest.mark.parametrize("count", [1, 2, 3])
def test_beyond_the_training_length_the_clock_of_the_last_action_alone_stops(
    count: int, generator: Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    natural = generator.actions(of_actions(count))[1]
    found = started_with(generator, Request(of_actions(count), 1, LONGEST), monkeypatch)
    assert sum(natural) < LONGEST
    assert found["frames"] == LONGEST
    shares = np.array(natural) * LONGEST / sum(natural)
    assert len(found["lasts"]) == count
    assert np.abs(np.array(found["lasts"][:-1]) - shares[:-1]).max(initial=0) <= 1
    assert found["lasts"][-1] == natural[-1]


def test_an_open_length_has_the_natural_frames_of_its_actions_at_most(
    generator: Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    natural = generator.actions(of_actions(2))[1]
    found = started_with(generator, Request(of_actions(2), 3), monkeypatch)
    assert found["lasts"] == natural
    assert found["ends_from"] == TINY.min_frames
    assert TINY.min_frames <= found["frames"] <= sum(natural)


def test_an_action_after_another_has_the_frames_between_them_too(generator: Generator) -> None:
    alone = [generator.transformer.natural_frames(generator.actions(of_actions(3))[0][k : k + 1])[0] for k in range(3)]
    assert generator.actions(of_actions(3))[1] == [alone[0], TRANSITION + alone[1], TRANSITION + alone[2]]
