"""Blocks of both arms, as their prompts ask for them."""

from __future__ import annotations

import random
import re

from marey.drawing.covers import cover
from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish

MOST = 6
"""Blocks at most."""
_BOTH = re.compile(
    r"\b(?:both|two|with|his|her|their|the) (?:(?:his|her|their|of (?:his|her|their)|crossed|raised) )?"
    r"(?:fore)?arms\b(?! (?:down|at))|\bboth (?:his |her |their )?(?:hands|fists|gloves)\b"
    r"|\b(?:double|cross(?:ed)?|x)[- ](?:fore)?(?:arms? )?block|\bcross(?:es|ing)? (?:his|her|their) (?:fore)?arms\b"
)
_CROSSED = re.compile(r"\bcross\w*|\bx[- ]block|\ban? x\b")
_FACE = re.compile(r"\b(?:face|eyes|head guard|guards? (?:his|her|their) head)\b")
_HIGH = re.compile(r"\b(?:high|overhead|upward|head|above|downward)\b")
_MIDDLE = re.compile(r"\b(?:chest|middle|body|torso|belly|stomach|ribs|low)\b")


def block_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the block with both arms that a prompt asks for; None if it speaks of one arm, or of none."""
    del seconds
    text = wish.prompt.lower()
    if wish.side or not _BOTH.search(text):
        return None
    high = _HIGH.search(text) is not None and not _FACE.search(text)
    if _CROSSED.search(text):
        form = "high-cross" if high else "cross"
    else:
        form = "high" if high else "middle" if _MIDDLE.search(text) and not _FACE.search(text) else "face"
    return cover(rng, form, min(wish.count or 1, MOST), stands_first=any(wish.beside))
