"""Rules of gestures, emotes and everyday actions."""

from __future__ import annotations

import numpy as np

from marey.referee.body import CHEST, HEAD, HIPS, SIDES, Body, Floats, Mask, runs, swings
from marey.referee.gaits import gait, passage, planted, travel
from marey.referee.rules import rule

SEAT_DROP = 0.1
"""Least way of the hips onto a seat; a high stool is 0.8 m high."""
DANCE_S = 3.0
"""Shortest clip in which movements can be told to be a dance."""
KNEES = 0.5
"""Height of the knees, m."""
WAVING_ELBOW = 0.46
"""Median speed of the elbow in a wave, as a share of that of the wrist; at most."""


def _stays(body: Body) -> bool:
    return travel(body) < 0.8


def _gestures(body: Body) -> bool:
    """Return True if the body stays near its place and neither kicks nor dances, so that a gesture is what it does."""
    return travel(body) < 1.2 and planted(body) and not passage(body)


def _hand(body: Body, side: str) -> Floats:
    return body.own(f"{side}_wrist", "spine3")


def _over_shoulder(body: Body, side: str) -> Floats:
    return body.height(f"{side}_wrist") - body.height(f"{side}_shoulder")


def _half_swings(body: Body, side: str, mask: Mask, size: float) -> int:
    """Count swings of a hand along the direction in which it swings most, while a condition holds."""
    best = 0
    for begin, end in runs(mask):
        part = body.smooth(_hand(body, side), 0.06)[begin:end]
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
        if not high.any() or not _gestures(body):
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
        if held and low and upright and _gestures(body):
            return True
    return False


@rule("bow")
def bow(body: Body) -> bool:
    tip, head = body.smooth(body.tip, 0.1), body.smooth(body.height("head"), 0.1)
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist"))
    if not _stays(body) or not _gestures(body) or body.height("pelvis").min() < 0.6 * HIPS:
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
        before = (_hand(body, side)[:, 2] > 0.1) & (_hand(body, side)[:, 1] > -0.1)
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
        hand = _hand(body, side)
        away = (np.linalg.norm(hand, axis=-1) > 0.35) & (hand[:, 1] > -0.35)
        calm = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 0.7
        places: list[Floats] = []
        for begin, end in runs(away & calm):
            middle = hand[begin:end].mean(axis=0)
            if end - begin >= body.frames(0.1) and (not places or np.linalg.norm(middle - places[-1]) > 0.2):
                places.append(middle)
        found += len(places)
        found += len(swings(body.smooth(hand[:, 0], 0.1)[away], 0.35)) // 2 if away.sum() > 3 else 0
    return found


@rule("signal")
def signal(body: Body) -> bool:
    return _gestures(body) and body.most(body.standing) and gait(body).steps < 4 and _signs(body) >= 3


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
            _gestures(body)
            and body.longest(level & out & calm & hangs & body.standing) >= 0.5
            and not (level & out).all()
        ):
            return True
    return False


@rule("shiver")
def shiver(body: Body) -> bool:
    close = body.hand_apart() < 0.6
    shakes = 0.0
    for joint in ("L_wrist", "R_wrist", "L_shoulder", "R_shoulder", "L_knee", "R_knee"):
        place = body.own(joint)
        fine = place - body.smooth(place, 0.3)
        _, _, axes = np.linalg.svd(fine, full_matrices=False)
        shakes = max(shakes, len(swings(fine @ axes[0], 0.004)) / 2 / (len(body) / body.fps))
    return body.most(close & (body.height("pelvis") > 0.6 * HIPS)) and shakes >= 3.5 and _stays(body)


