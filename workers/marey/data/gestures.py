"""Synthetic gestures on captured idles, walks, runs, jumps and climbs, for actions that few captures show.

Each gesture modifies a captured clip and keeps its breath and sway; side, height, pace, length and number are
random. These clips are marked as `made`, are used for training only, and are at most half of the draws of an action
(`marey.data.sampling`). The files `gestures*.toml` have captions of each kind in three voices.
"""

from __future__ import annotations

import random
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from marey.data.captions import seeded
from marey.data.compose import TRIES
from marey.data.describe import describe_text
from marey.data.gesture_balls import dribble
from marey.data.gesture_climbs import climb_ladder, climb_onto, is_climb_down, is_ladder
from marey.data.gesture_gaits import carry, is_plain_walk, is_quick_run
from marey.data.gesture_idles import is_plain_idle, of_length
from marey.data.gesture_leaps import leap
from marey.data.gesture_pushes import push
from marey.data.gesture_sneaks import sneak
from marey.data.gesture_spins import is_single_jump, jump_turn, spin
from marey.data.gesture_stairs import climb_stairs
from marey.data.gesture_steps import sidestep, turn_around
from marey.data.gesture_travel import bent_walk, is_plain_gait, run, sprint, starts_backward, turn, walk_backward
from marey.data.part import FPS, Part
from marey.data.retime import LIMIT
from marey.data.soundness import is_broken
from marey.data.spoken import spoken
from marey.drawing.aims import aim, shoot_basket
from marey.drawing.archery import draw_bow
from marey.drawing.arms import clap, guide, raise_arm, wave
from marey.drawing.bends import bend_over, pick_up, squat
from marey.drawing.blades import slash, stab
from marey.drawing.cheers import cheer
from marey.drawing.crawls import crawl
from marey.drawing.crouches import crouch
from marey.drawing.crunches import arabesque, knee_to_elbow
from marey.drawing.dodges import dodge, flinch
from marey.drawing.exercises import jumping_jacks, push_ups, sit_ups
from marey.drawing.falls import die
from marey.drawing.fights import block, punch
from marey.drawing.floor import get_up, lie, lie_down, sit_floor
from marey.drawing.gesture import Gesture
from marey.drawing.guards import fight_stance
from marey.drawing.hands import reach_forward, talk
from marey.drawing.hangs import hang
from marey.drawing.hops import hop, jump, jump_forward
from marey.drawing.kicks import balance, kick, kick_ball
from marey.drawing.kneels import kneel
from marey.drawing.laughs import laugh
from marey.drawing.lifts import arm_circles, drink, reach_up
from marey.drawing.rolls import flip, roll
from marey.drawing.seats import sit, sit_down, stand_up
from marey.drawing.shots import shoot
from marey.drawing.signs import signal
from marey.drawing.spells import cast_spell
from marey.drawing.swims import swim
from marey.drawing.throws import throw
from marey.drawing.trunk import bow, nod, shiver
from marey.drawing.twists import twist
from marey.drawing.washes import wash
from marey.drawing.wheels import drive
from marey.posing.standing import StandingBody

Array = NDArray[np.floating]

CAPTIONS = 2
"""Number of captions per voice and clip."""
_FLAT = 0.05  # metres between the heights of the ankles
_SLIPS = 0.01  # metres, largest error of a foot after solving the legs
_TIMES = {2: "twice", 3: "three times"}


@dataclass(frozen=True)
class Kind:
    """An action that is made.

    Attributes:
        count: number of clips to make.
        draw: draws a gesture.
        is_base: True for captured clips that it may be put onto.
    """

    count: int
    draw: Callable[[random.Random], Gesture]
    is_base: Callable[[Part], bool]


def made_gestures(parts: Sequence[Part]) -> Iterator[Part]:
    """Make gestures on the clips among the parts of the training split."""
    for action, kind in KINDS.items():
        if bases := [part for part in parts if kind.is_base(part)]:
            made = (_made(f"G-{action}-{number:05}", action, bases) for number in range(TRIES * kind.count))
            yield from islice((part for part in made if part is not None), kind.count)


