"""Captions as text features, with the shipped labeller and MiniLM."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from marey.training import texts as module
from marey.training.texts import CaptionTexts
from tests.support.texts import shared_pipeline

CAPTIONS = (("a person walks forward", "Someone walks, then waves the left hand."), ("a person bows deeply",))


def test_every_caption_has_its_graph_and_each_text_is_encoded_once():
    pipeline = shared_pipeline()
    texts = CaptionTexts.build((*CAPTIONS, CAPTIONS[0]), pipeline)
    assert texts.first.tolist() == [0, 2, 3, 5]
    assert texts.node_start[2] - texts.node_start[1] == texts.node_start[5] - texts.node_start[4] > 4
    assert (texts.node_string[: texts.node_start[2]] == texts.node_string[texts.node_start[3] :]).all()
    sentence = texts.strings[texts.node_string[texts.node_start[2]]]
    assert np.array_equal(sentence, pipeline.pooled(["a person bows deeply"])[0].astype(np.float16))


def test_two_processes_read_captions_as_one_does(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(module, "CHUNK", 8)
    pipeline = shared_pipeline()
    captions = [(f"a person walks {k} steps",) for k in range(2 * module.CHUNK + 3)]
    steps: list[tuple[int, int]] = []
    alone = CaptionTexts.build(captions, pipeline)
    shared = CaptionTexts.build(captions, pipeline, processes=2, progress=lambda *done: steps.append(done))
    for field in fields(CaptionTexts):
        a, b = getattr(alone, field.name), getattr(shared, field.name)
        assert (a == b) if field.name == "spec" else np.array_equal(a, b), field.name
    assert steps == sorted(steps)
    assert steps[-1][1] == 2 * len(captions)
