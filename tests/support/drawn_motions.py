"""Motions with a movement of `marey.generation.fine` drawn on them."""

from __future__ import annotations

import numpy as np

from marey.generation.fine import drawn_features
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263


def drawn_on(
    joints: np.ndarray, action: str, prompt: str = "", *, count: int | None = None, side: str = "", seed: int = 1
) -> np.ndarray:
    """Return the joints of a body on which an action is drawn."""
    features = drawn_features(HUMANML3D_263.encode(joints), HUMANML3D_263, action, FineWish(count, side, prompt), seed)
    assert features is not None
    return HUMANML3D_263.decode(features).astype(np.float64)
