"""Rules of standing, locomotion and turning."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from marey.referee.body import HIPS, MOST, SIDES, SLOW_S, Body, Floats, Mask, runs, swings
from marey.referee.rules import rule

MOVING = 0.3
"""Speed of the hips above which the body travels, m/s."""
FOOT_MOVES = 0.7
"""Speed of a foot that does not stand, m/s."""
PASSAGE_S = 2.5
"""Time for which hands and hips move without a break in a passage of movements, such as a dance."""
OFF_FLOOR = 0.05
"""Height over which a foot is off the floor, m."""


@dataclass(frozen=True)
class Gait:
    """The longest stretch in which a body steps, and how it goes there."""

    begin: int
    end: int
    steps: int
    forward: float
    """Mean speed the way the body faces, m/s; negative backward."""
    sideways: float
    """Mean speed to the left, m/s."""
    speed: float
    distance: float
    """Length of the path, m."""
    turn: float
    """Degrees by which the body turns, positive to the left."""
    course: float
    """Degrees by which the direction of travel turns."""
    flight: float
    """Share of the time with both feet off the floor."""
    cadence: float
    """Steps a second."""


@lru_cache(maxsize=8)
def gait(body: Body) -> Gait:
    """Measure how a body goes: the stretch in which its hips travel, or in which it steps in place."""
    velocity = body.velocity("pelvis", SLOW_S) * [1.0, 0.0, 1.0]
    speed = np.linalg.norm(velocity, axis=-1)
    stretches = [(b, e) for b, e in runs(_bridged(speed > MOVING, body.frames(0.3)))]
    begin, end = max(stretches, key=lambda run: run[1] - run[0], default=(0, 0))
    if (end - begin) / body.fps < 0.5:
        begin, end = 0, len(body)
    inner = slice(begin, end)
    steps = _steps(body, begin, end)
    seconds = (end - begin) / body.fps
    forward = (velocity * body.forward).sum(-1)[inner]
    sideways = (velocity * body.left).sum(-1)[inner]
    path = body.smooth(body.at("pelvis"), SLOW_S)[inner] * [1.0, 0.0, 1.0]
    yaw = body.smooth(body.yaw, SLOW_S)[inner]
    # Captured floors tilt by some centimetres: a foot that stands does not move, however high it seems to be.
    moves = np.minimum(body.speed("L_foot"), body.speed("R_foot")) > FOOT_MOVES
    airborne = (body.lift("L") > OFF_FLOOR) & (body.lift("R") > OFF_FLOOR) & moves
    return Gait(
        begin=begin,
        end=end,
        steps=steps,
        forward=float(forward.mean()),
        sideways=float(sideways.mean()),
        speed=float(speed[inner].mean()),
        distance=float(np.linalg.norm(np.diff(path, axis=0), axis=-1).sum()),
        turn=_turn(yaw, travels=end - begin < len(body) or float(speed.mean()) > MOVING),
        course=_course(velocity[inner]),
        flight=float(airborne[inner].mean()),
        cadence=steps / seconds,
    )


def _turn(yaw: Floats, *, travels: bool) -> float:
    """Return degrees turned; of a gait in place by the trend, since its hips swing to and fro with every step."""
    if travels:
        return float(yaw[-1] - yaw[0])
    return float(np.polyfit(np.arange(len(yaw)), yaw, 1)[0] * (len(yaw) - 1))


def _bridged(mask: Mask, gap: int) -> Mask:
    """Close breaks shorter than `gap` frames."""
    closed = mask.copy()
    for begin, end in runs(~mask):
        if begin > 0 and end < len(mask) and end - begin < gap:
            closed[begin:end] = True
    return closed


def _steps(body: Body, begin: int, end: int) -> int:
    """Count how often one foot is lifted past the other."""
    apart = body.smooth(body.lift("L") - body.lift("R"), 0.1)[begin:end]
    along = (body.at("L_ankle") - body.at("R_ankle"))[begin:end]
    velocity = (body.velocity("pelvis", SLOW_S) * [1.0, 0.0, 1.0])[begin:end]
    speed = np.linalg.norm(velocity, axis=-1, keepdims=True)
    # Slow steps are low, and a loop of one cycle holds no second lift of its first foot.
    low = speed.mean() > MOVING or end - begin < 1.2 * body.fps
    lifted = len(swings(apart, 0.03 if low else 0.05))
    heading = np.where(speed > MOVING, velocity / np.maximum(speed, 1e-6), body.forward[begin:end])
    passed = len(swings(body.smooth((along * heading).sum(-1), 0.1), 0.15))
    return min(lifted, max(passed, 0)) if passed >= 2 else lifted


def _course(velocity: Floats) -> float:
    moving = np.linalg.norm(velocity, axis=-1) > MOVING
    if moving.sum() < 3:
        return 0.0
    angle = np.unwrap(np.arctan2(velocity[moving, 0], velocity[moving, 2]))
    return float(np.rad2deg(angle[-1] - angle[0]))


def passage(body: Body) -> bool:
    """Return True if the whole body moves on and on, as in a dance or a form of karate, and shows no single gesture."""
    hands = np.max([np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) for side in SIDES], axis=0)
    hips = np.linalg.norm(body.velocity("pelvis", SLOW_S) * [1.0, 0.0, 1.0], axis=-1)
    moving = (body.smooth(hands, SLOW_S) > 0.45) & (hips > 0.15)
    return body.longest(_bridged(moving, body.frames(0.3))) >= PASSAGE_S


def planted(body: Body, height: float = 0.35) -> bool:
    """Return True if no foot is lifted so high; 0.35 m is the shin, over which kicks and high steps go."""
    return max(float(body.lift(side).max()) for side in SIDES) < height


def steady_gait(body: Body) -> bool:
    """Return True if a walk or run ahead, straight or in a curve, fills the clip."""
    found = gait(body)
    goes = found.steps >= 4 and found.distance > 1.5 and found.forward > 0.5
    return goes and (found.end - found.begin) > 0.7 * len(body)


def travel(body: Body) -> float:
    """Largest horizontal distance of the hips from where they began, m."""
    path = body.at("pelvis")[:, [0, 2]]
    return float(np.linalg.norm(path - path[0], axis=-1).max())


def _ahead(gait_: Gait) -> bool:
    return gait_.forward > 0.2 and gait_.forward > 1.4 * abs(gait_.sideways)


def _in_place(body: Body, gait_: Gait) -> bool:
    """Return True if the body steps without getting anywhere; one cycle of a loop has two steps."""
    return travel(body) < 0.5 and gait_.steps >= 2 and abs(gait_.turn) < 45


@rule("idle")
def idle(body: Body) -> bool:
    hands = np.maximum(body.speed("L_wrist"), body.speed("R_wrist"))
    low = np.maximum(
        body.height("L_wrist") - body.height("L_shoulder"), body.height("R_wrist") - body.height("R_shoulder")
    )
    calm = (hands < 0.5) & (low < 0) & (body.height("pelvis") > 0.78 * HIPS) & (body.lean < 30)
    feet = max(spread(body, f"{side}_foot") for side in SIDES)
    upright = float(np.ptp(body.smooth(body.tip, 0.2))) < 15
    path = body.at("pelvis")[:, [0, 2]]
    stays = float(np.linalg.norm(path - path.mean(0), axis=-1).max()) < 0.15
    return upright and stays and calm.mean() >= 0.6 and feet < 0.15


def spread(body: Body, joint: str) -> float:
    """Horizontal extent of the middle 90 % of a joint's positions, m."""
    low, high = np.percentile(body.at(joint)[:, [0, 2]], [5, 95], axis=0)
    return float(np.linalg.norm(high - low))


