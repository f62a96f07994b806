"""Every operation, for Python, JSON and the command line. Standard library only: the small client imports it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from marey.motion.edits.operation import (
    REQUIRED,
    Operation,
    Parameter,
    choice,
    moment,
    number,
    reference,
    sentence,
    switch,
    whole,
)

LONGEST_BLEND = 0.3
"""Seconds; a loop differs from its source in no more than that before its end."""
LONGEST_EXTENSION, LONGEST_BRIDGE = 60.0, 8.0
"""Seconds that a model adds to a motion, and between two motions."""
MOST_SEED, MOST_CANDIDATES = 2**31 - 1, 8
PARTS = ("left-arm", "right-arm", "arms", "head", "upper-body")
_HERE = "marey.motion.edits"
_THERE = "marey.generation.shots.edits"
_SEED = Parameter(
    "seed", "seed of the new frames; default 0.", whole(0, MOST_SEED), 0, option="--seed", metavar="NUMBER"
)
_CANDIDATES = Parameter(
    "candidates",
    f"number of tries, 1 to {MOST_CANDIDATES}, of which the one that matches the prompt best is taken; default 1.",
    whole(1, MOST_CANDIDATES),
    1,
    option="--candidates",
    metavar="NUMBER",
)
_FORCE = Parameter(
    "force", "edit frames that the model's tokens cannot show, too.", switch, default=False, option="--force"
)


def _prompt(about: str, default: str | None = None) -> Parameter:
    return Parameter("prompt", about, sentence, default, option="--prompt", metavar="TEXT")


_BY_MODEL = (
    Operation(
        "extend",
        "Generate SECONDS more of the motion.",
        f"{_THERE}:extend",
        (
            Parameter("seconds", "Length to add.", number(0.1, LONGEST_EXTENSION)),
            _prompt("the new action; default: the motion's own prompt."),
            _SEED,
            _CANDIDATES,
            _FORCE,
        ),
        metavar="SECONDS",
        needs_model=True,
    ),
    Operation(
        "in-between",
        "Generate the way to another motion, which then follows.",
        f"{_THERE}:in_between",
        (
            Parameter("with", "The other motion.", reference),
            Parameter(
                "seconds",
                "length of the way; default 1.",
                number(0.1, LONGEST_BRIDGE),
                1.0,
                option="--seconds",
                metavar="SECONDS",
            ),
            _prompt("an action on the way; default: the two motions alone decide."),
            _SEED,
            _FORCE,
        ),
        metavar="MOTION",
        needs_model=True,
    ),
    Operation(
        "repaint",
        "Generate the frames from A to B anew, both included: seconds, or frames such as f12.",
        f"{_THERE}:repaint",
        (
            Parameter("from", "First moment to generate; default: the first frame.", moment, 0.0),
            Parameter("to", "Last moment to generate; default: the last frame.", moment, None),
            _prompt("the action; default: the frames before and after alone decide."),
            Parameter(
                "rest",
                "the frames after it: follow = go on from where the new ones end; stay = keep their place; "
                "default follow.",
                choice("follow", "stay"),
                "follow",
                option="--rest",
                metavar="follow|stay",
            ),
            _SEED,
            _CANDIDATES,
            _FORCE,
        ),
        metavar="A:B",
        needs_model=True,
    ),
    Operation(
        "body-part",
        f"Move a part of the body as another prompt says, from A to B: {', '.join(PARTS)}.",
        f"{_THERE}:body_part",
        (
            Parameter("part", "The part.", choice(*PARTS)),
            Parameter("from", "First moment; default: the first frame.", moment, 0.0),
            Parameter("to", "Last moment; default: the last frame.", moment, None),
            _prompt("the action of the part.", REQUIRED),
            _SEED,
            _CANDIDATES,
        ),
        metavar="PART[:A:B]",
        keeps_place=True,
        needs_model=True,
    ),
)

_ALL = (
    Operation(
        "trim",
        "Keep the frames from A to B, both included: seconds, or frames such as f12; either may be left out.",
        f"{_HERE}.cuts:trim",
        (
            Parameter("from", "First moment to keep; default: the first frame.", moment, 0.0),
            Parameter("to", "Last moment to keep; default: the last frame.", moment, None),
        ),
        metavar="A:B",
        keeps_rows=True,
    ),
    Operation(
        "split",
        "Cut at T, in seconds or a frame such as f12, into two motions; the frame there stands in both.",
        f"{_HERE}.cuts:split",
        (Parameter("at", "Moment of the cut.", moment),),
        metavar="T",
        pieces=True,
    ),
    Operation(
        "concat",
        "Let another motion follow, from the place and heading of the last pose on.",
        f"{_HERE}.concat:concat",
        (
            Parameter("with", "The other motion.", reference),
            Parameter(
                "blend",
                "seconds in which the difference of the two poses fades; default 0.25.",
                number(0.0, 2.0),
                0.25,
                option="--blend",
                metavar="SECONDS",
            ),
        ),
        metavar="MOTION",
    ),
    Operation(
        "loop",
        "Cut a cycle out of the motion that can be played on and on: whole gait cycles, otherwise 2 s or longer.",
        f"{_HERE}.loop:loop",
        (
            Parameter(
                "end",
                "the last frame: closed = the first one again, after the travel; open = the one before it; "
                "default closed.",
                choice("closed", "open"),
                "closed",
                option="--loop-end",
                metavar="closed|open",
            ),
            Parameter(
                "blend",
                f"seconds before the end in which the loop may differ from its source, up to 2 in a motion without "
                f"steps where that is too short; default {LONGEST_BLEND:g}.",
                number(0.1, LONGEST_BLEND),
                LONGEST_BLEND,
                option="--blend",
                metavar="SECONDS",
            ),
        ),
        keeps_rows=True,
    ),
    Operation("mirror", "Exchange left and right.", f"{_HERE}.mirror:mirror", keeps_cycle=True, keeps_rows=True),
    Operation(
        "speed",
        "Play F times as fast, at the same frame rate.",
        f"{_HERE}.timing:change_speed",
        (Parameter("factor", "2 halves the length.", number(0.1, 10.0)),),
        metavar="F",
        keeps_cycle=True,
        keeps_rows=True,
    ),
    Operation(
        "in-place",
        "Remove the travel, or travel and heading; the manifest records what was removed.",
        f"{_HERE}.in_place:in_place",
        (
            Parameter(
                "remove",
                "travel, or heading for both; default travel.",
                choice("travel", "heading"),
                "travel",
            ),
        ),
        metavar="travel|heading",
        keeps_cycle=True,
        keeps_rows=True,
    ),
    Operation("reverse", "Play backwards.", f"{_HERE}.timing:reverse", keeps_rows=True),
    Operation(
        "smooth",
        "Remove movement that is faster than HZ oscillations a second.",
        f"{_HERE}.smoothing:low_pass",
        (Parameter("hz", "Frequency that is halved in power; higher ones lose more.", number(0.5, 60.0)),),
        metavar="HZ",
        keeps_rows=True,
    ),
    Operation(
        "fps",
        "Frame rate of the result.",
        f"{_HERE}.timing:change_rate",
        (Parameter("rate", "Frames a second.", number(1.0, 240.0)),),
        metavar="FPS",
        keeps_cycle=True,
        keeps_rows=True,
    ),
    Operation(
        "feet",
        "lock = standing feet stay in place; free = find the contacts again and move nothing; raw = the feet as the "
        "model generated them, for a motion that was not edited.",
        f"{_HERE}.feet:set_feet",
        (Parameter("mode", "lock, free or raw.", choice("lock", "free", "raw")),),
        metavar="lock|free|raw",
        keeps_rows=True,
    ),
    *_BY_MODEL,
)
OPERATIONS: Mapping[str, Operation] = MappingProxyType({each.name: each for each in _ALL})
"""By name, in the order of help texts."""
