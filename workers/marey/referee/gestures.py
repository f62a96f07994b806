"""Rules of gestures, emotes and everyday actions."""

from __future__ import annotations

import numpy as np

from marey.referee.body import HEAD, HIPS, MOST, SIDES, Body, Floats, Mask, runs, swings
from marey.referee.gaits import passage, planted, spread, travel
from marey.referee.postures import seated_frames
from marey.referee.rules import rule

KNEES = 0.5
"""Height of the knees, m."""
SIGNS_S = 3.0
"""Shortest clip in which an arm goes to three places, to be held or swung there."""
WAVING_ELBOW = 0.46
"""Median speed of the elbow in a wave, as a share of that of the wrist; at most."""


def _stays(body: Body) -> bool:
    return travel(body) < 0.8


def is_gesturing(body: Body) -> bool:
    """Return True if the body stays near its place and neither kicks nor dances, so that a gesture is what it does."""
    return travel(body) < 1.2 and planted(body) and not passage(body)


def hand_place(body: Body, side: str) -> Floats:
    """Return the place of a hand in the body's own frame (T, 3), from the chest; metres."""
    return body.own(f"{side}_wrist", "spine3")


def _over_shoulder(body: Body, side: str) -> Floats:
    return body.height(f"{side}_wrist") - body.height(f"{side}_shoulder")


def _half_swings(body: Body, side: str, mask: Mask, size: float) -> int:
    """Count swings of a hand along the direction in which it swings most, while a condition holds."""
    best = 0
    for begin, end in runs(mask):
        part = body.smooth(hand_place(body, side), 0.06)[begin:end]
        if len(part) < 4:
            continue
        slow = body.smooth(part, 0.8)
        _, _, axes = np.linalg.svd(part - slow, full_matrices=False)
        best = max(best, len(swings((part - slow) @ axes[0], size)))
    return best


@rule("wave")
def wave(body: Body) -> bool:
    for side in SIDES:
        high = body.height(f"{side}_wrist") > body.height("spine3") - 0.05
        if not high.any() or not is_gesturing(body):
            continue
        # The forearm swings about the elbow; in blows and traffic signs the whole arm moves.
        elbow, wrist = (np.linalg.norm(body.own_velocity(f"{side}_{joint}"), axis=-1) for joint in ("elbow", "wrist"))
        forearm = np.median(elbow[high]) < WAVING_ELBOW * np.median(wrist[high])
        if forearm and _half_swings(body, side, high, 0.07) >= 3:
            return True
    return False


@rule("raise-arm")
def raise_arm(body: Body) -> bool:
    for side in SIDES:
        high = body.smooth(_over_shoulder(body, side), 0.1)
        calm = (np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 0.6) & (body.speed("pelvis") < 0.5)
        held = body.longest((high > 0.0) & calm) >= 0.25
        low = float(high.min()) < -0.25 or float(np.median(high)) > 0.1
        upright = float(np.percentile(body.height("pelvis"), 5)) > 0.8 * HIPS
        if held and low and upright and is_gesturing(body):
            return True
    return False


@rule("bow")
def bow(body: Body) -> bool:
    tip, head = body.smooth(body.tip, 0.1), body.smooth(body.height("head"), 0.1)
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist"))
    if not _stays(body) or not is_gesturing(body) or body.height("pelvis").min() < 0.6 * HIPS:
        return False
    struck = np.max([body.speed(f"{side}_wrist") for side in SIDES], axis=0) > 3.0
    for begin, end in swings(tip, 12.0):
        if tip[end] <= tip[begin]:
            continue
        up = tip[end:].min()
        tipped = tip[end] - tip[begin] >= 15 or tip[end] >= 18
        down = head[begin : end + 1].max() - head[end] >= 0.05
        rises = tip[end] - up >= 0.4 * (tip[end] - tip[begin])
        calm = not struck[begin : end + body.frames(0.3)].any()
        if tipped and down and rises and calm and body.height("pelvis")[end] > 0.7 * HIPS and hands[end] > 0.35:
            return True
    return False


def claps(body: Body) -> int:
    """Count how often the hands come together."""
    apart = body.hand_apart()
    return sum(bool(apart[end] < apart[begin] and apart[end] < 0.22) for begin, end in swings(apart, 0.05))


@rule("clap")
def clap(body: Body) -> bool:
    return claps(body) >= 3


@rule("cheer")
def cheer(body: Body) -> bool:
    """A hand thrown up over the head, or two pumps of a fist between chest and head, at 1 m/s and more."""
    if travel(body) > 1.2 or passage(body):
        return False
    for side in SIDES:
        up = body.own_velocity(f"{side}_wrist")[:, 1]
        over = body.height(f"{side}_wrist") > body.height("head") + 0.05
        before = (hand_place(body, side)[:, 2] > 0.1) & (hand_place(body, side)[:, 1] > -0.1)
        pumps = 0
        for begin, end in runs(up > 0.4):
            later = slice(begin, min(len(body), end + body.frames(0.3)))
            if up[begin:end].max() < 0.9:
                continue
            if over[later].any():
                return True
            pumps += bool(before[later].any() and body.bend(side, "elbow")[later].max() > 60)
        if pumps >= 2:
            return True
    return False