@rule("walk")
def walk(body: Body) -> bool:
    found = gait(body)
    part = slice(found.begin, found.end)
    upright = body.height("pelvis")[part].mean() > 0.6 * HIPS and float(np.median(body.lean[part])) < 45
    if not upright or abs(found.turn) >= 45 or found.flight > 0.15:
        return False
    ahead = _ahead(found) and found.steps >= _least_steps(body, found) and 0.4 <= found.forward <= 2.2
    return ahead or (_in_place(body, found) and 0.8 <= found.cadence < 3.2 and _treads(body))


def _least_steps(body: Body, found: Gait) -> int:
    """Return how many steps a walk has at least; a loop of one cycle holds two."""
    return 2 if (found.end - found.begin) / body.fps < 2.5 else 3


def _treads(body: Body) -> bool:
    """Return True if both feet are lifted as in walking: alike, and not as high as a knee."""
    lifts = [float(np.percentile(body.lift(side), 95)) for side in SIDES]
    return min(lifts) > 0.05 and max(lifts) < 0.4 and min(lifts) > 0.4 * max(lifts)


@rule("walk-backward")
def walk_backward(body: Body) -> bool:
    found = gait(body)
    back = -found.forward > 0.15 and -found.forward > 1.4 * abs(found.sideways)
    return back and abs(found.turn) < 60 and (found.steps >= 3 or found.distance >= 0.6)


