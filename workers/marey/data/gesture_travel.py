"""Runs, sprints, walks backward and turns that are made of captured straight runs and walks."""

from __future__ import annotations

import random
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.data.gesture_gaits import is_plain_walk, is_quick_run, speed_of
from marey.data.gesture_idles import is_plain_idle
from marey.data.gesture_stairs import steps_back
from marey.data.gesture_ways import STRAIGHT, Bending, relaid
from marey.data.part import FPS, Part
from marey.data.retarget import resample_points
from marey.data.retime import LIMIT, loop
from marey.drawing.gesture import SIDES, Gesture
from marey.posing.bones import with_bones
from marey.posing.standing import ARMS, LEFT, RIGHT, StandingBody

Array = NDArray[np.floating]
ChooseBending = Callable[[float], Bending]
"""Chooses the curve for a way of so many metres."""

_STRIDES = (0.6, 1.2)
_RUN_PACES, _WALK_PACES, _SPRINT_PACES = (0.88, 1.18), (0.85, 1.12), (1.08, 1.34)
_RUNS = {"run-jog": (2.0, 2.6), "run-plain": (2.6, 3.4), "run-fast": (3.4, 3.95)}  # m/s
_SPRINTS = (4.2, 5.1)
_STRAIGHT, _TURNS = (0.0, 36.0), (50.0, 195.0)  # degrees
_GENTLE = 24.0  # degrees of the bend of a way that is still straight on
_BACKWARD = {"slow": (0.42, 0.6), "": (0.55, 1.05), "quick": (1.05, 1.35)}  # m/s
_CORNERS = (0.9, 1.7)  # metres of way of a quarter turn at walking pace
_RUN_CORNERS = (3.2, 5.5)  # metres at running pace
_STEPS_BACK, _RUNS_BACKWARD, _RUNNING = 0.35, 0.35, 0.75  # shares of draws; few bases are runs
_HANDS_UP = {"out": (0.1, 0.22), "up": (-0.16, 0.06), "ahead": (0.26, 0.4)}


def starts_backward(part: Part) -> bool:
    """Return True for what walks backward are made of: idles, walks and runs."""
    return is_plain_idle(part) or is_plain_gait(part)


def is_plain_gait(part: Part) -> bool:
    """Return True for a walk or a run that may become a turn."""
    return is_plain_walk(part) or is_quick_run(part)


def run(rng: random.Random) -> Gesture:
    form = rng.choices(list(_RUNS), (1, 2, 1))[0]
    seconds, lean = rng.uniform(1.4, 6.0), _leaning(rng.uniform(-2, 6), rng.uniform(0.0, 0.4))
    opened, out = rng.uniform(-10, 35), rng.uniform(-5, 9)

    def change(body: StandingBody) -> None:
        lean(body)
        for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
            _, shoulder, elbow, _ = ARMS[side]
            body.turn(elbow, "left", np.full(len(body.joints), opened))
            body.turn(shoulder, "forward", np.full(len(body.joints), -sign * out))

    base = straight_gait(rng, seconds, rng.uniform(*_RUNS[form]), _RUN_PACES, gentle_bend(rng))
    return Gesture(seconds, ("run", form), change, base=base)


def sprint(rng: random.Random) -> Gesture:
    seconds, lean = rng.uniform(1.3, 4.5), _leaning(rng.uniform(0, 6), rng.uniform(0.0, 0.3))
    base = straight_gait(rng, seconds, rng.uniform(*_SPRINTS), _SPRINT_PACES, gentle_bend(rng))
    return Gesture(seconds, ("sprint",), lean, base=base)


def walk_backward(rng: random.Random) -> Gesture:
    draw = rng.random()
    if draw < _STEPS_BACK:
        return steps_back(rng)
    if draw > 1 - _RUNS_BACKWARD:
        seconds, speed = rng.uniform(1.5, 4.0), rng.uniform(1.8, 2.5)
        base = straight_gait(rng, seconds, speed, _WALK_PACES, gentle_bend(rng), backward=True, fits=is_quick_run)
        lean = _leaning(rng.uniform(-8, 2), 0.3)
        return Gesture(seconds, ("backward-run",), lean, base=base, untrue="walk|stroll|march|step|shuffle|stride|pace")
    pace = rng.choices(list(_BACKWARD), (1, 3, 1))[0]
    style = rng.choices(("", "glance", "hands"), (6, 2, 2))[0]
    seconds, stoop = rng.uniform(2.0, 8.0), rng.uniform(-3, 5)
    side = rng.choice(SIDES) if style == "glance" else ""
    look = rng.uniform(25, 45) * (1 if side == LEFT else -1)
    at, lasts = rng.uniform(0.1, 0.5), rng.uniform(0.8, 2.0)
    points = [np.array([rng.uniform(*_HANDS_UP[name]) for name in ("out", "up", "ahead")]) for _ in SIDES]
    pole = (rng.uniform(0.4, 1.0), -1.0, -0.2)

    def change(body: StandingBody) -> None:
        whole = np.ones(len(body.joints))
        body.lean(stoop * whole, "left")
        if style == "glance":
            times = np.arange(len(whole)) / FPS - at * len(whole) / FPS
            body.lean(look * np.exp(-((times / lasts) ** 4)), "up", (6, 9, 12))
        if style == "hands":
            body.steady(0.6)
            for one, point in zip(SIDES, points, strict=True):
                body.hold(one, whole, point, pole=pole)

    speed = rng.uniform(*_BACKWARD[pace])
    base = straight_gait(rng, seconds, speed, _WALK_PACES, gentle_bend(rng), backward=True, fits=is_plain_walk)
    kinds = ["backward", *([f"backward-{pace}"] if pace else []), *([f"backward-{style}"] if style else [])]
    return Gesture(seconds, tuple(kinds), change, side, base=base, untrue="run|jog")


