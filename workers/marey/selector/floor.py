"""Rules of bodies that bend, crouch, sit, lie, and of what they do there."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, HIPS, KNEES, NECK, PELVIS, SHOULDERS, WRISTS, turning_points
from marey.motion.feet import runs
from marey.selector.grades import best, every, least, most, share
from marey.selector.motion import CHEST, STANDING, Array, Bool, Motion

LYING = 0.45
"""Metres under which hips, chest and head of a lying body are."""


def _ends(m: Motion) -> int:
    """Frames of a third of a second: how long a state at the beginning or the end lasts."""
    return max(min(round(m.fps / 3), m.frames // 3), 1)


def _hips(m: Motion) -> tuple[float, float]:
    """Return the hips' height at the beginning and the end, as shares of standing height."""
    few = _ends(m)
    return float(np.median(m.hips[:few])), float(np.median(m.hips[-few:]))


def _begins_standing(m: Motion) -> float:
    return least(float(np.percentile(m.hips[: max(m.frames // 3, 1)], 90)), 0.85, 0.06)


def _ends_standing(m: Motion) -> float:
    return least(float(np.percentile(m.hips[-max(m.frames // 3, 1) :], 90)), 0.85, 0.06)


def _knee_height(m: Motion) -> Array:
    return m.joints[:, list(KNEES), 1].min(axis=1)


def _hands_off(m: Motion) -> Array:
    return m.joints[:, list(WRISTS), 1].min(axis=1)


def _behind(m: Motion) -> Array:
    """(T,) metres by which the hips are behind the feet."""
    return m.foot_local[..., 0].mean(axis=1)


def bow(m: Motion, side: str) -> float:
    """Tip the trunk forward and come up again."""
    rest = float(np.percentile(m.lean, 20))
    low = int(m.lean.argmax())
    bent = float(m.lean[low]) - rest
    back = (bent - float(m.lean[low:].min() - rest)) / max(bent, 1)
    head = m.joints[:, HEAD, 1]
    drop = float(np.percentile(head, 95) - head[low])
    still = most(m.path, 0.2 * m.seconds + 0.5, 0.3)
    stands = min(least(float(_hands_off(m)[low]), 0.4, 0.1), least(float(m.hips[low]), 0.75, 0.05))
    rests = min(most(float(np.ptp(m.hips)), 0.1, 0.03), most(rest, 35, 10))  # of a body that kneels or sits meanwhile
    return min(least(bent, 15, 5), least(drop, 0.05, 0.02), least(back, 0.4, 0.2), still, max(stands, rests))


def bend_over(m: Motion, side: str) -> float:
    """Bend the trunk far forward on nearly straight legs."""
    straight = m.knees.mean(axis=1) < 65
    deepest = float(m.tilt[straight & (m.lean > 0)].max(initial=0))
    return min(least(deepest, 60, 8), least(best(m.hips.tolist()), 0.8, 0.08))


def crouch(m: Motion, side: str) -> float:
    """Stay low on both feet."""
    low = (m.hips < 0.77) & (m.feet.max(axis=1) < 0.15) & (_hands_off(m) > 0.08) & (_knee_height(m) > 0.17)
    low &= (_behind(m) < 0.32) & (m.tilt < 75)
    return max(least(m.most(low), 0.5, 0.1), least(m.longest(low), 1.0, 0.3))


def squat(m: Motion, side: str) -> float:
    """Go down and come up again, feet in place."""
    low = int(m.hips.argmin())
    depth = float(np.percentile(m.hips, 95)) - float(m.hips[low])
    up = min(best(m.hips[: low + 1].tolist()), best(m.hips[low:].tolist())) - float(m.hips[low])
    on_feet = min(least(float(_knee_height(m)[low]), 0.18, 0.06), most(float(m.feet[low].max()), 0.12, 0.05))
    trunk = min(most(float(m.tilt[low]), 60, 10), least(float(_hands_off(m)[low]), 0.15, 0.1))
    return min(least(depth, 0.25, 0.06), least(up, 0.2, 0.06), on_feet, trunk, most(m.path, 0.5, 0.3))


def seated(m: Motion) -> Bool:
    """(T,) True where the body sits on a seat."""
    level = np.abs(m.thighs).min(axis=1) < 38
    height = (m.hips > 0.33) & (m.hips < 0.8)
    return level & height & (m.tilt < 58) & (_behind(m) > 0.17) & (_knee_height(m) > 0.22)


def _on_seat(m: Motion) -> Bool:
    """(T,) True where the body sits on a seat of any height, as high stools are."""
    high = (m.hips > 0.6) & (m.hips < 0.87) & (m.thighs.max(axis=1) > -45) & (m.tilt < 50) & (_behind(m) > 0.0)
    return seated(m) | (high & (m.foot_speed.max(axis=1) < 0.5))


def sit(m: Motion, side: str) -> float:
    """Sit on a seat."""
    return least(m.most(seated(m)), 0.55, 0.15)


def sit_down(m: Motion, side: str) -> float:
    """Go down onto a seat and stay."""
    _, end = _hips(m)
    ends = least(share(_on_seat(m)[-_ends(m) :]), 0.5, 0.3)
    return min(_begins_standing(m), ends, least(best(m.hips[: m.frames // 2].tolist()) - end, 0.2, 0.06))


def stand_up(m: Motion, side: str) -> float:
    """Rise from a seat and stay."""
    _, end = _hips(m)
    low = float(m.hips[: max(2 * m.frames // 3, 1)].min())
    begins = least(share(_on_seat(m)[: 2 * _ends(m)]), 0.4, 0.3)
    return min(_ends_standing(m), least(end, 0.85, 0.06), begins, least(end - low, 0.22, 0.06))


def sit_floor(m: Motion, side: str) -> float:
    """Sit on the floor."""
    mask = (m.joints[:, PELVIS, 1] < 0.3) & (m.tilt < 50)
    return least(share(mask), 0.33, 0.1)


def kneel(m: Motion, side: str) -> float:
    """Rest on a knee."""
    hips = m.joints[:, PELVIS, 1]
    mask = (_knee_height(m) < 0.2) & (hips > 0.25) & (_hands_off(m) > 0.08) & (m.tilt < 60)
    return max(least(m.most(mask), 0.5, 0.1), least(m.longest(mask), 1.0, 0.3))


def _lying(m: Motion) -> Bool:
    return every(m.joints[:, [PELVIS, CHEST, HEAD], 1] < LYING)


def lie(m: Motion, side: str) -> float:
    """Lie on the floor."""
    return least(m.most(_lying(m)), 0.55, 0.15)


def _falls(m: Motion) -> tuple[float, float]:
    """Return a grade that the body goes from standing or sitting to lying, and the seconds that this takes."""
    lies = share(_lying(m)[-_ends(m) :])
    high = np.flatnonzero(m.hips > 0.75 * m.hips.max())
    low = np.flatnonzero(_lying(m))
    after = low[low > high[-1]] if len(high) else low
    taken = (after[0] - high[-1]) / m.fps if len(after) and len(high) else 0.0
    return min(least(lies, 0.5, 0.3), least(float(m.hips.max()), 0.5, 0.15)), taken


def lie_down(m: Motion, side: str) -> float:
    """Lie down under control."""
    there, seconds = _falls(m)
    return min(there, least(seconds, 0.8, 0.3))


def die(m: Motion, side: str) -> float:
    """Fall and lie there."""
    there, seconds = _falls(m)
    return min(there, _begins_standing(m), most(seconds, 2.4, 0.7))


def get_up(m: Motion, side: str) -> float:
    """Get up from the floor."""
    low = float(m.joints[: max(m.frames // 2, 1), PELVIS, 1].min())
    _, end = _hips(m)
    return min(most(low, 0.37, 0.06), least(end, 0.83, 0.06), most(float(np.median(m.tilt[-_ends(m) :])), 45, 15))


def _on_hands(m: Motion) -> Bool:
    shoulders = m.joints[:, list(SHOULDERS), 1].mean(axis=1) / STANDING[SHOULDERS[0]]
    hands = m.joints[:, list(WRISTS), 1].min(axis=1) < 0.25
    return (m.hips < 0.65) & (shoulders < 0.62) & (m.tilt > 45) & hands


def crawl(m: Motion, side: str) -> float:
    """Crawl."""
    limbs = [*KNEES, *WRISTS]
    moved = np.linalg.norm(np.gradient(m.joints[:, limbs], axis=0), axis=-1).max(axis=1) * m.fps > 0.15
    return min(least(share(_on_hands(m)), 0.55, 0.2), least(share(moved), 0.5, 0.2))


def push_ups(m: Motion, side: str) -> float:
    """Bend and stretch the arms, face down."""
    mask = _on_hands(m) & (m.tilt > 50) & (_hands_off(m) < 0.2)
    chest = m.joints[:, CHEST, 1]
    strokes = best([turning_points(chest[a:b], 0.08) for a, b in runs(mask) if b - a > 3])
    return min(least(share(mask), 0.5, 0.2), least(strokes, 1.5, 1))


def sit_ups(m: Motion, side: str) -> float:
    """Lift the trunk from the floor and lie back."""
    low = m.joints[:, PELVIS, 1] < 0.3
    strokes = best([turning_points(m.tilt[a:b], 25) for a, b in runs(low) if b - a > 3])
    return min(least(share(low), 0.6, 0.2), least(strokes, 1.5, 1), least(float(m.tilt.max()), 60, 10))


def pick_up(m: Motion, side: str) -> float:
    """Reach down and stand up again."""
    hands = _hands_off(m)
    low = int(hands.argmin())
    up = min(best(m.joints[: low + 1, NECK, 1].tolist()), best(m.joints[low:, NECK, 1].tolist())) / STANDING[NECK]
    return min(
        most(float(hands[low]), 0.5, 0.08), least(up, 0.85, 0.06), least(float(m.joints[low, NECK, 1]), 0.45, 0.1)
    )


def roll(m: Motion, side: str) -> float:
    """Roll over the floor and onto the feet."""
    down = (m.joints[:, HEAD, 1] < m.joints[:, PELVIS, 1]) & (m.joints[:, PELVIS, 1] < 0.7)
    return min(least(m.longest(down), 0.15, 0.08), least(_hips(m)[1], 0.6, 0.15), _back_low(m))


def _back_low(m: Motion) -> float:
    return most(float(m.joints[:, CHEST, 1].min()), 0.4, 0.1)


def _over_head(m: Motion) -> float:
    """Grade that the feet pass over the head."""
    over = m.joints[:, list(ANKLES), 1].max(axis=1) - m.joints[:, HEAD, 1]
    return least(float(over.max()), 0.2, 0.15)


def cartwheel(m: Motion, side: str) -> float:
    """Turn over sideways on the hands."""
    hands = most(float(_hands_off(m).min()), 0.2, 0.08)
    across = np.abs((m.joints[:, HIPS[0]] - m.joints[:, HIPS[1]])[:, 1])
    return min(_over_head(m), hands, least(float(across.max()), 0.08, 0.04), least(_hips(m)[1], 0.75, 0.1))


def flip(m: Motion, side: str) -> float:
    """Turn over in the air."""
    upside = share(m.tilt > 120) * m.seconds
    return min(_over_head(m), least(upside, 0.12, 0.08), least(_hips(m)[1], 0.6, 0.15))
