"""Sampling weights of training clips."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.data.manifest import Clip

SEQUENCE_SHARE = {2: 0.36, 3: 0.1}
"""Share of the draws that are sequences of two and of three actions; clips of one action have the rest."""

ACT_WEIGHT = {"walk": 3.0, "walk_back": 2.5, "bow": 2.0, "turn": 1.5}
"""How much more often clips of an action are drawn. A gait is harder to learn than a raised hand (the steps
must follow each other, and the feet stand), and there are 14 bows and 14 ways backward."""


def sampling_weights(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Probability of each clip (N,), summing to 1.

    The training split has 1,064 raised hands and one kick. Clips of one action weigh count^-0.5 of their content,
    shared out within the content by count^-0.5 of the style: a content with 100 times fewer clips is drawn 10 times
    more rarely, not 100 times; some actions count more (`ACT_WEIGHT`). Sequences have a fixed share (`SEQUENCE_SHARE`)
    and are drawn evenly, since they were composed by weights.
    """
    weights = np.zeros(len(clips))
    single = [k for k, clip in enumerate(clips) if len(clip.acts) == 1]
    weights[single] = _by_content([clips[k] for k in single])
    lengths = np.array([len(clip.acts) for clip in clips])
    for length, share in SEQUENCE_SHARE.items():
        chosen = lengths == length
        weights[chosen] = share / max(int(chosen.sum()), 1)
    weights[single] *= 1 - weights[lengths > 1].sum()
    return weights / weights.sum()


def _by_content(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Weights of clips of one action, summing to 1."""
    keys = [(_content(clip), clip.style) for clip in clips]
    per_content, per_key = Counter(content for content, _ in keys), Counter(keys)
    styles: dict[str, float] = {}
    for (content, _), count in per_key.items():
        styles[content] = styles.get(content, 0.0) + count**0.5
    weights = np.array(
        [
            per_content[content] ** 0.5 * (per_key[content, style] ** 0.5 / styles[content]) / per_key[content, style]
            for content, style in keys
        ]
    ) * [ACT_WEIGHT.get(clip.acts[0], 1.0) for clip in clips]
    return weights / weights.sum() if len(weights) else weights


def _content(clip: Clip) -> str:
    """Label of a clip of one action; the kind alone of a source whose labels are free text."""
    return f"{clip.dataset}/{clip.content.split(' - ')[0]}" if clip.acts == ("cmu",) else clip.content