def turn(rng: random.Random) -> Gesture:
    side, running = rng.choice(SIDES), rng.random() < 0.75
    form, limits = rng.choice(
        (("corner", (70, 110)), ("corner", (50, 110)), ("arc", (55, 140)), ("half", (155, 190)), ("half", (150, 185)))
    )
    degrees = rng.uniform(*limits) * (1 if side == LEFT else -1)
    width = rng.uniform(*(_RUN_CORNERS if running else _CORNERS)) * abs(degrees) / 90
    seconds = rng.uniform(2.0, 4.5) if running else rng.uniform(3.0, 8.0)
    speed = rng.uniform(2.1, 3.2) if running else rng.uniform(0.75, 1.5)
    middle = rng.uniform(0.35, 0.65)

    def bend(metres: float) -> Bending:
        half = 0.5 if form == "arc" else min(0.5 * width / metres, 0.5)
        centre = min(max(middle, half), 1 - half)
        return Bending(degrees, centre - half, centre + half, 0.35 if running else 0.2)

    gait = "run" if running else "walk"
    kinds = ("turn", f"turn-{gait}", *(() if form == "corner" and abs(degrees) < 70 else (f"turn-{form}",)))
    base = straight_gait(
        rng, seconds, speed, _RUN_PACES if running else _WALK_PACES, bend, turns=_TURNS, fits=_fits(running)
    )
    untrue = ("walk" if running else "run|jog") + ("|circle" if form != "half" else "|in a circle|corner")
    return Gesture(seconds, kinds, _leaning(rng.uniform(-2, 3), 0.0), side, base=base, untrue=untrue)


def bent_walk(rng: random.Random) -> Gesture:
    seconds, side = rng.uniform(2.5, 8.0), rng.choice(SIDES)
    degrees = rng.uniform(15, 30) * (1 if side == LEFT else -1)
    base = straight_gait(rng, seconds, rng.uniform(0.55, 1.7), _WALK_PACES, lambda metres: Bending(degrees))
    return Gesture(seconds, ("walk-bent",), _leaning(rng.uniform(-3, 4), rng.uniform(0, 0.4)), side, base=base)


def gentle_bend(rng: random.Random) -> ChooseBending:
    """Straight in half of all clips, a slight bend in the others."""
    degrees = rng.uniform(-_GENTLE, _GENTLE) if rng.random() < 0.5 else 0.0
    curve = Bending(degrees) if degrees else STRAIGHT
    return lambda metres: curve


def _leaning(stoop: float, steady: float) -> Callable[[StandingBody], None]:
    def change(body: StandingBody) -> None:
        body.lean(np.full(len(body.joints), stoop), "left")
        body.steady(steady)

    return change


def _fits(running: bool) -> Callable[[Part], bool]:
    return lambda part: (part.content == "run") == running


def straight_gait(
    rng: random.Random,
    seconds: float,
    wanted: float,
    paces: tuple[float, float],
    bend: ChooseBending,
    *,
    turns: tuple[float, float] = _STRAIGHT,
    backward: bool = False,
    fits: Callable[[Part], bool] = lambda part: True,
) -> Callable[[Part], Array | None]:
    """Make what lays a straight gait onto a curve.

    Args:
        rng: draws the share of the change of speed that is one of pace; the stride takes the rest.
        seconds: of the clip.
        wanted: m/s.
        paces: least and largest pace relative to the captured one.
        bend: the curve.
        turns: least and largest degrees between the directions faced in the first and the last frame.
        backward: play it backward in time; walks backward are much like that.
        fits: True for captured clips that may be used.
    """
    pace = rng.uniform(*paces)

    def base(part: Part) -> Array | None:
        if not fits(part):
            return None
        stride = wanted / (speed_of(part.joints) * pace)
        if not _STRIDES[0] < stride < _STRIDES[1]:
            return None
        frames = min(round(seconds * FPS * pace), LIMIT)
        looped = (part.joints[:frames].astype(np.float64),) if len(part.joints) >= frames else loop(part, frames)
        if looped is None:
            return None
        joints = with_bones(resample_points(looped[0], FPS * pace, FPS))[:LIMIT]
        joints = joints[::-1] if backward else joints
        metres = stride * float(np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]]))
        laid = relaid(joints, stride=stride, curve=bend(metres))
        facing = heading(laid, FPS)
        return laid if turns[0] <= abs(facing[-1] - facing[0]) <= turns[1] else None

    return base
