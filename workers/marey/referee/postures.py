"""Rules of postures: sitting, kneeling and lying, and the ways in and out of them."""

from __future__ import annotations

import numpy as np

from marey.referee.body import CHEST, HIPS, SIDES, Body, Mask
from marey.referee.rules import rule

SEAT_DROP = 0.1
"""Least way of the hips onto a seat; a high stool is 0.8 m high."""


def seated_frames(body: Body, *, hanging: bool = False) -> Mask:
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
    return body.most(seated_frames(body))


@rule("sit-down")
def sit_down(body: Body) -> bool:
    hips, seated = body.height("pelvis"), seated_frames(body)
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
    rests = seated_frames(body, hanging=True)[first].any() and begins < 0.93 * HIPS
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


def lying_frames(body: Body) -> Mask:
    """Return where the body lies (T,)."""
    return (body.height("pelvis") < 0.45) & (body.height("spine3") < 0.45) & (body.height("head") < 0.45)


@rule("lie")
def lie(body: Body) -> bool:
    return bool(lying_frames(body).mean() >= 0.6)


@rule("lie-down")
def lie_down(body: Body) -> bool:
    lying = lying_frames(body)
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
