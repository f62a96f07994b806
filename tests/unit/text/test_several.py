"""Features of several prompts in one blob."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from safetensors.numpy import save

from marey.core.errors import InvalidFile
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from marey.text.several import ENTRY, SeveralTexts, several_key


def features(prompt: str) -> TextFeatures:
    graph = build_graph(prompt, (), max_actions=8, max_specifics=16)
    nodes = np.random.default_rng(len(prompt)).standard_normal((len(graph.nodes), 6)).astype(np.float16)
    return TextFeatures(prompt, prompt, graph, nodes)


@given(st.lists(st.sampled_from(["walk", "a person waves", "Zoë bows"]), min_size=1, max_size=5))
def test_each_prompt_is_read_as_it_was_written(prompts: list[str]) -> None:
    several = SeveralTexts(tuple(map(features, prompts)))
    blob = several.to_blob()
    assert blob == several.to_blob()
    read = SeveralTexts.from_blob(blob)
    assert [text.to_blob() for text in read.texts] == [text.to_blob() for text in several.texts]


def test_features_of_one_prompt_are_another_kind() -> None:
    blob = features("walk").to_blob()
    with pytest.raises(InvalidFile, match="not the text features of several prompts"):
        SeveralTexts.from_blob(blob)


@given(st.binary(max_size=40))
def test_damaged_bytes_are_refused(data: bytes) -> None:
    with pytest.raises(InvalidFile):
        SeveralTexts.from_blob(save({ENTRY: np.frombuffer(data, np.uint8)}))


@pytest.mark.parametrize("cut", [1, 9, 40])
def test_a_blob_that_ends_early_is_refused(cut: int) -> None:
    whole = np.concatenate([[1], np.frombuffer((9).to_bytes(8, "little") + b"123", np.uint8)]).astype(np.uint8)
    with pytest.raises(InvalidFile):
        SeveralTexts.from_blob(save({ENTRY: whole[:cut]}))


def test_the_key_depends_on_every_prompt_and_their_order() -> None:
    keys = [several_key(each) for each in (["a", "b"], ["b", "a"], ["a"], ["a", "b", "b"], ["ab"])]
    assert len(set(keys)) == 5
    assert several_key(["a"]) != "a"
