"""Rules of guards, blades, guns and bows, and of blows that are dodged or taken."""

from __future__ import annotations

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, PELVIS, WRISTS, body_frame, velocity
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.selector.grades import best, every, least, most, of_side
from marey.selector.motion import CHEST, Array, Bool, Motion

HIGH = (-0.28, 0.25)
"""Metres over the shoulders of breast and eyes."""


def _between(values: Array, bounds: tuple[float, float]) -> Bool:
    return (values > bounds[0]) & (values < bounds[1])


def stance(m: Motion) -> float:
    """Grade that the feet stand apart, or the knees are bent."""
    apart = np.linalg.norm((m.foot_local[:, 0] - m.foot_local[:, 1])[:, [0, 2]], axis=-1)
    return max(least(float(np.median(apart)), 0.27, 0.06), least(float(np.median(m.knees.mean(axis=1))), 22, 6))


def fight_stance(m: Motion, side: str) -> float:
    """Stand in guard without striking."""
    guard = every((m.ahead[..., 0] > 0.1) & _between(m.hands[..., 1], (-0.47, 0.22)) & (m.elbows > 35))
    calm = most(float(np.percentile(m.hand_speed.max(axis=1), 95)), 1.9, 0.5)
    upright = least(float(np.median(m.hips)), 0.68, 0.06)
    return min(least(m.most(guard), 0.6, 0.15), stance(m), calm, upright, most(m.path, 0.25 * m.seconds + 0.5, 0.4))


def stab(m: Motion, side: str) -> float:
    """Thrust a hand forward in a line."""
    speed = velocity(m.ahead, m.fps)
    grades = [0.0]
    for k in (0, 1):
        for a, b in runs(speed[:, k, 0] > 0.5):
            a, b = max(a - 1, 0), min(b + 1, m.frames)
            way = m.ahead[a:b, k]
            moved = way[-1] - way[0]
            length = float(np.linalg.norm(np.diff(way, axis=0), axis=-1).sum())
            line = least(float(np.linalg.norm(moved)) / max(length, 1e-6), 0.8, 0.1)
            ahead = least(float(moved[0]) / max(float(np.linalg.norm(moved)), 1e-6), 0.65, 0.15)
            far = min(least(float(moved[0]), 0.25, 0.08), least(float(way[-1, 0]), 0.3, 0.08))
            fast = least(float(speed[a:b, k, 0].max()), 1.5, 0.4)
            low = most(float(m.hands[b - 1, k, 1]), 0.25, 0.1)
            grades.append(min(line, ahead, far, fast, low))
    return min(best(grades), most(m.path, 0.6 * m.seconds + 1, 0.5))


def block(m: Motion, side: str) -> float:
    """Bring a forearm up before chest or face, and keep it there."""
    before = round(0.6 * m.fps)
    grades = [0.0, 0.0]
    near = (m.ahead[..., 0] > 0.12) & _between(m.hands[..., 1], (-0.25, 0.4)) & (np.abs(m.hands[..., 2]) < 0.35)
    for k in (0, 1):
        for a, b in runs(near[:, k] & (m.elbows[:, k] > 45) & (m.still[:, k] < 0.7)):
            came = m.hands[max(a - before, 0) : a + 1, k, 1]
            rise = least(float(m.hands[a:b, k, 1].max() - came.min()), 0.2, 0.07)
            grades[k] = max(grades[k], min(rise, least((b - a) / m.fps, 0.2, 0.1)))
    stands = least(float(np.median(m.hips)), 0.68, 0.06)
    return min(of_side(grades, side), stands, most(m.path, 0.4 * m.seconds + 0.6, 0.4))


def _aims(m: Motion, fastest: float) -> Bool:
    """(T, 2) True where a hand is held ahead at breast to eye height."""
    return (m.ahead[..., 0] > 0.33) & _between(m.hands[..., 1], HIGH) & (m.still < fastest)


