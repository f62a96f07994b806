"""BIO tags and constrained decoding."""

from __future__ import annotations

import itertools

import numpy as np
import torch
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from marey.labeller.fit import crf_loss
from marey.text.bio import start_scores, transition_scores, viterbi
from marey.text.roles import Argument, spans_to_arguments

TAGS = ("O", "B-ARG0", "I-ARG0", "B-ARGM-DIR", "I-ARGM-DIR")


def is_legal(path: list[int]) -> bool:
    previous = "O"
    for index in path:
        tag = TAGS[index]
        if tag.startswith("I-") and previous[1:] != tag[1:]:
            return False
        previous = tag
    return True


@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.integers(1, 3))
def test_viterbi_finds_the_best_legal_sequence_of_each_frame(seed: int, length: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    emissions = rng.normal(size=(frames, length, len(TAGS)))
    learned = rng.normal(size=(len(TAGS), len(TAGS)))
    paths = viterbi(emissions, transition_scores(TAGS) + learned, start_scores(TAGS))
    legal = [p for p in itertools.product(range(len(TAGS)), repeat=length) if is_legal(list(p))]
    assert len(paths) == frames
    for found, scores in zip(paths, emissions, strict=True):

        def score(path: tuple[int, ...], scores: NDArray[np.float64] = scores) -> float:
            steps = sum(learned[a, b] for a, b in itertools.pairwise(path))
            return float(scores[range(length), path].sum() + steps)

        assert is_legal(found)
        assert np.isclose(score(tuple(found)), max(map(score, legal)))


def test_crf_gives_all_mass_to_legal_sequences() -> None:
    length = 3
    emissions = torch.randn(1, length, len(TAGS), dtype=torch.float64)
    transitions = torch.randn(len(TAGS), len(TAGS), dtype=torch.float64)
    allowed = torch.tensor(transition_scores(TAGS))
    mask = torch.ones(1, length, dtype=torch.bool)
    legal = [p for p in itertools.product(range(len(TAGS)), repeat=length) if is_legal(list(p))]
    mass = sum(
        float(torch.exp(-crf_loss(emissions, torch.tensor([path]), mask, transitions, allowed))) for path in legal
    )
    assert abs(mass - 1) < 1e-9


def test_crf_ignores_pads() -> None:
    emissions = torch.randn(1, 5, len(TAGS), dtype=torch.float64)
    transitions = torch.randn(len(TAGS), len(TAGS), dtype=torch.float64)
    allowed = torch.tensor(transition_scores(TAGS))
    tags = torch.tensor([[1, 2, 0, 0, 0]])
    mask = torch.tensor([[True, True, True, False, False]])
    whole = crf_loss(emissions, tags, mask, transitions, allowed)
    cut = crf_loss(emissions[:, :3], tags[:, :3], mask[:, :3], transitions, allowed)
    assert torch.allclose(whole, cut)


def test_tags_read_as_spans_without_the_verb() -> None:
    tags = ["B-ARG0", "I-ARG0", "B-V", "B-ARGM-DIR", "B-ARGM-DIR", "O", "I-ARG1"]
    assert spans_to_arguments(tags) == (
        Argument("ARG0", 0, 2),
        Argument("ARGM-DIR", 3, 4),
        Argument("ARGM-DIR", 4, 5),
        Argument("ARG1", 6, 7),
    )
