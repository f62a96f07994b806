"""Captions as text features, with the shipped labeller and MiniLM."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.bundles import TextSpec
from marey.core.errors import InvalidInput
from marey.text.graph import SemanticGraph, build_graph
from marey.text.pipeline import TextPipeline
from marey.text.roles import Argument, Frame
from marey.training import texts as module
from marey.training.texts import KINDS, CaptionTexts, KnownCaptions
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
    assert steps[-1] == (2 * len(captions), 2 * len(captions))


def test_captions_that_were_read_before_are_not_read_again():
    pipeline = shared_pipeline()
    before = (("a person bows deeply", "a person jumps"), ("Someone walks, then waves the left hand.",))
    asked: list[str] = []

    class Watched:
        spec = pipeline.spec

        def parse(self, prompts: Sequence[str]) -> list[SemanticGraph]:
            asked.extend(prompts)
            return pipeline.parse(prompts)

        def pooled(self, texts: Sequence[str]) -> list[np.ndarray]:
            return pipeline.pooled(texts)

    flat = [caption for clip in before for caption in clip]
    known = KnownCaptions(CaptionTexts.build(before, pipeline), {text: row for row, text in enumerate(flat)})
    reused = CaptionTexts.build(CAPTIONS, cast("TextPipeline", Watched()), known=known)
    assert asked == ["a person walks forward"]
    fresh = CaptionTexts.build(CAPTIONS, pipeline)
    vectors = [texts.strings[texts.node_string] for texts in (fresh, reused)]
    assert np.allclose(*vectors, atol=1e-3)  # compiled networks round the last bit differently
    for name in KINDS.keys() - {"strings", "node_string"}:
        field = "first" if name == "caption_start" else name
        assert np.array_equal(getattr(fresh, field), getattr(reused, field)), name


def test_captions_of_another_encoder_are_not_reused():
    pipeline = shared_pipeline()
    known = KnownCaptions(
        replace(CaptionTexts.build(CAPTIONS, pipeline), spec=TextSpec(width=1)), {"a person walks forward": 0}
    )
    with pytest.raises(InvalidInput, match="another encoder"):
        CaptionTexts.build(CAPTIONS, pipeline, known=known)


class OneGraph:
    """A pipeline that reads everything as one graph, and encodes a text as its place among the texts."""

    spec = TextSpec(width=1)

    def __init__(self, graph: SemanticGraph) -> None:
        self.graph = graph
        self.texts: list[str] = []

    def parse(self, prompts: Sequence[str]) -> list[SemanticGraph]:
        return [self.graph] * len(prompts)

    def pooled(self, texts: Sequence[str]) -> list[np.ndarray]:
        self.texts += texts
        return [np.zeros(1, np.float32)] * len(texts)


arguments = st.builds(lambda start, size: Argument("ARG1", start, start + size), st.integers(0, 6), st.integers(1, 2))
frames = st.builds(lambda verb, said: Frame(verb, tuple(said)), st.integers(0, 7), st.lists(arguments, max_size=5))


@given(st.lists(frames, max_size=7, unique_by=lambda frame: frame.predicate))
def test_slots_are_those_of_the_graph_that_is_built_with_the_smaller_caps(found: list[Frame]):
    words = " ".join("abcdefgh")
    pipeline = OneGraph(build_graph(words, found, max_actions=8, max_specifics=16))
    texts = CaptionTexts.build(((words,),), cast("TextPipeline", pipeline))
    wanted = build_graph(words, found, max_actions=2, max_specifics=3)
    strings, adjacency = texts.slots(2, 3)
    assert [pipeline.texts[k] if k >= 0 else "" for k in strings[0]] == [
        wanted.nodes[k].text if k >= 0 else "" for k in wanted.slots(2, 3)
    ]
    assert np.array_equal(adjacency[0], wanted.adjacency(2, 3))
