"""The table of rules: one line an action of the vocabulary. Actions without a rule have no match."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from marey.quality.record import SHOWN
from marey.selector import arms, bodies, floor, gaits, gestures, guards, jumps
from marey.selector.motion import Motion

Rule = Callable[[Motion, str], float]
"""`(motion, side)` to a grade: 1 = shows the action clearly, 0.5 = at the bound of its definition, 0 = does not. `side`
is `left`, `right`, `both`, or empty where the prompt names none."""

RULES: Mapping[str, Rule] = {
    "idle": gaits.idle,
    "walk": gaits.walk,
    "walk-backward": gaits.walk_backward,
    "run": gaits.run,
    "sprint": gaits.sprint,
    "turn": gaits.turn,
    "turn-around": gaits.turn_around,
    "spin": gaits.spin,
    "sidestep": gaits.sidestep,
    "sneak": gaits.sneak,
    "balance": gaits.balance,
    "climb-stairs": gaits.climb_stairs,
    "climb-ladder": gaits.climb_ladder,
    "jump": jumps.jump,
    "jump-forward": jumps.jump_forward,
    "leap": jumps.leap,
    "hop": jumps.hop,
    "jump-turn": jumps.jump_turn,
    "jumping-jacks": jumps.jumping_jacks,
    "bow": floor.bow,
    "bend-over": floor.bend_over,
    "crouch": floor.crouch,
    "squat": floor.squat,
    "sit": floor.sit,
    "sit-down": floor.sit_down,
    "stand-up": floor.stand_up,
    "sit-floor": floor.sit_floor,
    "kneel": floor.kneel,
    "lie": floor.lie,
    "lie-down": floor.lie_down,
    "die": floor.die,
    "get-up": floor.get_up,
    "crawl": floor.crawl,
    "push-ups": floor.push_ups,
    "sit-ups": floor.sit_ups,
    "pick-up": floor.pick_up,
    "roll": floor.roll,
    "cartwheel": floor.cartwheel,
    "flip": floor.flip,
    "wave": arms.wave,
    "raise-arm": arms.raise_arm,
    "reach-up": arms.reach_up,
    "cheer": arms.cheer,
    "clap": arms.clap,
    "drink": arms.drink,
    "arm-circles": arms.arm_circles,
    "kick": arms.kick,
    "kick-ball": arms.kick_ball,
    "punch": arms.punch,
    "slash": arms.slash,
    "throw": arms.throw,
    "arabesque": arms.arabesque,
    "knee-to-elbow": arms.knee_to_elbow,
    "dance": arms.dance,
    "carry": bodies.carry,
    "climb-onto": bodies.climb_onto,
    "hang": bodies.hang,
    "swim": bodies.swim,
    "drive": bodies.drive,
    "twist": bodies.twist,
    "dribble": bodies.dribble,
    "shoot-basket": bodies.shoot_basket,
    "fight-stance": guards.fight_stance,
    "stab": guards.stab,
    "block": guards.block,
    "aim": guards.aim,
    "shoot": guards.shoot,
    "draw-bow": guards.draw_bow,
    "cast-spell": guards.cast_spell,
    "dodge": guards.dodge,
    "flinch": guards.flinch,
    "karate": guards.karate,
    "laugh": gestures.laugh,
    "nod": gestures.nod,
    "signal": gestures.signal,
    "guide": gestures.guide,
    "shiver": gestures.shiver,
    "talk": gestures.talk,
    "wash": gestures.wash,
    "reach-forward": gestures.reach_forward,
    "push": gestures.push,
}

TURNS = frozenset({"turn", "turn-around"})
"""Actions that turn the body, on its way or on the spot."""
EXACT: Mapping[str, Callable[[float], Rule]] = {"turn": gaits.turn_by, "turn-around": gaits.turn_around_by}
"""Rules of turns whose degrees the words name; they may lie beyond the definition of the action."""
WHILE_TURNING: Mapping[str, Rule] = {
    "walk": gaits.walk_any_way,
    "walk-backward": gaits.walk_backward_any_way,
    "run": gaits.run_any_way,
    "sprint": gaits.sprint_any_way,
}
"""Rules of gaits at once with a turn, which alone go straight ahead."""


def is_shown(motion: Motion, action: str, side: str = "") -> bool:
    """Return True if a motion shows an action by its rule.

    Args:
        motion: of the joints.
        action: id of an action that has a rule.
        side: `left`, `right` or `both`; empty where any will do.
    """
    return RULES[action](motion, side) >= SHOWN
