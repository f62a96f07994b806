"""Phrases of the vocabulary as sentences that the encoder compares prompts with."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.text.meaning import MeaningJudge
from marey.vocabulary.scope import ActionLists, match_scope


def test_phrases_are_compared_as_sentences_without_their_marks() -> None:
    said: list[str] = []

    def pooled(texts: Sequence[str]) -> list[NDArray[np.float32]]:
        said.extend(texts)
        return [np.ones(2, np.float32) for _ in texts]

    MeaningJudge(pooled).nearest_verb(np.ones(2, np.float32))
    assert {"a person waves goodbye", "a person is lying on back", "a person heads up stairs"} <= set(said)
    assert not any(mark in text for text in said for mark in "=~")


def test_a_prompt_whose_words_do_not_decide_is_compared_as_words() -> None:
    said: list[str] = []

    def pooled(texts: Sequence[str]) -> list[NDArray[np.float32]]:
        said.extend(texts)
        return [np.ones(2, np.float32) for _ in texts]

    prompt = "leopard crawl"
    lists = ActionLists(("walk", "crawl"))
    assert match_scope(prompt, lists).left is not None
    MeaningJudge(pooled).judge(prompt, lists)
    assert prompt in said
