"""Facts of a clip: labels and measurements on its joints. Captions are made of these alone."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import GaitMeasures, Hand, gait, hand, lean
from marey.checks.strikes import is_lively, kicks, punches, slashes

LEFT, RIGHT = 0, 1
SIDES = ("left", "right")

# content label -> action; the side is always measured
ACTIONS: dict[str, str] = {
    "1/walk": "walk",
    "2/walk": "walk",
    "1/run": "run",
    "2/run": "run",
    "1/dash": "dash",
    "1/walk-back": "walk_back",
    "1/walk-left": "walk_diagonal",
    "1/walk-right": "walk_diagonal",
    "2/walk-turn-left": "turn",
    "2/walk-turn-right": "turn",
    "1/bow": "bow",
    "1/bye": "wave",
    "1/byebye": "wave",
    "2/wave-left-hand": "wave",
    "2/wave-right-hand": "wave",
    "2/wave-both-hands": "wave",
    "2/raise-up-left-hand": "raise",
    "2/raise-up-right-hand": "raise",
    "2/raise-up-both-hands": "raise",
    "1/respond": "raise",
    "1/guide": "guide",
    "1/call": "call",
    "1/kick": "kick",
    "1/punch": "punch",
    "1/slash": "slash",
    "1/dance-short": "dance",
}
STRIKES = {"kick": kicks, "punch": punches, "slash": slashes, "dance": is_lively}
LOCOMOTION = ("walk", "run", "dash", "walk_back", "walk_diagonal", "turn")
CYCLIC = ("walk", "run", "dash", "walk_back", "walk_diagonal")
# one style, two names in the two data sets
STYLE_NAMES = {"masculinity": "masculine", "tired": "exhausted", "old": "elderly"}


@dataclass(frozen=True)
class Facts:
    """A clip in words and numbers.

    Attributes:
        action: key of the caption grammar.
        style: key of the caption grammar; `normal` where there is none.
        side: left, right, both, or empty.
        gait, hands, lean: what was measured; lean is the deepest forward lean over the standing one, degrees.
        repeats: how often the action is done (a spliced loop of raises, for instance).
        text: captions of the source's own, of each author, where it has any.
    """

    action: str
    style: str
    side: str
    gait: GaitMeasures
    hands: tuple[Hand, Hand]
    lean: float
    repeats: int = 1
    text: tuple[tuple[str, ...], ...] = ()


def measure(joints: NDArray[np.floating], fps: float) -> tuple[GaitMeasures, tuple[Hand, Hand], float]:
    """Gait, both hands and the deepest lean of a motion (T, 22, 3)."""
    bend = lean(np.asarray(joints, np.float64), fps)
    return gait(joints, fps), (hand(joints, fps, LEFT), hand(joints, fps, RIGHT)), float(bend.max() - np.median(bend))


def describe(content: str, style: str, joints: NDArray[np.floating], fps: float) -> Facts | None:
    """Facts of a captured clip of the Bandai-Namco sets.

    Args:
        content: label of the original, such as `2/wave-left-hand`; which side it names is not believed.
        style: label of the archive.
        joints: (T, 22, 3), mirrored or not.

    Returns:
        None when label and motion contradict each other, so that no true caption can be made: a turn of the wrong size,
        a wave without a hand that moves.
    """
    action = ACTIONS[content]
    walked, hands, bend = measure(joints, fps)
    facts = Facts(action, STYLE_NAMES.get(style, style), "", walked, hands, bend)
    if action == "turn":
        single = 55 <= abs(walked.turn) <= 130 and walked.swing < abs(walked.turn) + 30
        return replace(facts, side=_signed(walked.turn)) if single else None
    if action == "walk_diagonal":
        return replace(facts, side=_signed(walked.sideways)) if abs(walked.sideways) > 0.6 else None
    if action in ("wave", "raise", "guide"):
        side = active_hands(hands, walked.duration)
        return replace(facts, side=side) if side else None
    if action == "walk_back":
        return facts if walked.along < -0.5 else None
    if action in STRIKES:
        return facts if STRIKES[action](np.asarray(joints, np.float64), fps) else None
    if action in ("walk", "run", "dash"):
        return facts if walked.along > 0.5 and abs(walked.turn) < 40 else None
    return facts


def _signed(value: float) -> str:
    return "left" if value > 0 else "right"


def active_hands(hands: tuple[Hand, Hand], duration: float) -> str:
    """The raised hand: left, right, both, or empty.

    A hand counts when it gets near the shoulder line, and either rises there by 15 cm and 0.45 of the other hand's
    rise, or is up for most of the clip (takes that begin with the hands up).
    """
    rise = [h.rise for h in hands]
    up = [
        h.peak > -0.25 and ((h.rise > 0.15 and h.rise > 0.45 * max(rise)) or h.lifted > 0.6 * duration) for h in hands
    ]
    return "both" if all(up) else "left" if up[LEFT] else "right" if up[RIGHT] else ""


FREE_TEXT = "cmu"
"""Action of a clip whose captions are its own, and not of the caption grammar."""


def describe_text(captions: tuple[tuple[str, ...], ...], joints: NDArray[np.floating], fps: float) -> Facts:
    """Return the facts of a clip whose authors captioned it."""
    walked, hands, bend = measure(joints, fps)
    return Facts(FREE_TEXT, "normal", "", walked, hands, bend, text=captions)
