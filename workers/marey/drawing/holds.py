"""Postures in which a body stays for a while, and its ways there from standing, back, and from one to another.

The same name and the same generator of random numbers give the same posture, so that several parts of a motion that are
drawn one by one meet in it.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from marey.drawing.crawls import on_fours
from marey.drawing.crouches import crouched
from marey.drawing.floor import (
    aiming_prone,
    half_kneeling,
    lying_back,
    lying_front,
    planking,
    rising_from_seat,
    seated_on_floor,
    slid,
)
from marey.drawing.kneels import kneeling
from marey.drawing.low_deeds import LowDeed, deed_steps
from marey.drawing.postures import STAND, Posture, mirrored
from marey.drawing.seats import crossed_on_seat, seated_on_seat
from marey.drawing.sequels import Sequel, Step

SEAT, FLOOR, UPRIGHT, KNEES, KNEE = "seat", "floor", "upright", "knees", "knee"
RIGHT_KNEE = "right-knee"
CROUCH, BACK, FRONT, PRONE, SLIDE, FOURS = "crouch", "back", "front", "prone", "slide", "fours"
PLANK, CROSSED = "plank", "crossed"
LEFT_SIDE, RIGHT_SIDE = "left-side", "right-side"
"""Names of postures: on a seat; on the floor, legs crossed, or stretched as those of who lay there; on both knees, or
on one, the left or the right; crouched; on the back, and on the front; on the front with a gun aimed, on the elbows; on
the seat behind the feet, after a slide; on hands and knees; on hands and toes; on a seat with one leg over the other;
on a side, as who dived there (`marey.drawing.floor_ways`)."""
SITTING, KNEELING = frozenset({FLOOR, UPRIGHT}), frozenset({KNEES, KNEE, RIGHT_KNEE, FOURS})
SIDES_DOWN = frozenset({LEFT_SIDE, RIGHT_SIDE})
LYING = frozenset({BACK, FRONT, PRONE}) | SIDES_DOWN
SEATED = frozenset({SEAT, CROSSED})
ON_HANDS = frozenset({FOURS, PLANK})
BEGINS_S, STANDS_S = 0.3, 0.5
"""Seconds in which a body waits before it moves, in a posture and standing."""
SLIDES_M, SLIDES_S = 2.4, 1.2
"""Metres and seconds for which a body slides on behind its feet."""
PASSES_S = 0.8
"""Seconds from one low posture to another."""


@dataclass(frozen=True)
class Hold:
    """A posture and the ways to it.

    Attributes:
        low: the posture.
        down: seconds and posture of each step from standing, `low` the last.
        up: the same back, standing the last.
    """

    low: Posture
    down: tuple[Step, ...]
    up: tuple[Step, ...]


def hold_named(name: str, rng: random.Random) -> Hold:
    """Return a posture by its name; `rng` decides what the name leaves open."""
    return Hold(*_HOLDS[name](rng))


def passing(begin: str, own: str, end: str, seconds: float, seed: str, deed: LowDeed | None = None) -> Sequel:
    """Return a body that goes from a posture to another, stays there, and goes on to a third; empty = standing.

    Args:
        begin: name of the first posture.
        own: of the one that it stays in.
        end: of the last one.
        seconds: that it stays.
        seed: decides the postures.
        deed: what the hands do there, before it stays.
    """
    holds = {name: _hold(name, seed) for name in (begin, own, end) if name}
    between = [UPRIGHT] if LYING & set(holds) else []
    for name in (*between, *([FRONT] if PRONE in holds else []), *([SEAT] if CROSSED in holds else [])):
        holds.setdefault(name, _hold(name, seed))
    waits = BEGINS_S if begin else STANDS_S
    done = Sequel([waits if begin != own != SLIDE else 0.0], [holds[begin].low if begin else STAND])
    for step in _way(holds, begin, own):
        done.then(*step)
    if deed is not None:
        for step in deed_steps(deed, own, holds[own].low, random.Random(f"{seed} {deed.kind}")):  # noqa: S311
            done.then(*step)
    if seconds > 0.0:
        done.then(seconds, done.postures[-1])
    for step in _way(holds, own, end):
        done.then(*step)
    return done


def _hold(name: str, seed: str) -> Hold:
    """Return the posture of a name that all parts of a motion of the same seed share, on the same seat."""
    return hold_named(name, random.Random(f"{seed} {SEAT if name in SEATED else name}"))  # noqa: S311


def _way(holds: Mapping[str, Hold], begin: str, end: str) -> tuple[Step, ...]:
    """Return the steps from a posture to another."""
    if begin == end:
        return ()
    if begin == CROSSED:
        return (*holds[CROSSED].up[:2], *_way(holds, SEAT, end)) if end else holds[CROSSED].up
    if end == CROSSED:
        return (*_way(holds, begin, SEAT), *holds[CROSSED].down[-2:]) if begin else holds[CROSSED].down
    if end == PRONE:
        return (*_way(holds, begin, FRONT), holds[FRONT].up[0], *holds[PRONE].down)
    if begin == PRONE:
        beside = holds[FRONT].up[0]
        return (beside, *(_way(holds, FRONT, end)[1:] if end != FRONT else ((PASSES_S, holds[FRONT].low),)))
    if not begin:
        return holds[end].down
    if not end:
        return holds[begin].up
    if begin == BACK and end == UPRIGHT:
        return (*holds[BACK].up[:1], (0.6, holds[UPRIGHT].low))
    if begin == UPRIGHT and end == BACK:
        return holds[BACK].down[-2:]
    if begin == BACK or end == BACK:
        return (*_way(holds, begin, UPRIGHT), *_way(holds, UPRIGHT, end))
    if begin == FRONT and end == FOURS:
        return (*holds[FRONT].up[:2], (PASSES_S, holds[FOURS].low))
    if begin == FRONT and end == PLANK:
        return holds[FRONT].up[:3]
    if begin == FRONT:
        return (*holds[FRONT].up[:-1], *(holds[end].down if end in SITTING else ((PASSES_S, holds[end].low),)))
    if {begin, end} == {PLANK, FOURS}:
        return ((PASSES_S, holds[end].low),)
    if end == FRONT:
        return holds[FRONT].down[2:] if begin in ON_HANDS else holds[FRONT].down
    if end == PLANK and begin != FRONT:
        return holds[PLANK].down
    if begin == PLANK:
        return (*holds[PLANK].up[:-1], *(holds[end].down if end in SITTING else ((PASSES_S, holds[end].low),)))
    if begin == FOURS and end == CROUCH:
        return (*holds[FOURS].up[:-1], (PASSES_S, holds[CROUCH].low))
    if {begin, end} == {SEAT, FOURS}:  # over the feet
        return (*holds[begin].up[:-1], *holds[end].down)
    if {begin, end} & SITTING and {begin, end} & {*KNEELING, CROUCH}:  # legs do not pass under the hips
        return (*holds[begin].up[:-1], *holds[end].down)
    return ((PASSES_S, holds[end].low),)


def _on_floor(rng: random.Random, form: str) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    low, down = seated_on_floor(rng, form)
    return low, down, rising_from_seat(rng)


def _on_knees(rng: random.Random, *, one: bool) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    way, half, low = kneeling(rng, one=one)
    down = [(0.5, way), (0.4, low)] if one else [(0.5, way), (0.4, half), (0.6, low)]
    up = [*([] if one else [(0.6, half)]), (0.45, way), (0.55, STAND)]
    return low, tuple(down), tuple(up)


def _on_fours(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    low, pace = on_fours(rng), rng.uniform(0.9, 1.1)
    return low, ((0.7 * pace, half_kneeling()), (0.6 * pace, low)), ((0.9 * pace, half_kneeling()), (0.7 * pace, STAND))


def _on_right_knee(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    low, down, up = _on_knees(rng, one=True)
    ways = (tuple((seconds, mirrored(posture)) for seconds, posture in way) for way in (down, up))
    return mirrored(low), next(ways), next(ways)


def _crouched(rng: random.Random) -> tuple[Posture, tuple[Step, ...], tuple[Step, ...]]:
    low, seconds = crouched(rng), rng.uniform(0.7, 1.0)
    return low, ((seconds, low),), ((1.1 * seconds, STAND),)


_HOLDS: Mapping[str, Callable[[random.Random], tuple[Posture, tuple[Step, ...], tuple[Step, ...]]]] = {
    SEAT: seated_on_seat,
    CROSSED: crossed_on_seat,
    FLOOR: lambda rng: _on_floor(rng, "floor-crossed"),
    UPRIGHT: lambda rng: _on_floor(rng, "floor-stretched"),
    KNEES: lambda rng: _on_knees(rng, one=False),
    KNEE: lambda rng: _on_knees(rng, one=True),
    RIGHT_KNEE: _on_right_knee,
    CROUCH: _crouched,
    BACK: lying_back,
    FRONT: lying_front,
    PRONE: aiming_prone,
    SLIDE: slid,
    FOURS: _on_fours,
    PLANK: planking,
}
