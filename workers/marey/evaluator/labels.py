"""Labels of clips: clips with equal labels are correct answers to each other's captions.

A label holds what captions distinguish: the actions in order, the measured side of each, and the style by the name that
the captions use. It is not the archive's content label: that names the data set ("1/walk", "2/walk"), one action twice
("bye", "wave-right-hand"), and a side that the motion may contradict, none of which a caption says. Numbers that some
captions give (steps, metres, degrees) make no label, nor do the styles of later actions, which the clips do not carry:
there labels are coarser than the finest captions, so that no true answer counts as a wrong one. They are finer than
the captions that leave the style out, one in seven of those of one action, a third of the sequences': an answer in
another style counts as wrong there.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.data.describe import STYLE_NAMES
from marey.data.manifest import Clip

FREE_TEXT = "cmu"
"""Action of clips with free-text captions: their content distinguishes them."""


def label_of(clip: Clip) -> str:
    """`raise left, active`; `bow + turn right, normal` for a sequence."""
    if clip.acts == (FREE_TEXT,):
        return f"{clip.dataset}: {clip.content}"
    sides = clip.sides or ("",) * len(clip.acts)
    acts = [f"{act} {side}".strip() for act, side in zip(clip.acts, sides, strict=True)]
    return f"{' + '.join(acts)}, {STYLE_NAMES.get(clip.style, clip.style) or 'normal'}"


def label_ids(labels: Sequence[str]) -> NDArray[np.int64]:
    """(N,) one number a different label."""
    numbers = {label: number for number, label in enumerate(sorted(set(labels)))}
    return np.array([numbers[label] for label in labels], np.int64)
