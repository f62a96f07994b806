"""BIO tags and the constrained Viterbi search that both labellers use."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FORBIDDEN = -1e9


def transition_scores(tags: Sequence[str]) -> NDArray[np.float64]:
    """(K, K) scores from a tag to the next: `I-X` follows `B-X` or `I-X` alone, everything else is free."""
    scores = np.zeros((len(tags), len(tags)))
    for j, tag in enumerate(tags):
        if tag.startswith("I-"):
            allowed = [previous[1:] == tag[1:] and previous[0] in "BI" for previous in tags]
            scores[:, j] = np.where(allowed, 0.0, FORBIDDEN)
    return scores


def start_scores(tags: Sequence[str]) -> NDArray[np.float64]:
    """(K,) a sentence does not begin with an `I-` tag."""
    return np.array([FORBIDDEN if tag.startswith("I-") else 0.0 for tag in tags])


def viterbi(
    emissions: NDArray[np.floating], transitions: NDArray[np.floating], start: NDArray[np.floating]
) -> list[list[int]]:
    """Find the best tag sequence of each of B frames.

    Args:
        emissions: (B, T, K) score of each tag at each word, T >= 1.
        transitions: (K, K) from, to.
        start: (K,).
    """
    frames, length, tags = emissions.shape
    scores = emissions[:, 0] + start  # (B, K): the best sequence up to this word that ends in this tag
    history: list[NDArray[np.floating]] = []
    candidates = np.empty((tags, frames, tags), scores.dtype)  # (from, B, to): the maximum is quick over the first axis
    for word in range(1, length):
        history.append(scores)
        np.add(scores.T[:, :, None], transitions[:, None], out=candidates)
        scores = np.maximum.reduce(candidates) + emissions[:, word]
    best = scores.argmax(axis=1)
    path = [best]
    arriving = transitions.T
    for scores in reversed(history):  # where the tags of the path came from; not needed for the others
        best = (scores + arriving[best]).argmax(axis=1)
        path.append(best)
    return np.stack(path[::-1], axis=1).tolist()
