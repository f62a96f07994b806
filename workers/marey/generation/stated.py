"""Movements whose prompt states their form, and that are drawn for that: arms that are raised to a height
or in a direction, a number of claps, steps aside by number or at a pace, blows to a part of the body, kicks with a
spin, waves of both arms over the head, seats with crossed legs, jumps back or to a side, turns on the spot
and spins as far round as is said, stairs, gaits in place, and movements that have a name alone.

A network knows the action, but neither how high the hand is to go nor how often or how fast it is done. What states
nothing stays as the network makes it.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from marey.drawing.arms import clap_times, wave_for, wave_overhead
from marey.drawing.cheers import joy_jump
from marey.drawing.floor import sit_floor
from marey.drawing.gesture import Gesture
from marey.drawing.seats import sit_legs_crossed
from marey.generation.blocking import block_asked_for
from marey.generation.carrying import stated_load
from marey.generation.dancing import dance_asked_for
from marey.generation.drawn_guns import drawn_gun
from marey.generation.fine_wish import FineWish
from marey.generation.hits import stated_hit
from marey.generation.hopping import hops_away, jumps_away
from marey.generation.kicking import ball_kick_asked_for, kick_asked_for
from marey.generation.kneeling import drops_asked_for
from marey.generation.named import named_movement, times_again
from marey.generation.raising import stated_raise
from marey.generation.running_back import run_back_asked_for
from marey.generation.stairs import stairs_asked_for
from marey.generation.stepping_aside import diagonal_asked_for, steps_aside
from marey.generation.stepping_in_place import gait_asked_for_in_place
from marey.generation.strides import strides_asked_for
from marey.generation.turning import spin_asked_for, turn_asked_for, turn_in_place
from marey.generation.whole_body import drawn_in_place
from marey.motion.features import FeatureLayout, encode_all
from marey.vocabulary.counts import stated_count
from marey.vocabulary.lengths import stated_length

Float32 = NDArray[np.float32]
Statement = Callable[[FineWish, random.Random, float | None], Gesture | None]
"""`(wish, rng, seconds)`: the movement that the prompt states, None if it states none; seconds that it has to fill, or
None."""

AT_PACE = frozenset(
    {"sidestep", "walk", "walk-backward", "run", "sprint", "turn", "turn-around", "spin", "climb-stairs"}
)
"""Actions that are drawn at the pace that is asked for."""
_HIGH = re.compile(r"\boverhead\b|\b(?:above|over) (?:(?:his|her|their|the|your) )?heads?\b")
_BOTH = re.compile(r"\b(?:both|arms|hands)\b")
_WILD = re.compile(r"\b(?:wild\w*|frantic\w*|desperate\w*|franticly|attention|for help)\b")
_GOES = re.compile(r"\b(?:walk|run|jog|sit|kneel|jump|turn|danc)\w*")
"""Words of what else a body does that waves."""
_JUMPS = re.compile(r"\b(?:jump|leap|bounc|hop)\w*\b")
MOST_JUMPS = 8
"""Jumps for joy at most."""
_CROSSED = re.compile(
    r"\bcross(?:ed|ing)?[ -]leg\w*|\blegs (?:\w+ )?crossed\b|\b(?:crossed|crosses (?:his|her|their)) legs\b|\blotus\b"
)
_LEG_OVER = re.compile(
    r"\bcross(?:ed|ing)?[ -]leg\w*|\blegs (?:\w+ )?crossed\b|\bcross(?:ed|es|ing)? (?:(?:his|her|their|one) )?legs?\b"
    r"|\b(?:leg|knee|ankle) (?:crossed |thrown |resting )?(?:over|on|across) (?:the (?:other|opposite)|another)\b"
)
_DOWN = re.compile(r"\bdown\b|\btakes? a seat\b|\bfrom standing\b")


def _claps(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    del seconds  # the hands rest at the end
    return clap_times(rng, wish.count, high=bool(_HIGH.search(wish.prompt.lower()))) if wish.count else None


def _jumps_for_joy(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    del seconds
    if not _JUMPS.search(wish.prompt.lower()):
        return None
    times = wish.count or stated_count(wish.prompt, "jump") or rng.choice((2, 3))
    return joy_jump(rng, min(times, MOST_JUMPS))


def _waves(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    text = wish.prompt.lower()
    both = _BOTH.search(text)
    if _GOES.search(text):
        return None
    asked_s = stated_length(wish.prompt).seconds
    if asked_s is not None and not both:
        return wave_for(rng, wish.side, wish.count, seconds=seconds or asked_s)
    if not both or not (_HIGH.search(text) or _WILD.search(text)):
        return None
    return wave_overhead(rng, wish.count, seconds=seconds, wild=bool(_WILD.search(text)))


def _cross_legged(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
    del seconds
    text = wish.prompt.lower()
    if not _CROSSED.search(text):
        return None
    return sit_floor(rng, "floor-crossed", down=True if _DOWN.search(text) else None)


def _leg_over(*, down: bool) -> Statement:
    """Return the rule of a body on a seat: one leg lies over the other if the prompt says so."""

    def state(wish: FineWish, rng: random.Random, seconds: float | None) -> Gesture | None:
        return sit_legs_crossed(rng, down=down, seconds=seconds) if _LEG_OVER.search(wish.prompt.lower()) else None

    return state


STATED: Mapping[str, Statement] = {
    "raise-arm": stated_raise,
    "clap": _claps,
    "sidestep": steps_aside,
    "idle": named_movement,
    "flinch": stated_hit,
    "kick": kick_asked_for,
    "kick-ball": ball_kick_asked_for,
    "block": block_asked_for,
    **dict.fromkeys(("aim", "shoot"), drawn_gun),
    "cheer": lambda wish, rng, seconds: dance_asked_for(wish, rng, seconds) or _jumps_for_joy(wish, rng, seconds),
    "wave": _waves,
    "sit-floor": _cross_legged,
    "kneel": lambda wish, rng, seconds: named_movement(wish, rng, seconds) or drops_asked_for(wish, rng, seconds),
    "dance": dance_asked_for,
    "sit": _leg_over(down=False),
    "sit-down": _leg_over(down=True),
    "hop": hops_away,
    "turn": turn_in_place,
    "turn-around": turn_asked_for,
    "spin": spin_asked_for,
    "climb-stairs": stairs_asked_for,
    "walk": lambda wish, rng, seconds: (
        gait_asked_for_in_place("walk", wish, rng, seconds)
        or diagonal_asked_for(wish, rng, seconds)
        or strides_asked_for(wish, rng, seconds, back=False)
    ),
    "run": partial(gait_asked_for_in_place, "run"),
    "sprint": partial(gait_asked_for_in_place, "sprint"),
    "walk-backward": lambda wish, rng, seconds: (
        diagonal_asked_for(wish, rng, seconds)
        or run_back_asked_for(wish, rng, seconds)
        or strides_asked_for(wish, rng, seconds, back=True)
    ),
    **dict.fromkeys(("pick-up", "reach-forward"), stated_load),
    **dict.fromkeys(("dodge", "jump", "jump-forward"), jumps_away),
}
"""Movements by action."""


def stated_features(
    layout: FeatureLayout, action: str, wish: FineWish, frames: int | None, seed: int
) -> Float32 | None:
    """Return features (T, D) of the movement that a prompt states; None if it states no form.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        frames: that it keeps, if the wish is for a fixed length.
        seed: of the motion.
    """
    state = STATED.get(action)
    if state is None:
        return None
    rng = random.Random(f"{seed} {action}")  # noqa: S311
    first = state(wish, rng, None)
    if first is None:
        return None
    times, fixed = times_again(wish.prompt) if state is named_movement else 1, frames if wish.fixed else None
    joints = drawn_in_place(lambda seconds: state(wish, rng, seconds) or first, times, fixed, rng)
    return None if joints is None else encode_all(layout, joints)
