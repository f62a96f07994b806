"""Motions with a movement of `marey.generation.fine` drawn on them."""

from __future__ import annotations

import numpy as np

from marey.generation.fine import drawn_features
from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263


def drawn_on(
    joints: np.ndarray, action: str, prompt: str = "", *, count: int | None = None, side: str = "", seed: int = 1
) -> np.ndarray:
    """Return the joints of a body on which an action is drawn."""
    features = drawn_features(HUMANML3D_263.encode(joints), HUMANML3D_263, action, FineWish(count, side, prompt), seed)
    assert features is not None
    return HUMANML3D_263.decode(features).astype(np.float64)


def named_movement(prompt: str, *, seed: int = 1, frames: int | None = None, after: str = "") -> np.ndarray:
    """Return the joints of a movement of the whole body that a prompt names.

    Args:
        frames: of the motion; None, if its length is free.
        after: what the prompt says next.
    """
    wish = FineWish(prompt=prompt, fixed=frames is not None, beside=("", after))
    features = stated_features(HUMANML3D_263, "idle", wish, frames or 60, seed)
    assert features is not None
    return HUMANML3D_263.decode(features).astype(np.float64)