@rule("laugh")
def laugh(body: Body) -> bool:
    rocks = len(swings(body.smooth(body.tip, 0.15), 8.0))
    shoulders = (body.own("L_shoulder")[:, 1] + body.own("R_shoulder")[:, 1]) / 2
    shakes = shoulders - body.smooth(shoulders, 0.4)
    return (
        _stays(body)
        and planted(body)
        and body.most(body.height("pelvis") > 0.4 * HIPS)
        and float(np.ptp(body.smooth(body.height("pelvis"), 0.2))) < 0.25
        and rocks >= 2
        and len(swings(shakes, 0.006)) >= 4
    )


def _head_tip(body: Body) -> Floats:
    """Angle of the head before the trunk, degrees."""
    vector = body.own("head", "neck")
    return np.rad2deg(np.arctan2(vector[:, 2], vector[:, 1])) - body.tip


@rule("nod")
def nod(body: Body) -> bool:
    tips = swings(body.smooth(_head_tip(body), 0.1), 8.0)
    return len(tips) >= 3 and float(np.ptp(body.smooth(body.tip, 0.2))) < 20 and travel(body) < 0.4


def _signs(body: Body) -> int:
    """Count the places away from the trunk at which an arm is held or turns back."""
    found = 0
    for side in SIDES:
        hand = hand_place(body, side)
        away = (np.linalg.norm(hand, axis=-1) > 0.35) & (hand[:, 1] > -0.35)
        calm = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 0.7
        places: list[Floats] = []
        for begin, end in runs(away & calm):
            middle = hand[begin:end].mean(axis=0)
            if end - begin >= body.frames(0.1) and (not places or np.linalg.norm(middle - places[-1]) > 0.2):
                places.append(middle)
        found += len(places)
    return found


@rule("signal")
def signal(body: Body) -> bool:
    """Stands nearly all the time, at its place, and makes three signs, which take three seconds."""
    stands = is_gesturing(body) and _stays(body) and body.most(body.standing, 0.9)
    return stands and len(body) / body.fps >= SIGNS_S and _signs(body) >= 3


@rule("guide")
def guide(body: Body) -> bool:
    """One arm rises from beside the body, nearly straight, and stays; the other hangs."""
    for side, other in (("L", "R"), ("R", "L")):
        hand = body.own(f"{side}_wrist")
        level = (body.height(f"{side}_wrist") > 0.85 * HIPS) & (body.height(f"{side}_wrist") < HEAD + 0.05)
        out = (np.linalg.norm(hand[:, [0, 2]], axis=-1) >= 0.42) & (body.bend(side, "elbow") < 75)
        calm = body.smooth(np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1), 0.2) < 0.5
        hangs = body.own(f"{other}_wrist")[:, 1] < 0.1
        if (
            is_gesturing(body)
            and body.longest(level & out & calm & hangs & body.standing) >= 0.5
            and not (level & out).all()
        ):
            return True
    return False


@rule("shiver")
def shiver(body: Body) -> bool:
    """Hands held close before the body; a joint shakes by 4 mm and more at 4 Hz, for most of the clip."""
    close = (body.hand_apart() < 0.45) & (body.height("pelvis") > 0.6 * HIPS)
    for side in SIDES:
        close &= body.own(f"{side}_wrist")[:, 1] > -0.1
    if not (_stays(body) and planted(body) and body.most(close)):
        return False
    least = MOST * (body.core.stop - body.core.start)
    for joint in ("L_wrist", "R_wrist", "L_shoulder", "R_shoulder", "L_knee", "R_knee"):
        place = body.own(joint)
        fine = place - body.smooth(place, 0.3)
        _, _, axes = np.linalg.svd(fine, full_matrices=False)
        along = fine @ axes[0]
        shakes = swings(along, 0.004)
        time = shakes[-1][1] - shakes[0][0] if shakes else 0
        if time >= least and len(shakes) / 2 >= 4.0 * time / body.fps and float(np.ptp(along)) < 0.06:
            return True
    return False


@rule("talk")
def talk(body: Body) -> bool:
    """Hands move in small gestures between waist and shoulders, no higher; feet and hips stay."""
    gestures, speed = np.zeros(len(body), np.bool_), np.zeros(len(body))
    for side in SIDES:
        hand = body.own(f"{side}_wrist")
        over = body.height(f"{side}_wrist") - body.height(f"{side}_shoulder")
        moves = body.smooth(np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1), 0.1)
        gesturing = (hand[:, 1] > 0.05) & (over < 0.1) & (hand[:, 2] > 0.05) & (moves >= 0.2)
        if (over > 0.05).mean() > 0.05 or (gesturing.any() and _extent(hand[gesturing]) > 0.45):
            return False
        gestures |= gesturing
        speed = np.maximum(speed, moves)
    small = float(np.percentile(speed, 90)) < 1.5
    level = float(np.ptp(body.smooth(body.height("pelvis"), 0.2))) < 0.12
    feet = planted(body, 0.1) and max(spread(body, f"{side}_foot") for side in SIDES) < 0.15
    return travel(body) < 0.4 and level and feet and small and body.share(gestures) >= 1 / 3


