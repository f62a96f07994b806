"""Bodies that climb a ladder, a wall or a rope before them, hold by hold.

Feet and hands go from hold to hold by turns while the hips rise evenly; a hand or a foot that holds stays where it is.
A climb down is one up, backward in time: both are slow enough for that.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import Point
from marey.drawing.tumbling import FLOOR, OWN, WholeMotion, tumble
from marey.posing.curves import monotone
from marey.posing.limbs import FPS
from marey.posing.standing import SIGN, StandingBody, eased

Array = NDArray[np.floating]

_SHOULDERS = 0.47
"""Metres of the shoulders over the hips, with collars that are lifted a little."""
_SWINGS = {"hand": 0.55, "foot": 0.62}
"""Share of a beat in which a limb goes to its next hold; in each beat one hand and one foot do."""
_BEATS = {"quick": (0.56, 0.66), "": (0.68, 0.9), "slow": (1.0, 1.25)}
"""Seconds of a beat, in which the body gets one rung higher."""
_SHORTEST, _LONGEST = 0.4, 1.5
"""Seconds of a beat where the time or the number of rungs is given."""
_LASTS = 9.2
"""Seconds of a climb of many rungs at most."""
_FOOT_HIGH, _FOOT_BEHIND = 0.055, 0.12
"""Metres of an ankle over its rung and behind it: the ball of the foot is on it."""
_HAND_LOW, _HAND_BEHIND = 0.01, 0.05
"""Metres of a wrist below its rung and behind it."""
_HEEL = 0.05
"""Metres by which a heel is lifted before its foot leaves."""
_AWAY = {"hand": 0.07, "foot": 0.09}
"""Metres by which a limb is taken back from the rungs on its way."""
_TAKES = 0.9
"""Beats in which a hand takes its first hold."""
_SHRUG = 8.0
"""Degrees by which the collars are lifted."""


@dataclass(frozen=True)
class _Form:
    """Things that are climbed, of one kind.

    Attributes:
        hands, feet: metres of holds from the middle, at least and at most.
        uneven: metres by which holds are higher or lower than even rungs.
        splay: how far the knees point outward.
    """

    hands: tuple[float, float]
    feet: tuple[float, float]
    uneven: float = 0.0
    splay: float = 0.25


FORMS = {
    "ladder": _Form((0.15, 0.21), (0.08, 0.14)),
    "wall": _Form((0.14, 0.34), (0.12, 0.28), uneven=0.045, splay=0.5),
    "rope": _Form((0.015, 0.04), (0.05, 0.08), splay=0.6),
}
"""Things that are climbed."""


@dataclass(frozen=True)
class _Climb:
    """A climb upward from the floor.

    Attributes:
        form: a key of `FORMS`.
        rungs: that the feet get higher.
        beat: seconds in which they get one rung higher.
        lead: seconds before the first beat, in which the hands take hold.
        bent: metres of the hips over the lower foot when the other one is put on the next rung.
        spacing: metres between two rungs.
        grip: number of the rung that the lower hand takes from the floor, the floor being 0.
        plane: metres of the rungs ahead of the hips of a body that stands before them.
        gap: metres from the hips to the rungs on the way.
        late: beats by which a hand is later than the foot of its beat.
        first: side of the foot that steps first.
        crosses: the hand of the other side moves with a foot; else that of the same one.
        holds: by kind of limb and side: the holds that it takes, (n, 3): outward, up and forward.
        look: degrees by which the head is bent forward.
        sway: metres by which the hips go to the side of the foot that carries.
    """

    form: str
    rungs: int
    beat: float
    lead: float
    bent: float
    spacing: float
    grip: int
    plane: float
    gap: float
    late: float
    first: str
    crosses: bool
    look: float
    sway: float
    holds: dict[tuple[str, str], Array]

    @property
    def seconds(self) -> float:
        """Its length until the feet stand side by side."""
        return self.lead + (self.rungs + 1) * self.beat

    def change(self, body: StandingBody, seconds: Array) -> None:
        """Bring a body that stands (T frames) to where it is after `seconds` (T,) of the climb."""
        beats = (seconds - self.lead) / self.beat
        on = eased((beats + 0.2) / 1.2)
        rest = body.joints[:, 0].mean(0)
        idle = body.joints[:, 0] - rest
        body.shrug(_SHRUG * on)
        aside = SIGN[self.first] * -np.cos(np.pi * beats) * eased(beats) * eased(self.rungs + 1 - beats)
        ahead = self.plane - self.gap
        place = np.stack([self.sway * aside, self._heights(beats, rest[1]) / rest[1], ahead * on], -1)
        place += 0.5 * idle
        zero = np.zeros_like(beats)
        reaching = aside * (1.0 if self.crosses else -1.0)
        tilt = np.stack([3.0 * on, zero, -2.0 * aside], -1)
        spine = np.stack([2.0 * on, 2.5 * reaching, 4.0 * reaching], -1)
        neck = np.stack([self.look * on, zero, -3.0 * reaching], -1)
        hands = {side: self._limb("hand", side, beats) for side in SIDES}
        feet = {side: self._limb("foot", side, beats) for side in SIDES}
        tumble(body, WholeMotion(place, tilt, spine, neck, hands, feet, zero, 0.12 + FORMS[self.form].splay * on))

    def _heights(self, beats: Array, stood: float) -> Array:
        """Metres of the hips (T,), which are at `stood` on the floor."""
        times, heights = [-1.0, 0.3, 1.0], [stood, stood, stood - 0.02]
        for rung in range(1, self.rungs):
            times.append(rung + 1.0)
            heights.append(rung * self.spacing + self.bent)
        times.append(self.rungs + 1.0)
        heights.append(self.rungs * self.spacing + self.bent + 0.05)
        return monotone(times, np.array(heights)[:, None], beats)[:, 0]

    def _limb(self, kind: str, side: str, beats: Array) -> dict[str, tuple[Array, Array, Array]]:
        """Shares, places and directions of a limb, as in `WholeMotion`; it is the idle's own until its first hold."""
        holds, lands = self.holds[kind, side], _lands(self, kind, side)
        foot = kind == "foot"
        swing = _SWINGS[kind]
        share = eased((beats - lands[0]) / (swing if foot else _TAKES) + 1.0)[:, None]
        withins = [(beats - land) / swing + 1.0 for land in lands]
        place = np.tile(holds[0], (len(beats), 1))
        for within, before, after in zip(withins[1:], holds, holds[1:], strict=False):
            place += eased(within)[:, None] * (after - before)
        away = sum((_bump(within) for within in withins[0 if foot else 1 :]), np.zeros_like(beats))
        place[:, 2] -= _AWAY[kind] * away
        own = np.zeros_like(place)
        towards = np.tile((0.12, 0.05, 1.0) if foot else (0.75, -1.0, -0.35), (len(beats), 1))
        if foot:
            own[:, 1] = 0.06 * away
            heel = sum((_bump((within + 0.4) / 0.8) for within in withins[1:]), np.zeros_like(beats))
            place[:, 1] += _HEEL * heel
            towards[:, 1] -= 0.4 * heel
        return {FLOOR: (share, place, towards), OWN: (1.0 - share, own, towards)}