def _is_plain(part: Part) -> bool:
    return is_plain_idle(part) or is_plain_walk(part)


def is_flat_idle(part: Part) -> bool:
    """Return True for a plain idle with both feet flat on the floor."""
    return is_plain_idle(part) and bool(np.ptp(part.joints[:, [7, 8], 1]) < _FLAT)


def _made(name: str, action: str, bases: Sequence[Part]) -> Part | None:
    rng = seeded("gesture", name)
    gesture = KINDS[action].draw(rng)
    if round(gesture.seconds * FPS) > LIMIT:
        return None
    if not (bases := [part for part in bases if gesture.content in ("", part.content)]):
        return None
    base = rng.choice(bases)
    taken = gesture.base(base) if gesture.base else of_length(base.joints, round(gesture.seconds * FPS), rng)
    if taken is None:
        return None
    body = StandingBody(taken)
    gesture.change(body)
    joints = body.solved()
    feet = [7, 8, 10, 11]
    if is_broken(joints, FPS) or np.linalg.norm(joints[:, feet] - body.joints[:, feet], axis=-1).max() > _SLIPS:
        return None
    told = (*_captions_of(gesture, rng), spoken(action, name, gesture.untrue))
    source = replace(base.source, content=action, side=gesture.side, captions=told, facts="")
    facts = describe_text(told, joints, FPS)
    return Part(name, source, action, base.mirrored, joints.astype(np.float32), facts, made=True)


def _captions_of(gesture: Gesture, rng: random.Random) -> tuple[tuple[str, ...], ...]:
    """Draw captions of a gesture in each voice, general ones or ones of its special kind."""
    told = []
    for said in _captions().values():
        chosen = [rng.choice(said[rng.choice(gesture.kinds)]) for _ in range(CAPTIONS)]
        texts = (text.format(side=gesture.side, times=_TIMES.get(gesture.times, "")) for text in chosen)
        told.append(tuple(dict.fromkeys(texts)))
    return tuple(told)


@cache
def _captions() -> Mapping[str, Mapping[str, Sequence[str]]]:
    return read_captions(Path(__file__).parent)


def read_captions(folder: Path) -> Mapping[str, Mapping[str, Sequence[str]]]:
    """Read the captions by voice and key from all `gestures*.toml` of a folder.

    Raises:
        ValueError: if a key stands twice in one voice.
    """
    voices: dict[str, dict[str, Sequence[str]]] = {}
    for path in sorted(folder.glob("gestures*.toml")):
        for voice, rows in tomllib.loads(path.read_text("utf-8")).items():
            said = voices.setdefault(voice, {})
            if twice := sorted(said.keys() & rows.keys()):
                raise ValueError(f"{path.name}: voice {voice} has captions already of {', '.join(twice)}")
            said.update(rows)
    return voices