@rule("run")
def run(body: Body) -> bool:
    found = gait(body)
    if found.steps < 2 or abs(found.turn) >= 45 or found.flight < 0.05:
        return False
    ahead = body.smooth((body.velocity("pelvis", SLOW_S) * body.forward).sum(-1), SLOW_S)
    fast = _ahead(found) and float(ahead[found.begin : found.end].max()) >= 1.8
    return fast or (_in_place(body, found) and found.cadence >= 2.0)


@rule("sprint")
def sprint(body: Body) -> bool:
    found = gait(body)
    if found.steps < 2:
        return False
    if travel(body) >= 0.5:
        fast = body.smooth((body.velocity("pelvis", SLOW_S) * body.forward).sum(-1), SLOW_S)
        return bool(_ahead(found) and fast.max() >= 4.0 and found.flight >= 0.05)
    knees = max(float(np.percentile(body.height(f"{side}_knee"), 95)) for side in SIDES)
    elbows = min(float(np.median(body.bend(side, "elbow"))) for side in SIDES)
    return found.cadence >= 2.75 and knees > 0.6 and elbows > 45


@rule("turn")
def turn(body: Body) -> bool:
    found = gait(body)
    going = found.forward > 0.2 and found.distance >= 0.55 and found.steps >= 1
    if travel(body) < 0.5 and found.steps >= 3:
        going = travel(body) >= 0.3
    return going and 45 - 6 <= abs(found.turn) <= 200 + 15


def _turned_in_place(body: Body) -> tuple[float, float]:
    """Return the largest turn, degrees, within which the hips stay in 0.4 m, and its fastest rate, degrees a second."""
    yaw, path = body.smooth(body.yaw, 0.2), body.at("pelvis")[:, [0, 2]]
    best, rate = 0.0, 0.0
    stride = max(1, body.frames(0.1))
    frames = list(range(0, len(body), stride))
    for begin in frames:
        away = np.linalg.norm(path[begin:] - path[begin], axis=-1)
        outside = np.flatnonzero(away > 0.4)
        end = begin + (int(outside[0]) if len(outside) else len(away))
        if end - begin < 2:
            continue
        change = np.abs(yaw[begin:end] - yaw[begin])
        last = int(np.argmax(change))
        if change[last] > best:
            best = float(change[last])
            rate = best / max(last / body.fps, 1e-6)
    return best, rate


def _upright(body: Body) -> bool:
    return body.most((body.height("pelvis") > 0.6 * HIPS) & (body.lean < 60))


@rule("turn-around")
def turn_around(body: Body) -> bool:
    angle, _ = _turned_in_place(body)
    kept = abs(float(body.smooth(body.yaw, 0.3)[-1] - body.yaw[0]))
    return _upright(body) and angle >= 70 and (kept >= 60 or angle >= 300) and (kept <= 285 or angle >= 300)


@rule("spin")
def spin(body: Body) -> bool:
    yaw = body.smooth(body.yaw, 0.15)
    fast = np.abs(np.gradient(yaw)) * body.fps >= 60
    for begin, end in runs(_bridged(fast, body.frames(0.25))):
        path = body.at("pelvis")[begin:end, :][:, [0, 2]]
        near = float(np.linalg.norm(path - path[0], axis=-1).max()) < 1.3
        seconds = (end - begin) / body.fps
        angle = abs(float(yaw[end - 1] - yaw[begin]))
        if near and angle >= 300 and angle / seconds >= 120:
            return _upright(body)
    return False


