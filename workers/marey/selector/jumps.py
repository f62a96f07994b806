"""Rules of jumps."""

from __future__ import annotations

from marey.checks.kinematics import turning_points
from marey.motion.feet import runs
from marey.selector.grades import best, least, most
from marey.selector.motion import OFF_FLOOR, AirPhase, Motion


def _together(flight: AirPhase) -> float:
    """Grade that both feet leave the floor at once."""
    return most(flight.apart, 0.17, 0.07)


def jump(m: Motion, side: str) -> float:
    """Jump up."""
    return best([min(least(f.height, 0.1, 0.04), most(f.distance, 0.7, 0.2), _together(f)) for f in m.flights])


def jump_forward(m: Motion, side: str) -> float:
    """Jump ahead."""
    far = [min(least(f.height, 0.06, 0.03), least(f.distance, 0.5, 0.15), _together(f)) for f in m.flights]
    return min(best(far), least(m.travel[0], 0.4, 0.2))


def leap(m: Motion, side: str) -> float:
    """Jump from one foot to the other."""
    return best(
        [min(least(f.seconds, 0.22, 0.06), least(f.distance, 0.8, 0.15), least(f.apart, 0.1, 0.06)) for f in m.flights]
    )


def hop(m: Motion, side: str) -> float:
    """Hop on one foot."""
    return best([_hops(m, k) for k in (0, 1) if side != ("left", "right")[1 - k]])


def _hops(m: Motion, k: int) -> float:
    """Grade of hops of one foot while the other stays up: how long it stays so before, in and after a flight."""
    feet = m.feet
    off = feet[:, k] > OFF_FLOOR
    grades = [0.0]
    for a, b in runs(feet[:, 1 - k] > 0.05):
        for begin, end in runs(off[a:b]):
            if begin and end < b - a and end - begin >= 0.08 * m.fps:
                around = min(begin, b - a - end) / m.fps
                grades.append(
                    min(least(float(feet[a + begin : a + end, k].max()), 0.06, 0.02), least(around, 0.06, 0.04))
                )
    return best(grades)


def jump_turn(m: Motion, side: str) -> float:
    """Jump and turn in the air."""

    def angle(flight: AirPhase) -> float:
        return {"left": flight.turn, "right": -flight.turn}.get(side, abs(flight.turn))

    return best([min(least(f.height, 0.08, 0.04), least(angle(f), 80, 20), _together(f)) for f in m.flights])


def jumping_jacks(m: Motion, side: str) -> float:
    """Swing arms over the shoulders and feet apart, together, twice."""
    arms = turning_points(m.hands[..., 1].min(axis=1), 0.4)
    apart = abs(m.foot_local[:, 0] - m.foot_local[:, 1])[:, 2]
    return min(least(arms, 2.5, 1), least(turning_points(apart, 0.15), 2.5, 1))