def _extent(places: Floats) -> float:
    """Largest extent of the middle 80 % of places (T, 3) along an axis, m."""
    low, high = np.percentile(places, [10, 90], axis=0)
    return float((high - low).max())


# -- everyday ---------------------------------------------------------------------------------------------------------


@rule("drink")
def drink(body: Body) -> bool:
    for side in SIDES:
        hand = body.own(f"{side}_wrist", "head")
        near = (np.linalg.norm(hand, axis=-1) < 0.27) & (hand[:, 2] > 0.0)
        away = np.linalg.norm(hand, axis=-1) > 0.35
        if body.longest(near) >= 0.5 and away.any():
            return True
    return False


@rule("wash")
def wash(body: Body) -> bool:
    for side in SIDES:
        hand = body.smooth(hand_place(body, side), 0.06)
        if _half_swings(body, side, np.ones(len(body), np.bool_), 0.1) < 5:
            continue
        if _extent(hand) <= 0.7 and is_gesturing(body):
            return True
    return False


@rule("pick-up")
def pick_up(body: Body) -> bool:
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist"))
    lowest = int(np.argmin(hands))
    bent = body.tip[lowest] > 25 or max(body.bend(side, "knee")[lowest] for side in SIDES) > 45
    before, after = body.height("head")[: lowest + 1].max(), body.height("head")[lowest:].max()
    on_feet = body.lowest_foot[lowest] < 0.12 and body.height("pelvis")[lowest] > 0.2
    return bool(hands[lowest] <= KNEES and bent and on_feet and min(before, after) > 0.8 * HEAD)


@rule("reach-up")
def reach_up(body: Body) -> bool:
    for side in SIDES:
        over = body.height(f"{side}_wrist") - body.height("head")
        peak = float(over.max())
        slow = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 1.0
        held = body.longest((over > max(0.17, peak - 0.15)) & slow) >= 0.25
        upright = body.height("pelvis").min() > 0.7 * HIPS
        if not passage(body) and held and upright and (over.min() < 0.1 or over[-1] < peak - 0.05):
            return True
    return False


def _before_trunk(body: Body, side: str) -> Floats:
    """Distance of a hand before the trunk, m: before the hips, or before the chest where it is turned against them."""
    return np.maximum(body.own(f"{side}_wrist")[:, 2], body.ahead(f"{side}_wrist"))


@rule("reach-forward")
def reach_forward(body: Body) -> bool:
    """One hand goes 0.4 m ahead, stops going out for 0.2 s and comes back; the other stays back."""
    if not is_gesturing(body):
        return False
    for side, other in (("L", "R"), ("R", "L")):
        ahead = _before_trunk(body, side)
        over_hips = body.own(f"{side}_wrist")[:, 1] > -0.1
        level = over_hips & (body.height(f"{side}_wrist") < body.height(f"{side}_shoulder") + 0.08)
        stops = np.abs(np.gradient(body.smooth(ahead, 0.1))) * body.fps < 0.8
        alone = _before_trunk(body, other) < 0.3
        for begin, end in runs((ahead >= 0.4) & level & stops & alone & (body.height("pelvis") > 0.75 * HIPS)):
            came, went = ahead[: begin + 1].min() < 0.3, ahead[end - 1 :].min() < 0.3
            if (end - begin) / body.fps >= 0.2 and came and went:
                return True
    return False


@rule("push")
def push(body: Body) -> bool:
    hands = np.ones(len(body), np.bool_)
    for side in SIDES:
        hand = body.own(f"{side}_wrist")
        hands &= (hand[:, 2] > 0.28) & (hand[:, 1] > -0.1) & (hand[:, 1] < 0.7)
    slow = body.speed("pelvis", 0.5) < 1.3
    level = float(np.ptp(body.smooth(body.height("pelvis"), 0.2))) < 0.25
    return level and body.most(hands & (body.tip >= 10) & slow)


@rule("drive")
def drive(body: Body) -> bool:
    apart = body.hand_apart()
    hands = (apart >= 0.2) & (apart <= 0.65)
    for side in SIDES:
        hands &= hand_place(body, side)[:, 2] > 0.15
    between = body.own("L_wrist", "R_wrist")
    wheel = np.rad2deg(np.unwrap(np.arctan2(between[:, 1], between[:, 0])))
    return seated_frames(body).mean() >= 0.6 and body.most(hands) and float(np.ptp(body.smooth(wheel, 0.2))) >= 10
