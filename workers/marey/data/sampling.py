"""Sampling weights of training clips."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.data.manifest import Clip
from marey.data.splits import actions_of

UNLABELLED = "motion"
"""Label of clips that are published with captions and no action: all of them are drawn equally often."""
SEQUENCE_SHARE = {2: 0.36, 3: 0.1}
"""Shares of the draws for sequences of two and three actions; the rest goes to clips of one action."""


@dataclass(frozen=True)
class Draws:
    """How often training draws clips of each kind.

    Attributes:
        power: of the number of clips of a class, to which its share is proportional: 1 = clips are drawn equally often,
            0 = classes are, 0.5 = in between.
        sequences: share of sequences of several actions, of which three actions take `SEQUENCE_SHARE`'s part.
    """

    power: float = 0.5
    sequences: float = sum(SEQUENCE_SHARE.values())


ACT_WEIGHT = {
    "walk": 3.0,
    "run": 2.0,
    "walk_back": 2.5,
    "walk-backward": 2.5,
    "bow": 2.0,
    "wave": 2.0,
    "turn": 1.5,
    "turn-around": 1.5,
    "stand-up": 1.5,
    "sit-down": 1.5,
}
"""Factors by which clips of a kind or class are drawn more often. A gait is harder to learn than a raised hand (steps
must alternate, and feet must not slide), and most prompts ask for one; there are few bows and walks backward."""


def sampling_weights(clips: Sequence[Clip], draws: Draws = Draws()) -> NDArray[np.float64]:
    """Probability of each clip (N,), summing to 1.

    The training split has 1,064 raised hands and one kick. A class has the weight count^`power`, distributed within it
    by count^-0.5 of the style: with a power of 0.5 a class with 100 times fewer clips is drawn 10 times less often, not
    100 times; some actions count more (`ACT_WEIGHT`). A class is an action in all data sets; a clip
    whose label names several (`walk; turn-left`) belongs to each in equal parts. Sequences have the share `sequences`
    and are drawn evenly, since they were composed by weights. Made clips are at most half of the
    draws of a class.
    """
    weights = np.zeros(len(clips))
    single = [k for k, clip in enumerate(clips) if len(clip.acts) == 1]
    weights[single] = _by_class([clips[k] for k in single], draws.power)
    lengths = np.array([len(clip.acts) for clip in clips])
    for length, share in SEQUENCE_SHARE.items():
        chosen = lengths == length
        weights[chosen] = draws.sequences * share / sum(SEQUENCE_SHARE.values()) / max(int(chosen.sum()), 1)
    weights[single] *= 1 - weights[lengths > 1].sum()
    return weights / weights.sum()


def _by_class(clips: Sequence[Clip], power: float) -> NDArray[np.float64]:
    """Weights of clips that are not sequences, summing to 1."""
    classes = [classes_of(clip) for clip in clips]
    per_class, per_key = dict[str, float](), dict[tuple[str, str], float]()
    for clip, names in zip(clips, classes, strict=True):
        for name in names:
            key = name, clip.style
            per_class[name] = per_class.get(name, 0.0) + 1 / len(names)
            per_key[key] = per_key.get(key, 0.0) + 1 / len(names)
    styles: dict[str, float] = {}
    for (name, _), count in per_key.items():
        styles[name] = styles.get(name, 0.0) + count**0.5
    shares: dict[str, dict[int, float]] = defaultdict(dict)
    for k, (clip, names) in enumerate(zip(clips, classes, strict=True)):
        for name in names:
            shares[name][k] = per_class[name] ** power / styles[name] / per_key[name, clip.style] ** 0.5 / len(names)
    weights = np.zeros(len(clips))
    for name, of_class in shares.items():
        for k, share in _made_halved(of_class, clips).items():
            weights[k] += share * max(ACT_WEIGHT.get(clips[k].acts[0], 1.0), ACT_WEIGHT.get(name, 1.0))
    return weights / weights.sum() if len(weights) else weights


def _made_halved(shares: Mapping[int, float], clips: Sequence[Clip]) -> Mapping[int, float]:
    """Limit made clips to half of the shares of a class that also has captured clips."""
    made = sum(share for k, share in shares.items() if clips[k].made)
    captured = sum(shares.values()) - made
    if not captured or made <= captured:
        return shares
    half = (made + captured) / 2
    return {k: share * half / (made if clips[k].made else captured) for k, share in shares.items()}


def draw_captions(authors: NDArray[np.int64], draws: NDArray[np.floating]) -> NDArray[np.int64]:
    """Draw a caption of each clip, uniformly over authors, then over the captions of an author.

    Args:
        authors: (B, A) captions of each author, in their order, 0 beyond the last; each row has at least one.
        draws: (B,) random numbers in 0 … 1.

    Returns:
        (B,) index among all captions of the clip.
    """
    scaled = draws * (authors > 0).sum(axis=1)
    author = np.floor(scaled).astype(np.int64)
    rows = np.arange(len(authors))
    before = np.cumsum(authors, axis=1) - authors
    return before[rows, author] + np.floor((scaled - author) * authors[rows, author]).astype(np.int64)


def author_table(counts: Iterable[Sequence[int]]) -> NDArray[np.int64]:
    """Captions of each author (C, A) for each clip, 0 beyond a clip's last author."""
    counts = list(counts)
    table = np.zeros((len(counts), max(map(len, counts), default=1)), np.int64)
    for row, own in zip(table, counts, strict=True):
        row[: len(own)] = own
    return table


def classes_of(clip: Clip) -> tuple[str, ...]:
    """Classes of a clip of one action: the actions of its label, or only its kind if the label has free text, as in
    `dance - ballet, pirouette`."""
    return actions_of(clip.content.split(" - ")[0]) or (clip.content,)
