"""Rules of standing, of ways over the floor, and of turns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from marey.checks.kinematics import turning_points
from marey.motion.feet import runs
from marey.selector.grades import best, every, least, most, share, some
from marey.selector.motion import Motion

IN_PLACE = 0.7
"""Grade of a gait that steps on the spot at most: its words say travel."""


def stays(m: Motion) -> float:
    """Grade that the body hardly travels."""
    return most(m.path, 0.3 * m.seconds + 0.5, 0.3)


def _steps(m: Motion) -> int:
    """Return how often the feet pass each other, or rise one after the other."""
    local, feet = m.foot_local, m.feet
    stride = turning_points(local[:, 0, 0] - local[:, 1, 0], 0.15)
    return max(stride, turning_points(feet[:, 0] - feet[:, 1], 0.06))


def _running(m: Motion) -> float:
    """Grade that there are moments without a standing foot: of a share of the time, or few with bent knees."""
    speed = max(float(np.median(np.hypot(*m.flow.T))), 0.3)
    flight = share(m.step_speed.min(axis=1) > 0.35 * speed + 0.15)
    bent = float(np.median(m.knees.min(axis=1)))
    return max(least(flight, 0.08, 0.04), min(least(flight, 0.015, 0.01), least(bent, 38.5, 5)))


def _forward(m: Motion, slowest: float) -> float:
    """Grade that the body goes the way it faces for most of the time."""
    forward, left = m.travel
    moving = m.flow[:, 0] > 0.2
    far = least(forward, max(0.5, slowest * m.seconds), 0.25)
    return min(far, least(share(moving), 0.55, 0.2), least(forward - abs(left), 0.1, 0.2))


def _straight(m: Motion) -> float:
    return most(abs(m.turn), 45, 15)


def walks(m: Motion) -> float:
    """Grade that the body walks forward, whatever it does beside."""
    return min(_forward(m, 0.25), least(_steps(m), 2.5, 1), 1 - _running(m))


def walk_any_way(m: Motion, side: str) -> float:
    """Walk, straight or not."""
    on_spot = min(_on_spot(m), most(best([f.seconds for f in m.flights]), 0.1, 0.06))
    return min(max(walks(m), on_spot), least(share(m.hips > 0.72), 0.7, 0.2))


def walk(m: Motion, side: str) -> float:
    """Walk."""
    return min(walk_any_way(m, side), _straight(m))


def _on_spot(m: Motion) -> float:
    """Grade of steps in place."""
    lifts = turning_points(m.feet[:, 0] - m.feet[:, 1], 0.06)
    return min(IN_PLACE, least(lifts, 2.5, 1), most(m.path, 0.3 * m.seconds, 0.3))


def on_the_spot(m: Motion, *, runs: bool) -> float:
    """Grade a gait whose words say that it stays in place: feet that rise one after the other, faster in a run."""
    there = min(_on_spot(m) / IN_PLACE, most(m.extent, 1.0, 0.3))
    return min(there, least(_steps(m) / m.seconds, 1.6, 0.4)) if runs else there


def run_any_way(m: Motion, side: str) -> float:
    """Run, straight or not."""
    there = min(_forward(m, 0.5), _running(m), least(float(np.percentile(m.flow[:, 0], 75)), 1.8, 0.4))
    on_spot = min(
        _on_spot(m), least(_steps(m) / m.seconds, 2.2, 0.4), least(best([f.seconds for f in m.flights]), 0.08, 0.06)
    )
    return max(there, on_spot)


def run(m: Motion, side: str) -> float:
    """Run."""
    return min(run_any_way(m, side), _straight(m))


def sprint_any_way(m: Motion, side: str) -> float:
    """Run at 4 m/s, or with 3.2 steps a second in place, straight or not."""
    fast = max(least(float(np.percentile(m.flow[:, 0], 80)), 4, 0.6), least(_steps(m) / m.seconds, 3.2, 0.4))
    return min(run_any_way(m, side), fast)


def sprint(m: Motion, side: str) -> float:
    """Sprint."""
    return min(sprint_any_way(m, side), _straight(m))


def walk_backward_any_way(m: Motion, side: str) -> float:
    """Walk backward, straight or not."""
    back = least(-m.travel[0], max(0.5, 0.2 * m.seconds), 0.25)
    return min(back, least(share(m.flow[:, 0] < -0.12), 0.55, 0.2), least(_steps(m), 1.5, 1))


def walk_backward(m: Motion, side: str) -> float:
    """Walk backward."""
    return min(walk_backward_any_way(m, side), most(abs(m.turn), 60, 20))


def turn(m: Motion, side: str) -> float:
    """Change the direction of a walk or run."""
    return _turns_on_way(m, side, (45, 200))


def turn_around(m: Motion, side: str) -> float:
    """Turn on the spot."""
    return _turns_on_spot(m, side, (70, 270))


def turn_standing(m: Motion, side: str) -> float:
    """Turn on the spot as far as one does on a walk."""
    return _turns_on_spot(m, side, (45, 200))


def turn_by(degrees: float) -> Callable[[Motion, str], float]:
    """Return the rule of a walk or run that turns so far."""
    return lambda m, side: _turns_on_way(m, side, _about(degrees))


def turn_around_by(degrees: float) -> Callable[[Motion, str], float]:
    """Return the rule of a turn on the spot so far."""
    return lambda m, side: _turns_on_spot(m, side, _about(degrees))


def _about(degrees: float) -> tuple[float, float]:
    """Return the bounds of a turn that one calls a turn by some degrees."""
    spare = max(20.0, 0.15 * degrees)
    return degrees - spare, degrees + spare


def _turns_on_way(m: Motion, side: str, bounds: tuple[float, float]) -> float:
    low, high = bounds
    angle = {"left": m.turn, "right": -m.turn}.get(side, abs(m.turn))
    going = min(least(m.path, 0.6, 0.2), least(m.travel[0], 0.4, 0.2))
    return min(least(angle, low, 15), most(angle, high, 30), going)


def _turns_on_spot(m: Motion, side: str, bounds: tuple[float, float]) -> float:
    low, high = bounds
    angle = m.heading - m.heading[0]
    angle = {"left": angle, "right": -angle}.get(side, np.abs(angle))
    return min(least(float(angle[-1]), low, 20), most(float(angle.max()), high, 30), most(m.extent, 0.8, 0.2))


def spin(m: Motion, side: str) -> float:
    """Turn by 300 degrees in one go."""
    speed = np.gradient(m.heading) * m.fps
    turned = [abs(float(m.heading[b - 1] - m.heading[a])) for a, b in runs(np.abs(speed) > 80)]
    return min(least(best(turned), 280, 50), most(m.extent, 1.2, 0.4))


def sidestep(m: Motion, side: str) -> float:
    """Step sideways."""
    forward, left = m.travel
    left = {"left": left, "right": -left}.get(side, abs(left))
    return min(least(left, 0.5, 0.15), least(left - abs(forward), 0.1, 0.15), most(abs(m.turn), 60, 20))


def sneak(m: Motion, side: str) -> float:
    """Step forward low or bent, slowly."""
    low = max(most(float(np.median(m.hips)), 0.93, 0.03), least(float(np.median(m.lean)), 20, 5))
    speed = float(np.median(np.abs(m.flow[:, 0])))
    going = max(least(m.travel[0], max(0.4, 0.12 * m.seconds), 0.25), _on_spot(m))
    return min(low, most(speed, 1.2, 0.2), going, least(_steps(m), 1.5, 1), least(float(np.median(m.hips)), 0.52, 0.05))


def idle(m: Motion, side: str) -> float:
    """Stand and breathe."""
    still = least(share(every(m.hand_speed < 0.5)), 0.6, 0.15)
    down = least(share(every(m.hands[..., 1] < 0)), 0.6, 0.15)
    stays = most(m.extent, 0.15, 0.05)
    upright = min(most(float(np.percentile(m.tilt, 90)), 25, 5), least(share(m.hips > 0.88), 0.7, 0.2))
    return min(still, down, stays, upright, most(abs(m.turn), 50, 20), _planted(m))


def _planted(m: Motion) -> float:
    return least(share(every(m.foot_speed < 0.3)), 0.7, 0.2)


def balance(m: Motion, side: str) -> float:
    """Stand on one foot."""
    return best([_stands_on(m, k) for k in (0, 1) if side != ("left", "right")[1 - k]])


def _stands_on(m: Motion, k: int) -> float:
    mask = (m.feet[:, 1 - k] > 0.1) & (m.feet[:, k] < 0.06) & (m.foot_speed[:, k] < 0.3)
    return least(m.longest(mask), 1.5, 0.4)


def climb_stairs(m: Motion, side: str) -> float:
    """Step up or down stairs."""
    rise = abs(float(m.joints[-1, 0, 1] - m.joints[0, 0, 1]))
    ground = m.feet.min(axis=1)
    return min(
        least(rise, 0.25, 0.08), least(abs(float(ground[-1] - ground[0])), 0.2, 0.08), least(m.travel[0], 0.3, 0.15)
    )


def climb_ladder(m: Motion, side: str) -> float:
    """Climb with hands over the shoulders."""
    up = least(share(some(m.hands[..., 1] > -0.2)), 0.5, 0.2)
    feet = least(float(np.ptp(m.feet.min(axis=1))), 0.25, 0.1)
    return min(up, feet, least(float(np.ptp(m.joints[:, 0, 1])), 0.3, 0.1), most(m.extent, 0.9, 0.3))
