"""How often each clip is drawn in training."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from workers.training.data.manifest import Clip


def sampling_weights(clips: Sequence[Clip]) -> NDArray[np.float64]:
    """Probability of each clip (N,), summing to 1.

    The training split has 1,064 raised hands and one kick. A group is drawn by count^-0.5 of its clips, first by content,
    then by style within the content: a content with 100 times fewer clips is drawn 10 times more rarely, not 100 times.
    The content of a looped or spliced clip is its sequence of acts with the content of its first part, so that splices of
    frequent acts do not crowd out the rest.
    """
    contents = [_content(clip) for clip in clips]
    styles = list(zip(contents, (clip.style for clip in clips), strict=True))
    per_content, per_style = Counter(contents), Counter(styles)
    share_of_content = {name: count**0.5 for name, count in per_content.items()}
    share_of_style = {key: count**0.5 for key, count in per_style.items()}
    styles_of: Counter[str] = Counter()
    for (content, _), share in share_of_style.items():
        styles_of[content] += share  # type: ignore[assignment]
    weights = np.array(
        [
            share_of_content[content] * share_of_style[content, style] / styles_of[content] / per_style[content, style]
            for content, style in styles
        ]
    )
    return weights / weights.sum()


def _content(clip: Clip) -> str:
    return "+".join(clip.acts) if len(clip.acts) > 1 else clip.content
