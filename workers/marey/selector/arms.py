"""Rules of arms, strikes and dance."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, PELVIS, WRISTS, body_frame, smooth, turning_points, velocity
from marey.checks.stretch import Arm, arm
from marey.motion.feet import runs
from marey.selector.grades import best, least, most, share, some
from marey.selector.motion import Array, Motion

SIDES = ("left", "right")


def _arms(m: Motion) -> tuple[Arm, Arm]:
    return arm(m.joints, m.heading, m.fps, 0), arm(m.joints, m.heading, m.fps, 1)


def _up(hand: Arm) -> float:
    """Grade that a hand is lifted on purpose."""
    return min(least(hand.peak, -0.12, 0.06), max(least(hand.rise, 0.25, 0.08), least(hand.lifted, 1.0, 0.3)))


def _waves(hand: Arm) -> float:
    small = max(
        min(least(hand.lifted, 1.5, 0.4), least(hand.flutter, 3.5, 1)),
        min(least(hand.lifted, 4.5, 0.5), least(hand.flutter, 2.5, 1)),
    )
    return max(least(hand.swings, 4.5, 1.5), small)


def _of_side(grades: tuple[float, float], others: tuple[float, float], side: str) -> float:
    """Join the grades of both hands: the hand asked for does it, and the other does not.

    Args:
        grades: that each hand does it.
        others: that each hand is lifted at all.
        side: `left`, `right`, `both`, or empty: any.
    """
    if side == "both":
        return min(grades)
    if side not in SIDES:
        return max(grades)
    own = SIDES.index(side)
    return min(grades[own], 1 - 0.8 * others[1 - own])


def wave(m: Motion, side: str) -> float:
    """Swing a lifted hand to and fro."""
    hands = _arms(m)
    ups = _up(hands[0]), _up(hands[1])
    grades = min(ups[0], _waves(hands[0])), min(ups[1], _waves(hands[1]))
    return min(_of_side(grades, ups, side), _stays(m))


def raise_arm(m: Motion, side: str) -> float:
    """Lift a hand and hold it."""
    hands = _arms(m)
    ups = _up(hands[0]), _up(hands[1])
    over = [min(up, least(hand.peak, 0.0, 0.12)) for up, hand in zip(ups, hands, strict=True)]
    grades = min(over[0], most(hands[0].swings, 5, 1.5)), min(over[1], most(hands[1].swings, 5, 1.5))
    return min(_of_side(grades, ups, side), _stays(m))


def _stays(m: Motion) -> float:
    return most(m.path, 0.3 * m.seconds + 0.5, 0.3)


def reach_up(m: Motion, side: str) -> float:
    """Reach over the head."""
    over = m.joints[:, list(WRISTS), 1] - m.joints[:, [HEAD], 1]
    return least(_either(over.max(axis=0), side), 0.15, 0.06)


def _either(values: Array, side: str) -> float:
    """Return the value of the hand or foot asked for; the larger one of either, the smaller one of both."""
    if side == "both":
        return float(values.min())
    return float(values[SIDES.index(side)] if side in SIDES else values.max())


def cheer(m: Motion, side: str) -> float:
    """Throw up hands over the head."""
    rising = velocity(m.hands[..., 1], m.fps)
    up = np.where(m.hands[..., 1] > 0.05, 1.0, 0.0)
    tops = [
        best([float(rising[max(a - round(0.5 * m.fps), 0) : b, k].max()) for a, b in runs(up[:, k] > 0)])
        for k in (0, 1)
    ]
    return min(least(max(tops), 1.0, 0.3), _stays(m))


def clap(m: Motion, side: str) -> float:
    """Bring the hands together and apart, three times."""
    gap = np.linalg.norm(m.joints[:, WRISTS[0]] - m.joints[:, WRISTS[1]], axis=-1)
    meets = [a for a, _ in runs(smooth(gap, 0.02, m.fps) < 0.22)]
    strokes = turning_points(gap, 0.05) / 2
    return min(least(strokes, 2.5, 1), least(len(meets), 0.5, 0.5), most(float(gap.min()), 0.2, 0.05), _stays(m))


def kick(m: Motion, side: str) -> float:
    """Swing a foot out and up."""
    local, speed = m.foot_local, m.foot_speed
    out = np.hypot(local[..., 0], local[..., 2])
    high = (m.feet + 0.07 > 0.42) & (out > 0.35) & ((local[..., 0] > 0) | (np.abs(local[..., 2]) > 0.35))
    window = round(0.35 * m.fps)

    def of(k: int) -> float:
        swings = [float(speed[max(a - window, 0) : b, k].max()) for a, b in runs(high[:, k])]
        return least(best(swings), 1.8, 0.6)

    grades = [of(k) for k in (0, 1) if side not in SIDES or SIDES.index(side) == k]
    return min(best(grades), most(m.path, 0.8 * m.seconds + 1.0, 0.5))


def kick_ball(m: Motion, side: str) -> float:
    """Swing a foot forward through a ball on the floor."""
    forward = velocity(smooth(m.foot_local, 0.03, m.fps), m.fps)[..., 0]
    low = (m.feet < 0.3) & (np.abs(m.foot_local[..., 0]) < 0.4)
    through = np.where(low, forward, 0).max(axis=0)
    after = (m.foot_local[..., 0] * (m.feet > 0.1)).max(axis=0)
    return min(least(_either(through, side), 2.8, 0.6), least(_either(after, side), 0.35, 0.1))


def _thrusts(m: Motion, fastest: float) -> Array:
    """(2,) grades that each hand shoots away from its shoulder until the arm is nearly straight."""
    far = np.linalg.norm(m.reach, axis=-1)
    away = velocity(far, m.fps)
    out = (
        (np.hypot(m.reach[..., 0], m.reach[..., 2]) > 0.15)
        & (np.abs(m.reach[..., 1]) < 0.42)
        & (m.reach[..., 0] > -0.1)
    )
    window = max(round(0.15 * m.fps), 1)
    grades = np.zeros(2)
    for k in (0, 1):
        for a, b in runs((away[:, k] > 0.4 * fastest) & out[:, k]):
            near = slice(max(a - window, 0), b + window)
            fast = least(float(m.hand_speed[near, k].max()), fastest, 0.35 * fastest)
            straight = most(float(m.elbows[near, k].min()), 60, 20)
            grades[k] = max(
                grades[k], min(fast, straight, least(float(away[a:b, k].max()), 0.6 * fastest, 0.2 * fastest))
            )
    return grades


def punch(m: Motion, side: str) -> float:
    """Shoot a fist forward."""
    return min(_either(_thrusts(m, 1.9), side), most(m.path, 0.5 * m.seconds + 0.8, 0.4))


def slash(m: Motion, side: str) -> float:
    """Sweep a blade through an arc."""
    arcs = [0.0]
    for k in (0, 1):
        for a, b in runs(m.hand_speed[:, k] > 1.2):
            way = m.hands[max(a - 1, 0) : b + 1, k]
            length = float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())
            across = float(np.ptp(way[:, 1:], axis=0).max())
            fast = least(float(m.hand_speed[a:b, k].max()), 2.2, 0.5)
            arcs.append(min(fast, least(length, 0.65, 0.15), least(across, 0.45, 0.12)))
    return best(arcs)


def throw(m: Motion, side: str) -> float:
    """Swing a hand back and forward, and let go."""
    forward = velocity(m.reach[..., 0], m.fps)
    grades = np.zeros(2)
    for k in (0, 1):
        for a, b in runs(forward[:, k] > 1.2):
            back = float(m.reach[max(a - round(0.4 * m.fps), 0) : a + 1, k, 0].min())
            ahead = float(m.reach[a:b, k, 0].max())
            fast = least(float(m.hand_speed[a:b, k].max()), 2.8, 0.7)
            grades[k] = max(grades[k], min(fast, most(back, 0.08, 0.12), least(ahead, 0.2, 0.1)))
    return _either(grades, side)


def arm_circles(m: Motion, side: str) -> float:
    """Swing a straight arm in a full circle."""
    turned = np.zeros(2)
    for k in (0, 1):
        angle = np.unwrap(np.arctan2(m.reach[:, k, 1], m.reach[:, k, 0]))
        across = np.unwrap(np.arctan2(m.reach[:, k, 1], m.reach[:, k, 2]))
        turned[k] = np.degrees(max(np.ptp(angle), np.ptp(across)))
    return min(least(_either(turned, side), 320, 40), _stays(m))


def arabesque(m: Motion, side: str) -> float:
    """Stretch a leg behind."""
    behind = (m.feet > 0.35) & (m.foot_local[..., 0] < -0.2) & (m.knees < 50)
    stands = m.feet[:, ::-1] < 0.15
    return least(m.longest(some(behind & stands)), 0.2, 0.12)


def dance(m: Motion, side: str) -> float:
    """Move arms and legs all the time."""
    lively = least(share(m.lively > 0.2), 0.5, 0.2)
    direct = float(np.linalg.norm(m.place[-1] - m.place[0])) / m.seconds
    legs, arms = _variety(m, ANKLES), _variety(m, WRISTS)
    return min(lively, most(direct, 0.7, 0.2), least(legs, 0.08, 0.04), least(arms, 0.15, 0.05))


def _variety(m: Motion, joints: tuple[int, int]) -> float:
    """Root mean square of how far two joints get from their mean place in the body, metres."""
    limbs = m.joints[:, list(joints)] - m.joints[:, [PELVIS]]
    forward, left = body_frame(limbs, m.heading[:, None])
    local = np.stack([forward, limbs[..., 1], left], axis=-1)
    return float(np.sqrt(np.sum((local - local.mean(axis=0)) ** 2, axis=-1).mean()))


def knee_to_elbow(m: Motion, side: str) -> float:
    """Bring knee and elbow together, standing."""
    pairs = [np.linalg.norm(m.joints[:, k] - m.joints[:, e], axis=-1) for k in (4, 5) for e in (18, 19)]
    near = np.min(pairs, axis=0)
    lifted = m.thighs.max(axis=1) > -25
    return min(most(float(np.where(lifted, near, 9).min()), 0.27, 0.06), least(float(np.median(m.hips)), 0.85, 0.06))


def drink(m: Motion, side: str) -> float:
    """Hold a hand at the mouth."""
    gap = np.linalg.norm(m.joints[:, list(WRISTS)] - m.joints[:, [HEAD]], axis=-1)
    return least(max(m.longest(gap[:, k] < 0.27) for k in (0, 1)), 0.5, 0.2)
