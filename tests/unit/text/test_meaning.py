"""Phrases of the vocabulary as sentences that the encoder compares prompts with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.text.meaning import MeaningJudge


def test_phrases_are_compared_as_sentences_without_their_marks() -> None:
    said: list[str] = []

    def pooled(texts: Sequence[str]) -> list[NDArray[np.float32]]:
        said.extend(texts)
        return [np.ones(2, np.float32) for _ in texts]

    MeaningJudge(pooled).nearest_verb(np.ones(2, np.float32))
    assert {"a person waves goodbye", "a person is lying on back", "a person heads up stairs"} <= set(said)
    assert not any(mark in text for text in said for mark in "=~")
