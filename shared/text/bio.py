"""BIO tags and the constrained Viterbi search both labellers decode with."""

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
) -> list[int]:
    """The best sequence of tags.

    Args:
        emissions: (T, K) score of each tag at each word, T >= 1.
        transitions: (K, K) from, to.
        start: (K,).
    """
    scores = emissions[0] + start
    back: list[NDArray[np.intp]] = []
    for emission in emissions[1:]:
        candidates = scores[:, None] + transitions  # (from, to)
        best = candidates.argmax(axis=0)
        back.append(best)
        scores = candidates[best, np.arange(len(best))] + emission
    path = [int(scores.argmax())]
    for best in reversed(back):
        path.append(int(best[path[-1]]))
    return path[::-1]