def aim(m: Motion, side: str) -> float:
    """Hold a gun ahead."""
    held = _aims(m, 0.35)
    return least(max(m.longest(held[:, k]) for k in (0, 1)), 1.0, 0.25)


def shoot(m: Motion, side: str) -> float:
    """Aim, and be jerked by recoil."""
    held = _aims(m, 1.5)
    window = max(round(0.15 * m.fps), 1)
    grades = [0.0]
    for k in (0, 1):
        for a, b in runs(held[:, k]):
            if b - a > window:
                hand = m.joints[a:b, WRISTS[k]] - m.joints[a:b, CHEST]
                forward, _ = body_frame(hand, m.heading[a:b])
                back = forward[:-window] - forward[window:]
                before = np.concatenate([np.zeros(window), np.abs(back)])[: len(back)]
                jerk = float((back - before).max())
                grades.append(min(least((b - a) / m.fps, 0.9, 0.25), least(jerk, 0.02, 0.008)))
    return min(best(grades), most(m.path, 0.8 * m.seconds + 1, 0.5))


def draw_bow(m: Motion, side: str) -> float:
    """Stretch one arm out, and draw the other hand back from it."""
    gap = np.linalg.norm(m.joints[:, WRISTS[0]] - m.joints[:, WRISTS[1]], axis=-1)
    grades = [0.0, 0.0]
    for bow in (0, 1):
        other = 1 - bow
        far = np.hypot(m.reach[:, bow, 0], m.reach[:, bow, 2])
        held = (far > 0.35) & _between(m.reach[:, bow, 1], (-0.25, 0.3)) & (m.elbows[:, bow] < 60)
        head = np.linalg.norm(m.joints[:, WRISTS[other]] - m.joints[:, HEAD], axis=-1)
        drawn = (np.minimum(np.linalg.norm(m.reach[:, other], axis=-1), head) < 0.34) & (m.elbows[:, other] > 60)
        elbow = m.joints[:, (18, 19)[other], 1] - m.joints[:, (16, 17)[other], 1] > -0.2
        for a, b in runs(held & drawn & elbow):
            near = float(gap[max(a - round(1.5 * m.fps), 0) : b].min())
            wide = least(float(gap[a:b].max()) - near, 0.22, 0.08)
            grades[bow] = max(grades[bow], min(wide, least((b - a) / m.fps, 0.15, 0.1)))
    return min(max(grades), most(m.path, 0.4 * m.seconds + 0.6, 0.4))


def cast_spell(m: Motion, side: str) -> float:
    """Gather the hands, and send something off."""
    window = round(1.2 * m.fps)
    grades = [0.0]
    out = np.hypot(m.ahead[..., 0], m.ahead[..., 2])
    for k in (0, 1):
        gathered = (out[:, k] < 0.36) | (m.hands[:, k, 1] > 0.2)
        for a, b in runs(m.still[:, k] < 0.6):
            first = max(a - window, 0)
            from_where = m.ahead[first : a + 1, k][gathered[first : a + 1]]
            if len(from_where):
                moved = m.ahead[a:b, k].mean(axis=0) - from_where
                sent = np.maximum(moved[:, 0], m.hands[a:b, k, 1].mean() - m.hands[first : a + 1, k, 1].min() - 0.1)
                ahead = min(least(float(m.ahead[a:b, k, 0].max()), 0.25, 0.1), least(float(sent.max()), 0.3, 0.08))
                quick = least(float(m.hand_speed[first : a + 1, k].max()), 0.9, 0.3)
                grades.append(min(ahead, quick, least((b - a) / m.fps, 0.2, 0.1)))
    return min(best(grades), most(m.path, 0.4 * m.seconds + 0.8, 0.4))