def _bump(within: Array) -> Array:
    """Return 0 before 0 and after 1, and nearly 1 for most of the way between."""
    inside = np.clip(within, 0.0, 1.0)
    return eased(inside / 0.35) * eased((1.0 - inside) / 0.35)


def _lands(climb: _Climb, kind: str, side: str) -> Array:
    """Beats at which a limb takes its holds."""
    begins = side == climb.first
    if kind == "foot":
        return np.arange(1.0 if begins else 2.0, climb.rungs + 1.01, 2.0)
    odd = begins != climb.crosses
    lands = np.arange(3.0 if odd else 2.0, climb.rungs + 1.51, 2.0) + climb.late
    return np.concatenate([[0.0 if odd else 0.3], lands])


def _holds(rng: random.Random, climb: _Climb) -> dict[tuple[str, str], Array]:
    """Draw the holds of all limbs."""
    form = FORMS[climb.form]
    found = dict[tuple[str, str], Array]()
    even = {"hand": rng.uniform(*form.hands), "foot": rng.uniform(*form.feet)}
    for kind, behind, over in (("hand", _HAND_BEHIND, -_HAND_LOW), ("foot", _FOOT_BEHIND, _FOOT_HIGH)):
        for side in SIDES:
            holds = list[Point]()
            for land in np.round(_lands(climb, kind, side) - 0.05):
                rung = min(land, climb.rungs) if kind == "foot" else _grip(climb, side, land)
                limits = form.hands if kind == "hand" else form.feet
                out = rng.uniform(*limits) if form.uneven else even[kind]
                uneven = rng.uniform(-form.uneven, form.uneven)
                holds.append((out, rung * climb.spacing + over + uneven, climb.plane - behind))
            found[kind, side] = np.array(holds)
    return found


