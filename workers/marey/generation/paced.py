"""Motions at the pace that their prompt names: how many times as fast they are played as the network made them.

Most actions are played slower or faster by a share, whatever their pace was. Walks and runs, of which the network
knows many, are brought to a speed over the floor, if they do not have it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.motion.courses import course_of
from marey.motion.features import FeatureLayout
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.courses import WAYS
from marey.vocabulary.paces import Pace, stated_pace

Float32 = NDArray[np.float32]

SPEEDS: Mapping[str, float] = {"slow": 0.7, "fast": 1.4}
"""How many times as fast a motion is played, by the pace that its prompt names."""
DRAWN_SPEEDS: Mapping[str, float] = {"slow": 0.52, "fast": 1.5}
"""The same of movements that are drawn at no pace of their own: they are drawn as they are usually done, so that a
slow one has to differ from the slowest of these."""
PACED_SPEEDS: Mapping[str, float] = {"slow": 0.7, "fast": 1.3}
"""The same of movements of kinds that are at the pace already."""
MOOD_SPEEDS: Mapping[str, float] = {
    "sad": 0.78,
    "tired": 0.74,
    "proud": 0.92,
    "scared": 1.08,
    "happy": 1.12,
    "angry": 1.25,
}
"""The same of movements that are drawn, by the mood of the body; the pace that a prompt names takes its place."""
LONGEST_S = 8.0
"""Seconds beyond which no drawn movement is slowed down by more than others."""
FALLING = frozenset({"jump", "jump-forward", "leap", "hop", "jump-turn", "cartwheel", "flip", "die"})
"""Actions whose pace gravity decides."""


@dataclass(frozen=True)
class WaySpeeds:
    """Speeds over the floor of a walk or run, m/s.

    Attributes:
        slow: of a slow one, at most.
        fast: of a fast one, at least.
        least, most: of one whose prompt does not say; 0 = any.
        played: bounds of how many times as fast it is played: beyond them the steps are not those of a body that falls
            from foot to foot.
    """

    slow: float
    fast: float
    least: float
    played: tuple[float, float]
    most: float = 0.0


WAY_SPEEDS: Mapping[str, WaySpeeds] = {
    "walk": WaySpeeds(0.8, 1.5, 0.0, (0.65, 1.45)),
    "walk-backward": WaySpeeds(0.6, 1.6, 0.9, (0.45, 1.5), most=1.05),
    "run": WaySpeeds(2.4, 3.8, 2.2, (0.75, 1.35)),
    "sprint": WaySpeeds(4.2, 5.0, 4.4, (0.8, 1.35)),
}
MOVING = 0.3
"""Speed of a body that goes somewhere, m/s."""


@dataclass(frozen=True)
class AskedPace:
    """The pace that a prompt asks for.

    Attributes:
        pace: empty if it does not say.
        action: id of the only action.
        mood: id of the bearing that is one; empty = none.
    """

    pace: Pace = ""
    action: str = ""
    mood: str = ""

    @classmethod
    def of(cls, prompt: str, action: str) -> AskedPace:
        """Read the pace of a prompt; none of actions that have their own."""
        has_own = action in FALLING or (action in WAYS and action not in WAY_SPEEDS)
        if has_own:
            return cls("", action)
        moods = [each.name for each in stated_bearings(prompt) if each.bearing.mood]
        return cls(stated_pace(prompt) or _pace_of_bearing(prompt, action), action, next(iter(moods), ""))

    @property
    def of_way(self) -> bool:
        """True for a walk or run, whose motion decides how fast it is played."""
        return self.action in WAY_SPEEDS

    @property
    def share(self) -> float:
        """How many times as fast the motion is played; 1 where the motion decides."""
        return 1.0 if self.of_way else SPEEDS.get(self.pace, 1.0)

    @property
    def most(self) -> float:
        """How many times as fast it is played at most."""
        return WAY_SPEEDS[self.action].played[1] if self.of_way and self.pace == "fast" else self.share

    def of_drawn(self, seconds: float, *, at_pace: bool) -> float:
        """Return how many times as fast a drawn movement is played.

        Args:
            seconds: of the movement as it is drawn.
            at_pace: it is of a kind that is at the pace already.
        """
        if self.of_way:
            return 1.0
        usual = MOOD_SPEEDS.get(self.mood, 1.0)
        speed = (PACED_SPEEDS if at_pace else DRAWN_SPEEDS).get(self.pace, usual)
        return max(speed, min(self.share if self.pace else 1.0, seconds / LONGEST_S)) if speed < 1.0 else speed

    def of_motion(self, features: Float32, layout: FeatureLayout) -> float:
        """Return how many times as fast a motion (T, D) in the layout's own units is played."""
        if not self.of_way:
            return self.share
        speeds = course_of(features, layout).speeds(layout.fps)
        speed = float(np.median(speeds[speeds > MOVING])) if (speeds > MOVING).mean() > 0.5 else 0.0
        speeds_of = WAY_SPEEDS[self.action]
        wanted = {"slow": min(speed, speeds_of.slow), "fast": max(speed, speeds_of.fast)}
        low, high = speeds_of.played
        usual = min(max(speed, speeds_of.least), speeds_of.most or np.inf)
        return min(max(wanted.get(self.pace, usual) / speed, low), high) if speed else 1.0


def _pace_of_bearing(prompt: str, action: str) -> Pace:
    """Return the pace that the bearing of a body brings with it: slow of a tired one, in a walk or run, and of one that
    pushes a car."""
    bearings = [each.bearing for each in stated_bearings(prompt)]
    paces: list[Pace] = [each.pace for each in bearings if each.pace and (action in (*WAY_SPEEDS, *each.also))]
    return paces[0] if paces else ""
