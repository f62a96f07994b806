"""The live model of a worker: ready when its first session begins."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from marey.core.settings import settings as process_settings
from marey.models.mogo.bundle import random_bundle
from marey.models.mogo.generate import Generator
from marey.models.mogo.live import WARM_CALLS, LiveSessionPool, create_live_model
from marey.models.mogo.streaming import StreamBatch
from marey.text.labellers import OneAtATime
from marey.text.pipeline import TextPipeline
from tests.support.models import add_text_bundles


def test_a_pool_has_read_and_drawn_before_its_first_session_and_shows_the_same_frames(
    models: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Torch's one-time work is done by then; no rewriter was asked, which may cost money."""
    bundle = random_bundle(models / "random-tiny")
    add_text_bundles(models)
    monkeypatch.setattr(process_settings(), "device", "cpu")
    monkeypatch.setattr(process_settings(), "threads", 1)
    done: list[str] = []
    label, step = OneAtATime.label, StreamBatch.step

    def labelled(self: OneAtATime, sentences: Sequence[Sequence[str]]) -> Any:
        done.append("label")
        return label(self, sentences)

    def stepped(self: StreamBatch, only: int | None = None) -> Any:
        done.append("step")
        return step(self, only)

    monkeypatch.setattr(OneAtATime, "label", labelled)
    monkeypatch.setattr(StreamBatch, "step", stepped)
    monkeypatch.setattr(TextPipeline, "rewrite", lambda *_: pytest.fail("a rewriter was asked"))
    model = create_live_model()
    pool = model.open_pool(2)
    assert done.count("step") == WARM_CALLS
    assert done.count("label") in (WARM_CALLS, 2 * WARM_CALLS)  # a labeller that tests share may be wrapped twice
    monkeypatch.undo()
    assert model.device == "cpu"
    assert (len(pool), pool.capacity, pool.bundle) == (0, 2, bundle.reference)
    text = model.parse("a person walks forward")
    cold = LiveSessionPool(Generator.load(bundle, device="cpu", threads=1), 2)
    shown = []
    for each in (pool, cold):
        session = each.start(text, 3)
        shown.append([each.step()[session] for _ in range(4)])
    for warm, other in zip(*shown, strict=True):
        assert warm.frame.number == other.frame.number
        assert np.array_equal(warm.tokens, other.tokens)
