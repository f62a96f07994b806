"""Blocks of both arms, and low ones, as their prompts ask for them."""

from __future__ import annotations

import random
import re

from marey.drawing.covers import cover
from marey.drawing.fights import block
from marey.drawing.gesture import Gesture
from marey.generation.fine_wish import FineWish

MOST = 6
"""Blocks at most."""
_TAKES = 8
"""Low blocks of which the one is taken that fits."""
_BOTH = re.compile(
    r"\b(?:both|two|with|his|her|their|the) (?:(?:his|her|their|of (?:his|her|their)|crossed|raised) )?"
    r"(?:fore)?arms\b(?! (?:down|at))|\bboth (?:his |her |their )?(?:hands|fists|gloves)\b"
    r"|\b(?:double|cross(?:ed)?|x)[- ](?:fore)?(?:arms? )?block|\bcross(?:es|ing)? (?:his|her|their) (?:fore)?arms\b"
)
_CROSSED = re.compile(r"\bcross\w*|\bx[- ]block|\ban? x\b")
_FACE = re.compile(r"\b(?:face|eyes|head guard|guards? (?:his|her|their) head)\b")
_HIGH = re.compile(r"\b(?:high|overhead|upward|head|above|downward)\b")
_MIDDLE = re.compile(r"\b(?:chest|middle|body|torso|belly|stomach|ribs)\b")


_LOW = re.compile(r"\blow(?:er)?\b|\b(?:groin|shin|knee|thigh|legs?|below (?:the|his|her) (?:belt|waist|hips?))\b")


def block_asked_for(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    """Return the block with both arms, or the low one, that a prompt asks for; None if it speaks of one arm at another
    height, or of none."""
    del seconds
    text = wish.prompt.lower()
    if _LOW.search(text) and not _HIGH.search(text):
        return _low_block(wish, rng)
    if wish.side or not _BOTH.search(text):
        return None
    high = _HIGH.search(text) is not None and not _FACE.search(text)
    if _CROSSED.search(text):
        form = "high-cross" if high else "cross"
    else:
        form = "high" if high else "middle" if _MIDDLE.search(text) and not _FACE.search(text) else "face"
    return cover(rng, form, min(wish.count or 1, MOST), stands_first=any(wish.beside))


def _low_block(wish: FineWish, rng: random.Random) -> Gesture:
    """Return a low block of the side that is named, the shortest of a few beside others."""
    found = [block(rng, times=min(wish.count or 1, MOST), low=True) for _ in range(_TAKES)]
    fits = [each for each in found if each.side == wish.side] if wish.side else found
    return min(fits or found, key=lambda each: each.seconds) if any(wish.beside) else (fits or found)[0]