def _floor_velocity(body: Body) -> Floats:
    """(3,) mean velocity of a gait in place against the floor, m/s: its standing foot goes the other way."""
    way = np.zeros((0, 3))
    for side in SIDES:
        stands = body.lift(side) < OFF_FLOOR
        way = np.concatenate([way, (body.velocity("pelvis") - body.velocity(f"{side}_ankle"))[stands]])
    return way.mean(axis=0) if len(way) else np.zeros(3)


@rule("sidestep")
def sidestep(body: Body) -> bool:
    """Steps across the way that the chest faces; hips and legs may turn the way of the steps."""
    ahead_way = body.chest_forward
    left_way = np.stack([ahead_way[:, 2], np.zeros(len(body)), -ahead_way[:, 0]], axis=-1)
    velocity = body.velocity("pelvis", SLOW_S)
    found = gait(body)
    if travel(body) < 0.1 and found.steps >= 2:
        velocity = np.tile(_floor_velocity(body), (len(body), 1))
    across = np.cumsum((velocity * left_way).sum(-1)) / body.fps
    ahead = np.cumsum((velocity * ahead_way).sum(-1)) / body.fps
    for begin, end in swings(across, 0.4):
        side = abs(across[end] - across[begin])
        if side >= 0.5 and abs(ahead[end] - ahead[begin]) < side and _upright(body):
            return _steps(body, begin, end + 1) >= 2 or found.steps >= 2
    return False


@rule("sneak")
def sneak(body: Body) -> bool:
    found = gait(body)
    part = slice(found.begin, found.end)
    drop = 1 - float(np.median(body.height("pelvis")[part])) / HIPS
    careful = 0.05 <= drop <= 0.45 or float(np.median(body.tip[part])) >= 20
    toes = float(np.median(np.minimum(body.height("L_ankle"), body.height("R_ankle"))[part])) > 0.11
    goes = (_ahead(found) and found.forward <= 1.2) or _in_place(body, found)
    fills = found.end - found.begin >= MOST * len(body)
    hands = [np.percentile(np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1), 75) for side in SIDES]
    softly = planted(body) and found.cadence <= 2.0 and max(hands) < 1.2
    return goes and fills and softly and found.steps >= 2 and found.flight < 0.15 and (careful or toes)


@rule("crouch")
def crouch(body: Body) -> bool:
    """Low for 0.4 s at least; on bent knees, the ways down and up counted, for about half of the clip."""
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist")) > 0.08
    feet = (body.lift("L") < 0.12) & (body.lift("R") < 0.12)
    bent = np.minimum(body.bend("L", "knee"), body.bend("R", "knee")) > 45
    knees = np.maximum(body.height("L_knee"), body.height("R_knee")) > 0.12
    # Who sits has both feet ahead of the hips all the time.
    over = np.minimum(body.own("L_ankle")[:, 2], body.own("R_ankle")[:, 2]) < 0.12
    down = hands & feet & bent & knees & (body.height("pelvis") < 0.9 * HIPS)
    low = down & (body.height("pelvis") <= 0.75 * HIPS)
    return body.longest(low) >= 0.4 and bool((low & over).any()) and float(down.mean()) >= 0.42


@rule("crawl")
def crawl(body: Body) -> bool:
    shoulders = (body.height("L_shoulder") + body.height("R_shoulder")) / 2
    low = (body.height("pelvis") < 0.6 * HIPS) & (shoulders < 0.6 * 1.42) & (np.abs(body.tip) > 45)
    prone = body.own("head", "pelvis")[:, 1] < 0.5
    moving = np.max(
        [body.smooth(body.speed(joint), 0.5) for joint in ("L_wrist", "R_wrist", "L_knee", "R_knee")], axis=0
    )
    return body.most(low & prone & (moving > 0.12))


@rule("carry")
def carry(body: Body) -> bool:
    found = gait(body)
    part = slice(found.begin, found.end)
    walks = (
        found.steps >= _least_steps(body, found) and found.flight <= 0.15 and (_ahead(found) or _in_place(body, found))
    )
    for side in SIDES:
        hand = body.own(f"{side}_wrist")[part]
        held = np.linalg.norm(body.own_velocity(f"{side}_wrist")[part], axis=-1) < 0.35
        before = (hand[:, 1] > -0.05) & (hand[:, 2] > 0.05)
        shoulder = hand[:, 1] > 0.4
        if walks and (held & (before | shoulder)).mean() >= 0.6:
            return True
    return False
