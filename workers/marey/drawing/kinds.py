"""Movements by the action that they show, each of a body that stands at first."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from typing import Protocol

from marey.drawing.aims import aim, shoot_basket
from marey.drawing.archery import draw_bow
from marey.drawing.arms import clap, guide, raise_arm, wave
from marey.drawing.bends import bend_over, pick_up, squat
from marey.drawing.blades import slash, stab
from marey.drawing.cheers import cheer
from marey.drawing.crouches import crouch
from marey.drawing.crunches import arabesque, knee_to_elbow
from marey.drawing.exercises import jumping_jacks, push_ups, sit_ups
from marey.drawing.fights import block
from marey.drawing.floor import sit_floor
from marey.drawing.gesture import Gesture
from marey.drawing.guards import fight_stance
from marey.drawing.hands import reach_forward, talk
from marey.drawing.hops import hop, jump, jump_forward
from marey.drawing.idles import idle
from marey.drawing.kicks import balance, kick, kick_ball
from marey.drawing.kneels import kneel
from marey.drawing.laughs import laugh
from marey.drawing.lifts import arm_circles, drink, reach_up
from marey.drawing.seats import sit, sit_down, stand_up
from marey.drawing.shots import shoot
from marey.drawing.signs import signal
from marey.drawing.spells import cast_spell
from marey.drawing.throws import throw
from marey.drawing.trunk import bow, shiver
from marey.drawing.twists import twist
from marey.drawing.washes import wash


class Counted(Protocol):
    """A function that draws a movement as often as is asked for."""

    def __call__(self, rng: random.Random, *, times: int | None = None) -> Gesture:
        """Draw `times` movements, some if it is None."""
        ...


COUNTED: Mapping[str, Counted] = {
    "arm-circles": arm_circles,
    "bend-over": bend_over,
    "block": block,
    "bow": bow,
    "cast-spell": cast_spell,
    "cheer": cheer,
    "hop": hop,
    "jump": jump,
    "jump-forward": jump_forward,
    "jumping-jacks": jumping_jacks,
    "kick": kick,
    "knee-to-elbow": knee_to_elbow,
    "push-ups": push_ups,
    "sit-ups": sit_ups,
    "slash": slash,
    "squat": squat,
    "stab": stab,
}
DRAWINGS: Mapping[str, Callable[[random.Random], Gesture]] = {
    **COUNTED,
    "aim": aim,
    "arabesque": arabesque,
    "balance": balance,
    "clap": clap,
    "crouch": crouch,
    "draw-bow": draw_bow,
    "drink": drink,
    "fight-stance": fight_stance,
    "guide": guide,
    "idle": idle,
    "kick-ball": kick_ball,
    "kneel": kneel,
    "laugh": laugh,
    "pick-up": pick_up,
    "raise-arm": raise_arm,
    "reach-forward": reach_forward,
    "reach-up": reach_up,
    "shoot": shoot,
    "shoot-basket": shoot_basket,
    "shiver": shiver,
    "signal": signal,
    "sit": sit,
    "sit-down": sit_down,
    "sit-floor": sit_floor,
    "stand-up": stand_up,
    "talk": talk,
    "throw": throw,
    "twist": twist,
    "wash": wash,
    "wave": wave,
}
"""Functions of a random generator that draw one movement of an action. `flinch` is left out: what is drawn of it in
place of a failed motion passes the referee less often, on development prompts."""