@rule("talk")
def talk(body: Body) -> bool:
    gestures, speed = np.zeros(len(body), np.bool_), np.zeros(len(body))
    for side in SIDES:
        hand = body.own(f"{side}_wrist")
        between = (hand[:, 1] > -0.05) & (body.height(f"{side}_wrist") < body.height(f"{side}_shoulder") + 0.1)
        moves = body.smooth(np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1), 0.3)
        gestures |= between & (moves >= 0.2) & (hand[:, 2] > 0.05)
        speed = np.maximum(speed, moves)
    small = float(np.percentile(speed, 90)) < 1.5
    steady = float(np.ptp(body.smooth(body.height("pelvis"), 0.2))) < 0.12 and planted(body, 0.1)
    return travel(body) < 0.4 and steady and small and body.share(gestures) >= 1 / 3


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
        hand = body.smooth(_hand(body, side), 0.06)
        if _half_swings(body, side, np.ones(len(body), np.bool_), 0.1) < 5:
            continue
        low, high = np.percentile(hand, [10, 90], axis=0)
        if float((high - low).max()) <= 0.7 and _gestures(body):
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


@rule("reach-forward")
def reach_forward(body: Body) -> bool:
    for side in SIDES:
        hand = body.own(f"{side}_wrist")
        level = (hand[:, 1] > -0.1) & (body.height(f"{side}_wrist") < body.height(f"{side}_shoulder") + 0.08)
        calm = np.linalg.norm(body.own_velocity(f"{side}_wrist"), axis=-1) < 0.6
        out = level & (hand[:, 2] >= 0.38) & calm & body.standing
        back = hand[:, 2] < 0.3
        for begin, end in runs(out):
            if (end - begin) / body.fps >= 0.12 and back.any() and _gestures(body):
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
        hands &= _hand(body, side)[:, 2] > 0.15
    between = body.own("L_wrist", "R_wrist")
    wheel = np.rad2deg(np.unwrap(np.arctan2(between[:, 1], between[:, 0])))
    return _seated(body).mean() >= 0.6 and body.most(hands) and float(np.ptp(body.smooth(wheel, 0.2))) >= 10


def _seated(body: Body, *, hanging: bool = False) -> Mask:
    """Return where the body sits on a seat: thighs near level, and the feet ahead of the hips or free of the floor.

    Args:
        body: what to measure.
        hanging: one thigh may hang, as at the edge of a high stool.
    """
    hips = body.height("pelvis") / HIPS
    behind = body.lowest_foot > 0.3
    steep = []
    for side in SIDES:
        thigh = body.at(f"{side}_knee") - body.at(f"{side}_hip")
        steep.append(np.rad2deg(np.arcsin(np.clip(np.abs(thigh[:, 1]) / np.linalg.norm(thigh, axis=-1), 0, 1))))
        behind |= body.own(f"{side}_ankle")[:, 2] > 0.08
    level = np.minimum(*steep) < 45 if hanging else np.maximum(*steep) < 45
    low = (hips > 0.33) & (hips < 0.92)
    return (low | (body.lowest_foot > 0.3)) & level & behind & (body.lean < 50)


@rule("sit")
def sit(body: Body) -> bool:
    return body.most(_seated(body))


