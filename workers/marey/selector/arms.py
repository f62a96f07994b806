"""Rules of arms, strikes and dance."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, PELVIS, SHOULDERS, WRISTS, body_frame, swings, variety, velocity
from marey.checks.stretch import Arm, both_arms
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.selector.gaits import stays
from marey.selector.grades import SIDES, best, least, most, of_side, share, some
from marey.selector.motion import SHORTEST, UP, Array, Motion


def _up(hand: Arm) -> float:
    """Grade that a hand is lifted on purpose."""
    return min(least(hand.peak, -0.12, 0.06), max(least(hand.rise, 0.25, 0.08), least(hand.lifted, 1.0, 0.3)))


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
    grades = _half_swings(m, 0), _half_swings(m, 1)
    hands = both_arms(m.joints, m.heading, m.fps)
    ups = _up(hands[0]), _up(hands[1])
    return min(_of_side((least(grades[0], 2.6, 1), least(grades[1], 2.6, 1)), ups, side), stays(m))


def _half_swings(m: Motion, k: int) -> int:
    """Return how often in a row a hand at the chest or over it swings by 7 cm or more, to and fro."""
    most_swings = 0
    for a, b in runs(m.hands[:, k, 1] > UP):
        way = m.hands[a:b, k] - smooth_seconds(m.hands[a:b, k], 0.5, m.fps)
        if len(way) < SHORTEST:
            continue
        axis = np.linalg.svd(way - way.mean(axis=0), full_matrices=False)[2][0]
        quick = np.diff(swings(way @ axis, 0.045)) < m.fps
        most_swings = max(most_swings, *(end - begin for begin, end in runs(quick)), 0)
    return most_swings


def raise_arm(m: Motion, side: str) -> float:
    """Lift a hand and hold it."""
    hands = both_arms(m.joints, m.heading, m.fps)
    ups = _up(hands[0]), _up(hands[1])
    before = round(1.5 * m.fps)

    def of(k: int) -> float:
        found = [0.0]
        for a, b in runs(m.hands[:, k, 1] > 0.0):
            low = float(m.hands[max(a - before, 0) : a + 1, k, 1].min())
            rise = max(most(low, -0.15, 0.1), least(float(a == 0), 0.9, 0.2))
            found.append(
                min(rise, least((b - a) / m.fps, 0.3, 0.12), least(float(m.hands[a:b, k, 1].max()), 0.05, 0.06))
            )
        return min(best(found), most(_half_swings(m, k), 4, 2))

    return min(_of_side((of(0), of(1)), ups, side), stays(m))


def reach_up(m: Motion, side: str) -> float:
    """Reach over the head."""
    over = m.joints[:, list(WRISTS), 1] - m.joints[:, [HEAD], 1]
    high = of_side(over.max(axis=0).tolist(), side)
    down = float((np.ptp(over, axis=0)).max())
    return min(least(high, 0.15, 0.06), least(down, 0.2, 0.08), least(float(np.median(m.hips)), 0.7, 0.08))


def cheer(m: Motion, side: str) -> float:
    """Throw hands up over the head, or pump fists."""
    rising = velocity(m.hands[..., 1], m.fps)
    head = m.joints[:, HEAD, 1] - m.joints[:, list(SHOULDERS), 1].mean(axis=1)
    before = round(0.5 * m.fps)
    grades = [0.0]
    for k in (0, 1):
        for a, b in runs(m.hands[:, k, 1] > head - 0.08):
            grades.append(least(float(rising[max(a - before, 0) : b, k].max()), 1.0, 0.3))
        pump = (m.ahead[:, k, 0] > 0.08) & (m.hands[:, k, 1] > -0.4) & (m.elbows[:, k] > 55)
        for a, b in runs(pump):
            both = min(float(rising[a:b, k].max()), -float(rising[a:b, k].min()))
            grades.append(least(both, 1.5, 0.3))
    return min(best(grades), stays(m))


def clap(m: Motion, side: str) -> float:
    """Bring the hands together and apart, three times."""
    gap = np.linalg.norm(m.joints[:, WRISTS[0]] - m.joints[:, WRISTS[1]], axis=-1)
    turns = swings(gap, 0.05)
    meets = sum(gap[a] < 0.23 for a in turns)
    return min(least(meets, 2.5, 1), least(len(turns) / 2, 2.5, 1), most(float(gap.min()), 0.2, 0.05), stays(m))


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
    forward = velocity(smooth_seconds(m.foot_local, 0.03, m.fps), m.fps)[..., 0]
    low = (m.feet < 0.3) & (np.abs(m.foot_local[..., 0]) < 0.4)
    through = np.where(low, forward, 0).max(axis=0)
    after = (m.foot_local[..., 0] * (m.feet > 0.1)).max(axis=0)
    return min(least(of_side(through.tolist(), side), 2.8, 0.6), least(of_side(after.tolist(), side), 0.35, 0.1))


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


def _swung_blows(m: Motion) -> Array:
    """(2,) grades that each fist swings across in front of the face, or up to it: hooks and uppercuts."""
    grades = np.zeros(2)
    for k in (0, 1):
        for a, b in runs(m.hand_speed[:, k] > 1.2):
            way = m.hands[max(a - 1, 0) : b + 1, k]  # ahead, up and aside of the shoulders
            gone = max(float(np.ptp(way[:, 2])), float(way[:, 1].max() - way[0, 1]))
            place = min(least(float(way[:, 0].max()), 0.28, 0.1), least(float(way[:, 1].max()), -0.05, 0.1))
            fast = least(float(m.hand_speed[a:b, k].max()), 1.9, 0.5)
            bent = least(float(m.elbows[max(a - 3, 0) : b, k].max()), 60, 20)
            grades[k] = max(grades[k], min(fast, least(gone, 0.3, 0.1), place, bent))
    return grades


def punch(m: Motion, side: str) -> float:
    """Shoot a fist forward, or swing it across or up."""
    blows = np.maximum(_thrusts(m, 1.9), _swung_blows(m))
    return min(of_side(blows.tolist(), side), most(m.path, 0.5 * m.seconds + 0.8, 0.4))


def slash(m: Motion, side: str) -> float:
    """Sweep a blade through an arc."""
    arcs = [0.0]
    for k in (0, 1):
        for a, b in runs(m.hand_speed[:, k] > 1.3):
            way = m.hands[max(a - 1, 0) : b + 1, k]
            length = float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())
            moved = way[-1] - way[0]
            across = max(float(np.ptp(way[:, 2])), float(way[:, 1].max() - way[-1, 1]))
            fast = least(float(m.hand_speed[a:b, k].max()), 2.3, 0.5)
            upward = most(float(moved[1]), 0.35, 0.15)
            arcs.append(min(fast, upward, least(length, 0.6, 0.15), least(across, 0.42, 0.12)))
    return min(best(arcs), most(m.path, 0.8 * m.seconds + 1, 0.5))


def throw(m: Motion, side: str) -> float:
    """Swing a hand back and forward, and let go."""
    hands = smooth_seconds(m.joints[:, list(WRISTS)] - m.joints[:, [PELVIS]], 0.02, m.fps)
    forward, _ = body_frame(velocity(hands, m.fps), m.heading[:, None])
    after = round(0.5 * m.fps)
    grades = np.zeros(2)
    for k in (0, 1):
        for a, b in runs(forward[:, k] > 1.2):
            first = max(a - round(0.6 * m.fps), 0)
            back = float(m.ahead[first : a + 1, k, 0].min())
            wound = max(most(back, 0.06, 0.1), least(float(m.hands[first : a + 1, k, 1].max()), 0.05, 0.1))
            ahead = least(float(m.ahead[a : b + 2, k, 0].max()), 0.3, 0.1)
            fast = least(float(forward[a:b, k].max()), 2.6, 0.5)
            stops = most(float(forward[b : b + after, k].min(initial=9)), 0.8, 0.5)
            grades[k] = max(grades[k], min(fast, wound, ahead, stops))
    return of_side(grades.tolist(), side)


def arm_circles(m: Motion, side: str) -> float:
    """Swing a straight arm in a full circle."""
    grades = [0.0, 0.0]
    for k in (0, 1):
        for flat in np.radians((0, 45, 90, 135)):  # the upright planes in which an arm may circle
            across = m.reach[:, k, 0] * np.cos(flat) + m.reach[:, k, 2] * np.sin(flat)
            plane = np.stack([across, m.reach[:, k, 1]], axis=-1)
            for a, b in runs((np.linalg.norm(plane, axis=-1) > 0.12) & (m.elbows[:, k] < 95)):
                angle = np.degrees(np.unwrap(np.arctan2(plane[a:b, 1], plane[a:b, 0])))
                high, low = float(plane[a:b, 1].max()), float(plane[a:b, 1].min())
                grades[k] = max(
                    grades[k], min(least(float(np.ptp(angle)), 300, 40), least(high, 0.25, 0.1), most(low, -0.2, 0.1))
                )
    return min(of_side(grades, side), stays(m))


def arabesque(m: Motion, side: str) -> float:
    """Stretch a leg behind."""
    behind = (m.feet > 0.35) & (m.foot_local[..., 0] < -0.2) & (m.knees < 50)
    stands = m.feet[:, ::-1] < 0.15
    return least(m.longest(some(behind & stands)), 0.2, 0.12)


def dance(m: Motion, side: str) -> float:
    """Move arms and legs all the time."""
    lively = least(share(m.lively > 0.17), 0.6, 0.2)
    direct = float(np.linalg.norm(m.place[-1] - m.place[0])) / m.seconds
    legs, arms = (variety(m.joints, m.heading, pair) for pair in (ANKLES, WRISTS))
    return min(lively, most(direct, 0.7, 0.2), least(legs, 0.07, 0.03), least(arms, 0.15, 0.05))


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
