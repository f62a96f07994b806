"""The blob a generator reads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidFile
from marey.text.features import TextFeatures
from marey.text.graph import build_graph
from marey.text.roles import Argument, Frame


def features() -> TextFeatures:
    text = "a pérson walks 👋"
    graph = build_graph(text, [Frame(2, (Argument("ARG0", 0, 2),))], max_actions=4, max_specifics=8)
    nodes = np.random.default_rng(0).normal(size=(3, 384)).astype(np.float16)
    return TextFeatures("A pérson walks 👋", text, graph, nodes)


def test_a_blob_gives_back_what_went_in() -> None:
    made = features()
    read = TextFeatures.from_blob(made.to_blob())
    assert (read.prompt, read.rewritten, read.graph) == (made.prompt, made.rewritten, made.graph)
    assert np.array_equal(read.nodes, made.nodes)
    assert np.array_equal(read.sentence, made.nodes[0])


def test_actions_come_back_and_one_action_is_the_sentence() -> None:
    made = features()
    assert np.array_equal(made.action_vectors, made.nodes[:1])
    rows = np.random.default_rng(1).normal(size=(2, 384)).astype(np.float16)
    several = replace(made, actions=("he walks", "he bows"), action_rows=rows)
    read = TextFeatures.from_blob(several.to_blob())
    assert read.actions == ("he walks", "he bows")
    assert np.array_equal(read.action_vectors, rows)
    assert np.array_equal(read.nodes, made.nodes)
    with pytest.raises(InvalidFile, match="3 nodes and 2 actions"):
        TextFeatures.from_blob(replace(several, action_rows=rows[:1]).to_blob())


@given(st.integers(0, 2000))
def test_a_truncated_blob_is_refused(length: int) -> None:
    blob = features().to_blob()
    with pytest.raises(InvalidFile):
        TextFeatures.from_blob(blob[: min(length, len(blob) - 1)])


@given(st.binary(max_size=200))
def test_foreign_bytes_are_refused(blob: bytes) -> None:
    with pytest.raises(InvalidFile):
        TextFeatures.from_blob(blob)


def test_vectors_of_another_graph_are_refused() -> None:
    made = features()
    broken = TextFeatures(made.prompt, made.rewritten, made.graph, made.nodes[:2])
    with pytest.raises(InvalidFile, match="3 nodes"):
        TextFeatures.from_blob(broken.to_blob())


def test_movements_come_back_with_their_own_vectors() -> None:
    rows = np.random.default_rng(1).normal(size=(2, 384)).astype(np.float16)
    acted = replace(features(), prompt="he bows", actions=("he walks", "he bows"), action_rows=rows)
    made = replace(acted, movements=(acted, features()))
    read = TextFeatures.from_blob(made.to_blob())
    assert read.to_blob() == made.to_blob()
    assert [each.prompt for each in read.movements] == ["he bows", "A pérson walks 👋"]
    assert np.array_equal(read.movements[0].action_vectors, rows)
    assert np.array_equal(read.movements[1].nodes, features().nodes)
    assert (features().movements, read.movements[0].movements) == ((), ())
    with pytest.raises(InvalidFile, match="do not fit"):
        TextFeatures.from_blob(replace(made, movements=(replace(acted, nodes=acted.nodes[:1]),)).to_blob())
    with pytest.raises(InvalidFile, match="too many"):
        TextFeatures.from_blob(replace(made, action_rows=np.concatenate([rows, rows])).to_blob())