@rule("sit-down")
def sit_down(body: Body) -> bool:
    hips, seated = body.height("pelvis"), _seated(body)
    last = slice(-body.frames(0.3), None)
    high = int(hips[: max(1, len(body) // 2)].argmax())
    if hips[high] <= 0.8 * HIPS or seated[last].mean() <= 0.5:
        return False
    return float(hips[high] - np.median(hips[last])) >= SEAT_DROP


@rule("stand-up")
def stand_up(body: Body) -> bool:
    hips = body.height("pelvis")
    first, last = slice(0, body.frames(0.5)), slice(-body.frames(0.2), None)
    begins = float(hips[: body.frames(0.2)].min())
    # On a high seat one foot stands on the floor, and that thigh hangs.
    rests = _seated(body, hanging=True)[first].any() and begins < 0.93 * HIPS
    rise = float(np.median(hips[last])) - float(hips[first].min())
    return bool(rests and rise >= 0.085 and float(np.median(hips[last])) > 0.8 * HIPS)


@rule("sit-floor")
def sit_floor(body: Body) -> bool:
    low = (body.height("pelvis") < 0.3) & (body.lean < 50)
    return bool(low.mean() >= 1 / 3)


@rule("kneel")
def kneel(body: Body) -> bool:
    knees = np.minimum(body.height("L_knee"), body.height("R_knee")) < 0.2
    hips = body.height("pelvis") >= 0.25
    hands = np.minimum(body.height("L_wrist"), body.height("R_wrist")) > 0.1
    down = knees & hips & hands & (np.abs(body.tip) < 75)
    return body.longest(down) >= 1.0 or bool(down.mean() >= 0.5)


def _lying(body: Body) -> Mask:
    return (body.height("pelvis") < 0.45) & (body.height("spine3") < 0.45) & (body.height("head") < 0.45)


@rule("lie")
def lie(body: Body) -> bool:
    return bool(_lying(body).mean() >= 0.6)


@rule("lie-down")
def lie_down(body: Body) -> bool:
    lying = _lying(body)
    up = body.height("head") > 0.75 * (CHEST - HIPS) + 0.45
    if not lying[-body.frames(0.2) :].all() or not up.any():
        return False
    begin = int(np.flatnonzero(up)[-1])
    falling = body.height("head")
    start = int(np.flatnonzero(falling > 0.9 * falling[: begin + 1].max())[-1])
    end = int(np.flatnonzero(~lying)[-1]) + 1
    return (end - start) / body.fps >= 0.9


@rule("get-up")
def get_up(body: Body) -> bool:
    hips = body.height("pelvis")
    return bool(hips[: max(1, len(body) // 2)].min() < 0.35 and np.median(hips[-body.frames(0.2) :]) >= 0.85 * HIPS)


# -- exercise ---------------------------------------------------------------------------------------------------------


@rule("push-ups")
def push_ups(body: Body) -> bool:
    hands = np.maximum(body.height("L_wrist"), body.height("R_wrist")) < 0.2
    prone = hands & (body.tip > 50) & (body.tip < 130)
    chest = body.smooth(body.height("spine3"), 0.1)
    return any(len(swings(chest[begin:end], 0.1)) >= 2 for begin, end in runs(prone))


@rule("sit-ups")
def sit_ups(body: Body) -> bool:
    bent = np.minimum(body.bend("L", "knee"), body.bend("R", "knee")) > 40
    floor = body.height("pelvis") < 0.3
    rises = swings(body.smooth(body.lean, 0.15), 30.0)
    lies = body.lean > 55
    return len(rises) >= 2 and bool((bent & floor).mean() >= 0.5) and bool((lies & floor).any())


@rule("squat")
def squat(body: Body) -> bool:
    hips = body.smooth(body.height("pelvis"), 0.1)
    feet = (body.lift("L") < 0.12) & (body.lift("R") < 0.12)
    down = [(a, b) for a, b in swings(hips, 0.22 * HIPS) if hips[b] < hips[a]]
    for begin, end in down:
        rises = hips[end:].max() - hips[end] >= 0.2 * HIPS
        part = slice(begin, end + 1)
        if rises and hips[begin] - hips[end] >= 0.25 * HIPS and feet[part].mean() > 0.85 and body.lean[end] < 60:
            return travel(body) < 0.8 and hips[end] > 0.15
    return False


@rule("bend-over")
def bend_over(body: Body) -> bool:
    knees = np.maximum(body.bend("L", "knee"), body.bend("R", "knee")) < 60
    return bool(((body.tip >= 60) & knees & (body.height("pelvis") > 0.6 * HIPS) & (body.lowest_foot < 0.15)).any())


@rule("twist")
def twist(body: Body) -> bool:
    shoulders = body.own("L_shoulder", "R_shoulder")
    angle = body.smooth(np.rad2deg(np.arctan2(-shoulders[:, 2], shoulders[:, 0])), 0.1)
    turns = [abs(angle[b] - angle[a]) for a, b in swings(angle, 20.0)]
    return len(turns) >= 3 and travel(body) < 0.6 and _gestures(body)


@rule("arm-circles")
def arm_circles(body: Body) -> bool:
    for side in SIDES:
        hand = body.own(f"{side}_wrist", f"{side}_shoulder")
        long = np.linalg.norm(hand, axis=-1) > 0.3
        for axis in (0, 2):
            # Across the plane of its circle an arm passes the shoulder's line, where its angle means nothing.
            clear = long & (np.linalg.norm(hand[:, [axis, 1]], axis=-1) > 0.15)
            frames = np.flatnonzero(clear)
            gaps = np.flatnonzero(np.diff(frames) > body.frames(0.15)) + 1
            for part in np.split(frames, gaps):
                if len(part) and np.ptp(np.unwrap(np.arctan2(hand[part, axis], hand[part, 1]))) >= np.deg2rad(330):
                    return True
    return False


@rule("knee-to-elbow")
def knee_to_elbow(body: Body) -> bool:
    for knee in SIDES:
        for elbow in SIDES:
            near = np.linalg.norm(body.at(f"{knee}_knee") - body.at(f"{elbow}_elbow"), axis=-1) < 0.27
            high = body.height(f"{knee}_knee") > body.height(f"{knee}_hip") - 0.15
            if (near & high & (body.height("pelvis") > 0.75 * HIPS)).any():
                return True
    return False


# -- dance and ball games ---------------------------------------------------------------------------------------------


@rule("dance")
def dance(body: Body) -> bool:
    """Arms, legs and hips move for three seconds or more, without a steady walk or run, straight or in a curve."""

    def busy(joints: tuple[str, ...], least: float) -> float:
        speeds = [body.smooth(np.linalg.norm(body.own_velocity(joint), axis=-1), 0.5) for joint in joints]
        return body.share(np.max(speeds, axis=0) > least)

    arms = busy(("L_wrist", "R_wrist"), 0.3)
    legs = busy(("L_ankle", "R_ankle", "L_knee", "R_knee"), 0.15)
    hips = body.share(body.smooth(body.speed("pelvis"), 0.5) > 0.08)
    found = gait(body)
    steady = found.steps >= 4 and found.distance > 1.5 and found.forward > 0.5
    steady = steady and (found.end - found.begin) > 0.7 * len(body)
    rhythm = max(
        len(swings(body.smooth(body.own(f"{s}_wrist")[:, axis], 0.1), 0.15)) for s in SIDES for axis in range(3)
    )
    moving = arms >= 0.5 and legs + hips >= 0.7 and rhythm >= 3
    return len(body) / body.fps >= DANCE_S and moving and not steady and body.most(body.height("pelvis") > 0.4)


@rule("dribble")
def dribble(body: Body) -> bool:
    for side in SIDES:
        height = body.smooth(body.height(f"{side}_wrist"), 0.06)
        band = (height > KNEES - 0.1) & (height < CHEST + 0.2)
        for begin, end in runs(band):
            strokes = swings(height[begin:end], 0.1)
            if len(strokes) >= 7:
                rate = len(strokes) / 2 / ((strokes[-1][1] - strokes[0][0]) / body.fps)
                if 0.8 <= rate <= 3.5:
                    return True
    return False


@rule("shoot-basket")
def shoot_basket(body: Body) -> bool:
    both = (body.height("L_wrist") + body.height("R_wrist")) / 2
    one = np.maximum(body.height("L_wrist"), body.height("R_wrist"))
    near = body.hand_apart() < 0.4
    for begin, end in runs(one > body.height("head") + 0.1):
        before = slice(max(0, begin - body.frames(1.0)), begin + 1)
        chest = (both[before] < CHEST + 0.25).any() and near[before].any()
        push = max(body.own_velocity(f"{side}_wrist", window=0.06)[begin:end, 1].max(initial=0.0) for side in SIDES)
        ahead = max(_hand(body, side)[begin:end][:, 2].max() for side in SIDES)
        straight = min(body.bend(side, "elbow")[begin:end].min() for side in SIDES) < 60
        if chest and straight and ahead > 0.15 and push > 0.5:
            return True
    return False
