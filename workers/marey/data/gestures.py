"""Synthetic gestures on captured idles, walks and runs, for actions that few captures show.

Each gesture modifies a captured clip and keeps its feet, breath and sway; side, height, pace, length and number are
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
from marey.data.gesture_aims import aim, shoot_basket
from marey.data.gesture_archery import draw_bow
from marey.data.gesture_arms import clap, guide, raise_arm, wave
from marey.data.gesture_balls import dribble
from marey.data.gesture_blades import slash, stab
from marey.data.gesture_drawing import SIDES, Gesture
from marey.data.gesture_fights import block, punch
from marey.data.gesture_gaits import carry, is_plain_walk, is_quick_run, sprint
from marey.data.gesture_guards import fight_stance
from marey.data.gesture_hands import reach_forward, talk
from marey.data.gesture_laughs import laugh
from marey.data.gesture_lifts import arm_circles, drink, reach_up
from marey.data.gesture_poses import ARMS, StandingBody
from marey.data.gesture_pushes import push
from marey.data.gesture_signs import signal
from marey.data.gesture_throws import throw
from marey.data.gesture_trunk import bow, nod, shiver
from marey.data.part import FPS, Part
from marey.data.retime import LIMIT
from marey.data.soundness import is_broken
from marey.data.spoken import spoken

Array = NDArray[np.floating]

CAPTIONS = 2
"""Number of captions per voice and clip."""
_BASE = "idle"
_LEAST_BASE = 30  # frames of an idle
_STANDS = 0.15  # metres that the hips of an idle may move
_UPRIGHT = 0.88  # metres of the hips over the floor; about 1.0 when upright
_ANKLES = 0.16  # metres over the floor
_HANGS = 0.2  # metres that the wrists are below the shoulders
_ASIDE = 0.42  # metres, horizontal distance of the wrists from the hips
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
    """Make gestures on the idles, walks and runs among the parts of the training split."""
    for action, kind in KINDS.items():
        if bases := [part for part in parts if kind.is_base(part)]:
            made = (_made(f"G-{action}-{number:05}", action, bases) for number in range(TRIES * kind.count))
            yield from islice((part for part in made if part is not None), kind.count)


def is_plain_idle(part: Part) -> bool:
    """Return True for an idle that stands upright on both feet without moving away, with both arms down."""
    joints = part.joints
    if part.content != _BASE or len(joints) < _LEAST_BASE:
        return False
    wrists, shoulders = (joints[:, [ARMS[side][k] for side in SIDES]] for k in (3, 1))
    aside = np.linalg.norm((wrists - joints[:, :1])[..., [0, 2]], axis=-1)
    return bool(
        np.ptp(joints[:, 0], axis=0).max() < _STANDS
        and joints[:, 0, 1].min() > _UPRIGHT
        and joints[:, [7, 8], 1].max() < _ANKLES
        and (shoulders - wrists)[..., 1].min() > _HANGS
        and aside.max() < _ASIDE
    )


def _is_plain(part: Part) -> bool:
    return is_plain_idle(part) or is_plain_walk(part)


def _made(name: str, action: str, bases: Sequence[Part]) -> Part | None:
    rng = seeded("gesture", name)
    gesture = KINDS[action].draw(rng)
    if round(gesture.seconds * FPS) > LIMIT:
        return None
    if not (bases := [part for part in bases if gesture.content in ("", part.content)]):
        return None
    base = rng.choice(bases)
    taken = gesture.base(base) if gesture.base else _of_length(base.joints, round(gesture.seconds * FPS), rng)
    if taken is None:
        return None
    body = StandingBody(taken)
    gesture.change(body)
    joints = body.solved()
    feet = [7, 8, 10, 11]
    if is_broken(joints, FPS) or np.linalg.norm(joints[:, feet] - body.joints[:, feet], axis=-1).max() > _SLIPS:
        return None
    told = (*_captions_of(gesture, rng), spoken(action, name))
    source = replace(base.source, content=action, side=gesture.side, captions=told, facts="")
    facts = describe_text(told, joints, FPS)
    return Part(name, source, action, base.mirrored, joints.astype(np.float32), facts, made=True)


def _of_length(joints: Array, frames: int, rng: random.Random) -> Array:
    """Take `frames` frames of an idle; play a shorter one forward and backward, which suits breath and sway."""
    if len(joints) < frames:
        there_and_back = np.concatenate([joints, joints[-2:0:-1]])
        joints = np.tile(there_and_back, (-(-frames // len(there_and_back)), 1, 1))
    first = rng.randint(0, len(joints) - frames)
    return joints[first : first + frames]


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
    "sprint": Kind(60, sprint, is_quick_run),
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
}
