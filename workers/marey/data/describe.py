"""Facts of a clip: labels and measurements on its joints. Captions use nothing else."""

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
# styles with different names in the two data sets, and that of a set without styles
STYLE_NAMES = {"": "normal", "masculinity": "masculine", "tired": "exhausted", "old": "elderly"}


@dataclass(frozen=True)
class Facts:
    """A clip in words and numbers.

    Attributes:
        action: key of the caption grammar.
        style: key of the caption grammar; `normal` for no style.
        side: left, right, both, or empty.
        gait, hands, lean: measurements; lean is the deepest forward lean relative to standing, degrees.
        repeats: number of repetitions of the action, as in a spliced loop of raises.
        text: captions of the source by author, if any.
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
    """Measure gait, both hands and the deepest lean (degrees) of a motion (T, 22, 3)."""
    bend = lean(np.asarray(joints, np.float64), fps)
    return gait(joints, fps), (hand(joints, fps, LEFT), hand(joints, fps, RIGHT)), float(bend.max() - np.median(bend))


def describe(content: str, style: str, joints: NDArray[np.floating], fps: float) -> Facts | None:
    """Facts of a captured clip of the Bandai-Namco sets.

    Args:
        content: label of the original, such as `2/wave-left-hand`; its side is not trusted.
        style: label of the archive.
        joints: (T, 22, 3), mirrored or not.

    Returns:
        None if label and motion contradict each other, so that no true caption is possible: a turn by the wrong angle,
        or a wave without a moving hand.
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

    A hand counts if it gets near the shoulder line and either rises by 15 cm and 0.45 of the other hand's rise, or is
    up for most of the clip (some takes begin with raised hands).
    """
    rise = [h.rise for h in hands]
    up = [
        h.peak > -0.25 and ((h.rise > 0.15 and h.rise > 0.45 * max(rise)) or h.lifted > 0.6 * duration) for h in hands
    ]
    return "both" if all(up) else "left" if up[LEFT] else "right" if up[RIGHT] else ""


FREE_TEXT = "cmu"
"""Action of a clip that has its own captions instead of those of the grammar."""


def describe_text(captions: tuple[tuple[str, ...], ...], joints: NDArray[np.floating], fps: float) -> Facts:
    """Return the facts of a clip with human captions."""
    walked, hands, bend = measure(joints, fps)
    return Facts(FREE_TEXT, "normal", "", walked, hands, bend, text=captions)
