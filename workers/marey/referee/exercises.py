"""Rules of exercises, dance and ball games."""

from __future__ import annotations

import numpy as np

from marey.referee.body import CHEST, HIPS, SIDES, Body, runs, swings
from marey.referee.gaits import steady_gait, travel
from marey.referee.gestures import KNEES, hand_place, is_gesturing
from marey.referee.rules import rule

DANCE_S = 3.0
"""Shortest clip in which movements can be told to be a dance."""


@rule("push-ups")
def push_ups(body: Body) -> bool:
    hands = np.maximum(body.height("L_wrist"), body.height("R_wrist")) < 0.2
    prone = hands & (body.tip > 50) & (body.tip < 130)
    chest = body.smooth(body.height("spine3"), 0.1)
    return any(len(swings(chest[begin:end], 0.1)) >= 2 for begin, end in runs(prone))


@rule("sit-ups")
def sit_ups(body: Body) -> bool:
    """Lies on the back with bent knees; the trunk rises by 30 degrees and lies back.

    Captured bodies that lie may float, so the hips are compared with the knees.
    """
    bent = np.minimum(body.bend("L", "knee"), body.bend("R", "knee")) > 40
    knees = np.minimum(body.height("L_knee"), body.height("R_knee"))
    down = (body.height("pelvis") < 0.55) & (body.height("pelvis") < knees + 0.1)
    rises = swings(body.smooth(body.tip, 0.15), 30.0)
    return len(rises) >= 2 and bool((bent & down).mean() >= 0.5) and bool(((body.tip < -55) & down).any())


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
    return len(turns) >= 3 and travel(body) < 0.6 and is_gesturing(body)


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
    rhythm = max(
        len(swings(body.smooth(body.own(f"{s}_wrist")[:, axis], 0.1), 0.15)) for s in SIDES for axis in range(3)
    )
    moving = arms >= 0.5 and legs + hips >= 0.7 and rhythm >= 3
    upright = body.most(body.height("pelvis") > 0.4)
    return len(body) / body.fps >= DANCE_S and moving and not steady_gait(body) and upright


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
        ahead = max(hand_place(body, side)[begin:end][:, 2].max() for side in SIDES)
        straight = min(body.bend(side, "elbow")[begin:end].min() for side in SIDES) < 60
        if chest and straight and ahead > 0.15 and push > 0.5:
            return True
    return False