def dodge(m: Motion, side: str) -> float:
    """Move the head out of the way at once."""
    head = smooth_seconds(m.joints[:, HEAD], 0.05, m.fps)
    window, before = max(round(0.6 * m.fps), 1), max(round(0.5 * m.fps), 1)
    later = np.lib.stride_tricks.sliding_window_view(head, window + 1, axis=0)[before:] if m.frames > window else None
    if later is None or not len(later):
        return 0.0
    now = head[before : before + len(later)]
    move = np.moveaxis(later, -1, 1) - now[:, None]
    forward, left = body_frame(move, m.heading[before : before + len(later), None])
    level = {"left": left, "right": -left}.get(side, np.hypot(forward, left)).max(axis=1)
    far = level if side in ("left", "right") else np.maximum(level, -move[..., 1].min(axis=1))
    past = np.lib.stride_tricks.sliding_window_view(head, before + 1, axis=0)[: len(later)]
    calm = np.linalg.norm(np.moveaxis(past, -1, 1) - now[:, None], axis=-1).max(axis=1)
    grades = [min(least(float(f), 0.25, 0.08), most(float(c), 0.12, 0.06)) for f, c in zip(far, calm, strict=True)]
    upright = min(least(float(m.hips.min()), 0.5, 0.1), least(float(np.median(m.hips)), 0.7, 0.08))
    calm_hands = most(float(np.percentile(m.hand_speed, 98)), 3.2, 0.8)
    return min(best(grades), upright, calm_hands, most(m.path, 0.5 * m.seconds + 0.8, 0.4))


def flinch(m: Motion, side: str) -> float:
    """Be jerked by a blow, and come back."""
    points = smooth_seconds(m.joints[:, [HEAD, CHEST]], 0.03, m.fps)
    window, back = max(round(0.3 * m.fps), 1), round(2 * m.fps)
    if m.frames <= window + 1:
        return 0.0
    views = np.lib.stride_tricks.sliding_window_view(points, window + 1, axis=0)  # (N, 2, 3, window + 1)
    far = np.linalg.norm(views - views[..., :1], axis=2).max(axis=-1)
    grades = [0.0]
    for a in np.flatnonzero((far[:, 0] > 0.05) & (far[:, 1] > 0.03)):
        later = np.linalg.norm(points[a + window : a + window + back, 0] - points[a, 0], axis=-1)
        limit = 0.6 * float(far[a, 0])
        returns = most(float(later.min(initial=9)), limit, 0.5 * limit)
        before = points[max(a - window, 0) : a + 1, 0] - points[a, 0]
        calm = most(float(np.linalg.norm(before, axis=-1).max()), 0.06, 0.04)
        grades.append(min(least(float(far[a, 0]), 0.08, 0.03), least(float(far[a, 1]), 0.06, 0.03), returns, calm))
    upright = least(float(m.hips.min()), 0.6, 0.1)
    end = least(float(np.median(m.hips[-max(round(0.3 * m.fps), 1) :])), 0.82, 0.06)
    return min(best(grades), upright, end, most(m.path, 0.3 * m.seconds + 0.5, 0.3))


def karate(m: Motion, side: str) -> float:
    """Do three techniques or more in a low, wide stance."""
    kicks = (m.feet > 0.3) & (m.foot_speed > 1.5)
    count = sum(len(_bursts(m.hand_speed[:, k] > 2.0, m.fps)) for k in (0, 1))
    count += sum(len(_bursts(kicks[:, k], m.fps)) for k in (0, 1))
    apart = np.linalg.norm(m.joints[:, ANKLES[0]] - m.joints[:, ANKLES[1]], axis=-1)
    low = max(least(float(np.percentile(apart, 70)), 0.45, 0.1), most(float(np.percentile(m.hips, 30)), 0.9, 0.04))
    return min(least(count, 2.5, 1), low, least(float(np.median(m.joints[:, PELVIS, 1])), 0.6, 0.1))


def _bursts(mask: Bool, fps: float) -> list[int]:
    """Return the beginnings of stretches of a mask, at least 0.3 s apart."""
    found = list[int]()
    for a, _ in runs(mask):
        if not found or a - found[-1] >= 0.3 * fps:
            found.append(a)
    return found
