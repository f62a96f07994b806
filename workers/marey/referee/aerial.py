"""Rules of jumps, climbing, balance and acrobatics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from marey.referee.body import HIPS, SIDES, Body, Floats, runs, swings
from marey.referee.gaits import OFF_FLOOR, travel
from marey.referee.rules import rule

OTHER = {"L": "R", "R": "L"}


@dataclass(frozen=True)
class AirborneTime:
    """A time with both feet off the floor."""

    begin: int
    end: int
    height: float
    """Largest height of the lower foot, m."""
    distance: float
    """Horizontal way of the hips, m."""
    turn: float
    """Degrees turned, absolute."""
    last: str
    """The foot that left the floor last, or `both`."""
    first: str
    """The foot that landed first, or `both`."""


def flights(body: Body) -> Iterator[AirborneTime]:
    """Yield the times with both feet off the floor that begin and end upright on it."""
    for begin, end in runs(body.lowest_foot > OFF_FLOOR):
        if begin == 0 or end >= len(body) or end - begin < max(2, round(0.08 * body.fps)):
            continue
        wide = slice(max(0, begin - body.frames(0.25)), min(len(body), end + body.frames(0.25)))
        path = body.at("pelvis")[:, [0, 2]]
        yaw = body.yaw[wide]
        yield AirborneTime(
            begin=begin,
            end=end,
            height=float(body.lowest_foot[begin:end].max()),
            distance=float(np.linalg.norm(path[end] - path[begin - 1])),
            turn=float(np.ptp(yaw)),
            last=_foot(body, begin, -1),
            first=_foot(body, end - 1, 1),
        )


def _foot(body: Body, edge: int, direction: int) -> str:
    """Name the foot that carries the body just outside a flight; `both` if they leave or land within 0.1 s."""
    near = edge + direction
    far = min(max(edge + direction * body.frames(0.1), 0), len(body) - 1)
    low, high = min(near, far), max(near, far) + 1
    down = [side for side in SIDES if (body.lift(side)[max(low, 0) : high] <= OFF_FLOOR).any()]
    return "both" if len(down) != 1 else down[0]


def _upright(body: Body, flight: AirborneTime) -> bool:
    low, high = max(flight.begin - 1, 0), min(flight.end, len(body) - 1)
    return body.height("pelvis")[[low, high]].min() > 0.45 * HIPS and body.lean[flight.begin : flight.end].max() < 80


@rule("jump")
def jump(body: Body) -> bool:
    return any(
        _upright(body, each) and each.height >= 0.1 and each.distance < 0.6 and "both" in (each.last, each.first)
        for each in flights(body)
    )


@rule("jump-forward")
def jump_forward(body: Body) -> bool:
    for each in flights(body):
        wide = (max(0, each.begin - 1), min(each.end, len(body) - 1))
        way = body.at("pelvis")[wide[1]] - body.at("pelvis")[wide[0]]
        ahead = float(way @ body.forward[wide[0]])
        feet = [
            float((body.at(f"{s}_foot")[wide[1]] - body.at(f"{s}_foot")[wide[0]]) @ body.forward[wide[0]])
            for s in SIDES
        ]
        if _upright(body, each) and each.last == "both" and (ahead >= 0.6 or min(feet) >= 0.6):
            return True
    return False


@rule("leap")
def leap(body: Body) -> bool:
    for each in flights(body):
        seconds = (each.end - each.begin) / body.fps
        apart = np.linalg.norm((body.at("L_ankle") - body.at("R_ankle"))[each.begin : each.end], axis=-1).max()
        switched = each.last != each.first or "both" in (each.last, each.first)
        one_foot = each.last in SIDES
        far = each.distance >= 0.8 or travel(body) < 0.5  # the second is a jump of a run in place
        if seconds >= 0.2 and one_foot and switched and far and apart > 0.45 and each.height > 0.06:
            return True
    return False


@rule("hop")
def hop(body: Body) -> bool:
    for each in flights(body):
        if each.last in SIDES and each.first == each.last:
            other = body.lift(OTHER[each.last])
            wide = slice(max(0, each.begin - body.frames(0.1)), each.end + body.frames(0.1))
            if other[wide].min() > OFF_FLOOR and each.distance < 1.0:
                return True
    return False


@rule("jump-turn")
def jump_turn(body: Body) -> bool:
    return any(
        _upright(body, each) and each.turn >= 90 and each.height > 0.06 and each.last == "both"
        for each in flights(body)
    )


@rule("jumping-jacks")
def jumping_jacks(body: Body) -> bool:
    apart = body.smooth(np.abs(body.own("L_ankle", "R_ankle")[:, 0]), 0.1)
    hands = [body.height(f"{side}_wrist") - body.height(f"{side}_shoulder") for side in SIDES]
    arms = [len([1 for a, b in swings(hand, 0.5) if hand[b] > 0.05 and hand[b] > hand[a]]) for hand in hands]
    return len(swings(apart, 0.3)) >= 2 and min(arms) >= 1


def _stairs(body: Body) -> list[float]:
    """Return the heights on which each foot stands in turn."""
    heights: list[tuple[int, float]] = []
    for side in SIDES:
        still = body.speed(f"{side}_foot") < 0.25
        for begin, end in runs(still):
            if (end - begin) / body.fps >= 0.1:
                heights.append((begin, float(np.median(body.lift(side)[begin:end]))))
    return [height for _, height in sorted(heights)]


@rule("climb-stairs")
def climb_stairs(body: Body) -> bool:
    steps = np.diff(_stairs(body))
    hips = body.smooth(body.height("pelvis"), 0.3)
    rise = float(hips[-1] - hips[0])
    up = int((steps * np.sign(rise) >= 0.1).sum()) if rise else 0
    return abs(rise) >= 0.25 and up >= 2 and travel(body) > 0.3 and body.most(body.lean < 60)


@rule("climb-ladder")
def climb_ladder(body: Body) -> bool:
    over = [body.height(f"{s}_wrist") > body.height(f"{s}_shoulder") - 0.25 for s in SIDES]
    hips = body.smooth(body.height("pelvis"), 0.3)
    moves = sum(len(swings(body.own(f"{s}_wrist")[:, 1], 0.12)) for s in SIDES)
    climbs = abs(float(hips[-1] - hips[0])) >= 0.3
    feet = min(float(np.ptp(body.height(f"{s}_ankle"))) for s in SIDES) >= 0.3
    high = max(float(np.percentile(body.height(f"{s}_wrist") - body.height(f"{s}_shoulder"), 80)) for s in SIDES)
    in_place = min(len(swings(body.own(f"{s}_ankle")[:, 1], 0.12)) for s in SIDES) >= 2 and high > 0.1
    flat = float(np.linalg.norm(np.ptp(body.at("pelvis")[:, [0, 2]], axis=0))) < 1.0
    return body.most(over[0] | over[1], 0.5) and ((climbs and feet) or in_place) and moves >= 2 and flat


@rule("climb-onto")
def climb_onto(body: Body) -> bool:
    ends = body.frames(0.3)
    feet = np.maximum(body.lift("L"), body.lift("R"))
    raised = float(np.median(body.lowest_foot[-ends:]) - np.median(body.lowest_foot[:ends])) >= 0.4
    over = bool((body.smooth(body.lowest_foot, 0.2) >= 0.4).any()) and travel(body) >= 0.6
    high = bool((feet > 0.4).any())
    hips = body.smooth(body.height("pelvis"), 0.2)
    slow = body.longest(body.lowest_foot > 0.25) > 0.5
    return high and float(hips.max()) >= HIPS + 0.25 and (raised or (over and slow))


@rule("hang")
def hang(body: Body) -> bool:
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist")) > body.height("head") - 0.02
    slow = np.minimum(body.speed("L_wrist"), body.speed("R_wrist")) < 0.4
    straight = np.maximum(body.bend("L", "elbow"), body.bend("R", "elbow")) < 110
    return body.longest(hands & slow & straight & (body.lowest_foot > 0.08)) >= 1.0


@rule("swim")
def swim(body: Body) -> bool:
    floats = (body.lowest_foot > 0.05) | (np.abs(body.tip) > 45)
    arms = max(len(swings(body.own(f"{s}_wrist", "spine3")[:, axis], 0.25)) for s in SIDES for axis in range(3))
    legs = max(len(swings(body.own(f"{s}_ankle")[:, axis], 0.08)) for s in SIDES for axis in (1, 2))
    level = (np.abs(body.tip) > 20) & (np.abs(body.tip) < 130)
    return body.most(floats & level) and arms >= 2 and legs >= 2


@rule("balance")
def balance(body: Body) -> bool:
    best = 0.0
    for side in SIDES:
        stands = (body.lift(side) < 0.06) & (body.speed(f"{side}_ankle") < 0.35)
        best = max(best, body.longest(stands & (body.lift(OTHER[side]) >= 0.1)))
    return best >= 1.5


@rule("arabesque")
def arabesque(body: Body) -> bool:
    for side in SIDES:
        other = OTHER[side]
        behind = body.own(f"{other}_ankle")[:, 2] < -0.25
        pose = behind & (body.height(f"{other}_ankle") >= 0.4) & (body.bend(other, "knee") < 50)
        stands = (body.lift(side) < 0.15) & (body.height("pelvis") > 0.6 * HIPS)
        if body.longest(pose & stands) >= 0.15:
            return True
    return False


def _upside_down(body: Body) -> Floats:
    """Return how far the higher foot is over the head, m."""
    return np.maximum(body.height("L_ankle"), body.height("R_ankle")) - body.height("head")


def _about(body: Body, axis: int) -> float:
    """Return degrees through which the trunk turns over in the plane across an axis of the body where it began."""
    vector = body.at("neck") - body.at("pelvis")
    frame = np.stack([body.left[0], [0.0, 1.0, 0.0], body.forward[0]])
    local = vector @ frame.T
    plane = [other for other in range(3) if other != axis]
    clear = np.linalg.norm(local[:, plane], axis=-1) > 0.15
    angle = np.unwrap(np.arctan2(local[clear][:, plane[0]], local[clear][:, plane[1]]))
    return float(np.rad2deg(np.ptp(angle))) if len(angle) else 0.0


def _lands(body: Body) -> bool:
    last = slice(-body.frames(0.2), None)
    return bool(body.lowest_foot[last].min() < 0.12 and body.height("pelvis")[last].max() > 0.4 * HIPS)


@rule("cartwheel")
def cartwheel(body: Body) -> bool:
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist"))
    over = _upside_down(body) > 0.1
    if not (over & (hands < 0.3)).any() or not _lands(body):
        return False
    vector = body.at("neck") - body.at("pelvis")
    down = vector[:, 1] < 0.1
    first = int(np.argmax(down))
    sideways = np.abs((vector * body.left).sum(-1))[max(0, first - 3) : first + 3].max(initial=0.0)
    ahead = np.abs((vector * body.forward).sum(-1))[max(0, first - 3) : first + 3].max(initial=0.0)
    apart = np.linalg.norm((body.at("L_ankle") - body.at("R_ankle"))[over], axis=-1).max()
    return bool(sideways > 0.7 * ahead or apart > 0.6)


@rule("flip")
def flip(body: Body) -> bool:
    over = _upside_down(body) > 0.0
    turned = max(_about(body, 0), _about(body, 2))
    return bool(over.any()) and turned >= 290 and _lands(body)


@rule("roll")
def roll(body: Body) -> bool:
    back = np.minimum(body.height("spine3"), np.minimum(body.height("L_shoulder"), body.height("R_shoulder"))) < 0.4
    lower = body.height("head") < body.height("pelvis")
    feet = body.height("pelvis")[-body.frames(0.2) :].max() > 0.4 * HIPS
    turned = max(_about(body, 0), _about(body, 2)) >= 200
    return bool((back & lower).any()) and feet and turned and not (_upside_down(body) > 0.9).any()
