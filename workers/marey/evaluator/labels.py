"""Labels of clips: clips with equal labels are correct answers to each other's captions.

A label holds the properties that captions distinguish: the actions in order, the measured side of each, and the style
by the captions' name for it. It is not the archive's content label, which captions do not reflect: that names the data
set ("1/walk", "2/walk"), lists one action twice ("bye", "wave-right-hand"), and has a side that the motion may
contradict. Numbers in some captions (steps, metres, degrees) are not part of a label, nor are styles of later actions,
which the clips do not carry: there labels are coarser than the finest captions, so that no correct answer counts as
wrong. They are finer than captions without a style, one in seven of those of one action and a third of the sequences':
there an answer in another style counts as wrong.

Clips of published sets have captions and no actions: the label of each is its own, so that only the clip itself answers
its captions, as in the papers.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.data.describe import STYLE_NAMES
from marey.data.manifest import Clip
from marey.data.sampling import UNLABELLED

FREE_TEXT = "cmu"
"""Action of clips with free-text captions: their content distinguishes them."""


def label_of(clip: Clip) -> str:
    """Return a clip's label: `raise left, active`; `bow + turn right, normal` for a sequence; `humanml3d: 000021` where
    the actions are not known."""
    if clip.acts == (FREE_TEXT,):
        return f"{clip.dataset}: {clip.content}"
    if UNLABELLED in clip.acts:
        return f"{clip.dataset}: {clip.id}"
    sides = clip.sides or ("",) * len(clip.acts)
    acts = [f"{act} {side}".strip() for act, side in zip(clip.acts, sides, strict=True)]
    return f"{' + '.join(acts)}, {STYLE_NAMES.get(clip.style, clip.style) or 'normal'}"


def label_ids(labels: Sequence[str]) -> NDArray[np.int64]:
    """Return numbers (N,), equal for equal labels."""
    numbers = {label: number for number, label in enumerate(sorted(set(labels)))}
    return np.array([numbers[label] for label in labels], np.int64)