KINDS: Mapping[str, Kind] = {
    "wave": Kind(160, wave, is_plain_idle),
    "raise-arm": Kind(160, raise_arm, is_plain_idle),
    "bow": Kind(120, bow, is_plain_idle),
    "guide": Kind(60, guide, is_plain_idle),
    "clap": Kind(120, clap, is_plain_idle),
    "nod": Kind(60, nod, is_plain_idle),
    "carry": Kind(120, carry, is_plain_walk),
    "reach-forward": Kind(120, reach_forward, is_plain_idle),
    "aim": Kind(120, aim, is_plain_idle),
    "shoot-basket": Kind(100, shoot_basket, is_plain_idle),
    "talk": Kind(100, talk, is_plain_idle),
    "shiver": Kind(60, shiver, is_plain_idle),
    "drink": Kind(120, drink, is_plain_idle),
    "reach-up": Kind(120, reach_up, is_plain_idle),
    "arm-circles": Kind(120, arm_circles, is_plain_idle),
    "draw-bow": Kind(120, draw_bow, is_plain_idle),
    "push": Kind(120, push, _is_plain),
    "throw": Kind(140, throw, is_plain_idle),
    "laugh": Kind(120, laugh, is_plain_idle),
    "fight-stance": Kind(120, fight_stance, is_plain_idle),
    "dribble": Kind(120, dribble, _is_plain),
    "punch": Kind(140, punch, is_plain_idle),
    "stab": Kind(120, stab, is_plain_idle),
    "slash": Kind(140, slash, is_plain_idle),
    "block": Kind(120, block, is_plain_idle),
    "signal": Kind(100, signal, is_plain_idle),
    "sprint": Kind(100, sprint, is_quick_run),
    "walk-backward": Kind(140, walk_backward, starts_backward),
    "run": Kind(120, run, is_quick_run),
    "turn": Kind(120, turn, is_plain_gait),
    "walk": Kind(40, bent_walk, is_plain_walk),
    "turn-around": Kind(140, turn_around, is_plain_idle),
    "sidestep": Kind(140, sidestep, is_plain_idle),
    "spin": Kind(120, spin, is_plain_idle),
    "jump-turn": Kind(80, jump_turn, is_single_jump),
    "climb-stairs": Kind(120, climb_stairs, is_plain_idle),
    "leap": Kind(100, leap, is_quick_run),
    "climb-onto": Kind(60, climb_onto, is_climb_down),
    "climb-ladder": Kind(60, climb_ladder, is_ladder),
    "sneak": Kind(120, sneak, is_plain_walk),
    "squat": Kind(140, squat, is_plain_idle),
    "bend-over": Kind(120, bend_over, is_flat_idle),
    "pick-up": Kind(140, pick_up, is_plain_idle),
    "sit-down": Kind(120, sit_down, is_plain_idle),
    "stand-up": Kind(120, stand_up, is_plain_idle),
    "sit": Kind(100, sit, is_plain_idle),
    "kick": Kind(120, kick, is_plain_idle),
    "kick-ball": Kind(120, kick_ball, is_plain_idle),
    "balance": Kind(120, balance, is_plain_idle),
    "jumping-jacks": Kind(100, jumping_jacks, is_plain_idle),
    "kneel": Kind(120, kneel, is_plain_idle),
    "push-ups": Kind(80, push_ups, is_plain_idle),
    "sit-ups": Kind(80, sit_ups, is_plain_idle),
    "lie-down": Kind(100, lie_down, is_plain_idle),
    "get-up": Kind(100, get_up, is_plain_idle),
    "sit-floor": Kind(100, sit_floor, is_plain_idle),
    "lie": Kind(80, lie, is_plain_idle),
    "die": Kind(100, die, is_plain_idle),
    "dodge": Kind(100, dodge, is_plain_idle),
    "flinch": Kind(100, flinch, is_plain_idle),
    "roll": Kind(100, roll, is_plain_idle),
    "swim": Kind(100, swim, is_plain_idle),
    "flip": Kind(80, flip, is_plain_idle),
    "crouch": Kind(80, crouch, is_plain_idle),
    "crawl": Kind(60, crawl, is_plain_idle),
    "hop": Kind(80, hop, is_plain_idle),
    "twist": Kind(60, twist, is_plain_idle),
    "cheer": Kind(80, cheer, is_plain_idle),
    "hang": Kind(60, hang, is_plain_idle),
    "drive": Kind(60, drive, is_plain_idle),
    "cast-spell": Kind(80, cast_spell, is_plain_idle),
    "shoot": Kind(80, shoot, is_plain_idle),
    "wash": Kind(80, wash, is_plain_idle),
    "arabesque": Kind(60, arabesque, is_plain_idle),
    "knee-to-elbow": Kind(60, knee_to_elbow, is_plain_idle),
    "jump": Kind(60, jump, is_plain_idle),
    "jump-forward": Kind(60, jump_forward, is_plain_idle),
}
