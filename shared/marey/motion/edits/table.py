"""Every operation, for Python, JSON and the command line. Standard library only: the small client imports it."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from marey.motion.edits.operation import Operation, Parameter, choice, moment, number, reference

LONGEST_BLEND = 0.3
"""Seconds; a loop differs from its source in no more than that before its end."""
_HERE = "marey.motion.edits"

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
                f"seconds before the end in which the loop may differ from its source; default {LONGEST_BLEND:g}.",
                number(0.1, LONGEST_BLEND),
                LONGEST_BLEND,
                option="--blend",
                metavar="SECONDS",
            ),
        ),
    ),
    Operation("mirror", "Exchange left and right.", f"{_HERE}.mirror:mirror", keeps_cycle=True),
    Operation(
        "speed",
        "Play F times as fast, at the same frame rate.",
        f"{_HERE}.timing:change_speed",
        (Parameter("factor", "2 halves the length.", number(0.1, 10.0)),),
        metavar="F",
        keeps_cycle=True,
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
    ),
    Operation("reverse", "Play backwards.", f"{_HERE}.timing:reverse"),
    Operation(
        "smooth",
        "Remove movement that is faster than HZ oscillations a second.",
        f"{_HERE}.smoothing:low_pass",
        (Parameter("hz", "Frequency that is halved in power; higher ones lose more.", number(0.5, 60.0)),),
        metavar="HZ",
    ),
    Operation(
        "fps",
        "Frame rate of the result.",
        f"{_HERE}.timing:change_rate",
        (Parameter("rate", "Frames a second.", number(1.0, 240.0)),),
        metavar="FPS",
        keeps_cycle=True,
    ),
    Operation(
        "feet",
        "lock = standing feet stay in place; free = find the contacts again and move nothing; raw = the feet as the "
        "model generated them, for a motion that was not edited.",
        f"{_HERE}.feet:set_feet",
        (Parameter("mode", "lock, free or raw.", choice("lock", "free", "raw")),),
        metavar="lock|free|raw",
    ),
)
OPERATIONS: Mapping[str, Operation] = MappingProxyType({each.name: each for each in _ALL})
"""By name, in the order of help texts."""