def _grip(climb: _Climb, side: str, land: float) -> float:
    """Return the number of the rung that a hand takes in a beat; in beat 0 it takes its first."""
    odd = (side == climb.first) != climb.crosses
    return climb.grip + (land or (1.0 if odd else 0.0))


@dataclass(frozen=True)
class Ascent:
    """Wishes for a climb; what is left out is drawn at random.

    Attributes:
        form: what is climbed, a key of `FORMS`.
        down: downward; it begins high up.
        rungs: that it gets higher or lower.
        tempo: quick, slow or empty.
    """

    form: str = "ladder"
    down: bool = False
    rungs: int | None = None
    tempo: str | None = None


def climb_ladder(rng: random.Random, ascent: Ascent, seconds: float | None = None) -> Gesture:
    """A body that climbs up from the floor, and stays there, or down to it.

    Args:
        rng: decides everything that is not given.
        ascent: what it is like.
        seconds: for about how long.
    """
    wait, tail, down = rng.uniform(0.2, 0.5), rng.uniform(0.3, 0.7), ascent.down
    rest = tail + (wait if down else 0.0)
    climb = _drawn(rng, ascent, None if seconds is None else seconds - rest)

    def change(body: StandingBody) -> None:
        t = np.arange(len(body.joints)) / FPS
        climb.change(body, climb.seconds + wait - t if down else t)

    kinds = ("climb-ladder", f"climb-{ascent.form}", "climb-down" if down else "climb-up")
    return Gesture(climb.seconds + rest, kinds, change)


def _drawn(rng: random.Random, ascent: Ascent, seconds: float | None) -> _Climb:
    """Draw a climb upward of about so many seconds."""
    tempo = rng.choice(["", "", "", "quick", "slow"]) if ascent.tempo is None else ascent.tempo
    beat, lead, rungs = rng.uniform(*_BEATS[tempo]), rng.uniform(0.75, 1.0), ascent.rungs
    lasts = (_LASTS if rungs else rng.uniform(4.5, 6.5)) - lead if seconds is None else seconds - lead
    if rungs is None:
        rungs = max(2, round(lasts / beat) - 1)
    if seconds is not None or (rungs + 1) * beat > lasts:
        beat = min(max(lasts / (rungs + 1), _SHORTEST), _LONGEST)
    grip, bent, late = rng.choice([5, 5, 5, 4]), rng.uniform(0.78, 0.84), rng.uniform(-0.2, 0.1)
    gap = rng.uniform(0.33, 0.38)
    climb = _Climb(
        form=ascent.form,
        rungs=rungs,
        beat=beat,
        lead=lead,
        bent=bent,
        spacing=(rng.uniform(0.37, 0.42) + _SHOULDERS + bent) / (grip + 1 - late),
        grip=grip,
        plane=gap + rng.uniform(0.02, 0.07),
        gap=gap,
        late=late,
        first=rng.choice(SIDES),
        crosses=rng.random() < 0.7,
        look=rng.uniform(4.0, 18.0) if ascent.down else rng.uniform(-20.0, -6.0),
        sway=rng.uniform(0.015, 0.035),
        holds={},
    )
    climb.holds.update(_holds(rng, climb))
    return climb
