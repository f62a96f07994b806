"""Heads, trunks and arms that live: what people add to a movement without being told.

Which way a head faces does not show in the joints that a network learned from, and what is drawn moves the parts that
it needs, both arms by one clock. So a head looks a little here and there, keeps facing ahead while the chest swings,
and turns first where the body is going to turn. In what is drawn the chest follows the arms, and one arm comes a
little after the other, the forearm after the upper arm. All of it is small, comes from the seed, and is left out where
the words say where the head turns or that a pose is held, and where hands touch the floor, the body or each other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from marey.generation.gazing import GAZE, SHARES, TRUNK
from marey.generation.port import Request
from marey.generation.shots.freezing import says_frozen
from marey.generation.timed import worded_seed
from marey.motion.body import STATURE, stature
from marey.motion.clip import MotionClip
from marey.motion.filters import smooth, smooth_above, smoothstep
from marey.motion.hands import arms
from marey.motion.kinematics import UP, facing, forward_kinematics, global_rotations
from marey.motion.resample import interpolate_rotations
from marey.motion.rotations import Array, conjugate, dot, from_rotvec, length, multiply, rotate, to_rotvec, unroll
from marey.vocabulary.held_poses import held_pose

QUIET = frozenset({"nod", "balance", "arabesque", "flinch"})
"""Actions and bearings whose head, or whole pose, is what they are."""
HOLDS_ON = frozenset({"climb-ladder", "climb-onto", "hang", "drive", "push", "push-ups", "draw-bow", "aim"})
"""Actions whose hands are on a thing, or are to be where they are put."""
PASSES_S = 0.25
"""Standard deviation of the filter by which a body comes to life between two movements, seconds."""
UPRIGHT = (0.55, 0.85)
"""Cosines of the lean of a chest: a head lives in full from the second on, and not at all below the first."""
LOOKS, LOOKS_S, LOOKS_PASS_S = (5.0, 2.5, 1.5), (0.8, 2.2), 0.14
"""Degrees to the left, down and aside by which a head looks somewhere else at most, seconds for which it looks there,
and the standard deviation of the filter of its turns."""
DRIFTS, DRIFTS_S = 1.0, (0.9, 2.2)
"""Degrees by which a head that rests drifts at most, and the seconds that this takes."""
LYING = 0.5
"""Share of that which a body that is not upright leaves out."""
STEADY, STEADY_S, MOST_STEADY = 0.7, 0.5, 8.0
"""Share of a chest's swing that a head does not follow, standard deviation of the filter that tells its swing from its
turn, seconds, and degrees at most."""
LEADS_S, LEADS, MOST_LEAD = 0.22, 0.7, 22.0
"""Seconds by which a head is ahead of a turn, the share of that, and degrees at most."""
FOLLOWS, MOST_FOLLOWS, FOLLOWS_PASS_S = 9.0, 5.0, 0.1
"""Degrees by which a chest turns for each metre by which one hand is ahead of the other, at most, and the standard
deviation of the filter of that, seconds."""
SWAYS, SWAYS_S = (2.4, 1.1, 1.4), (1.2, 2.8)
"""Degrees to the left, down and aside by which a chest sways, and the seconds that it takes."""
LATER_S, FOREARM_S = (0.025, 0.055), (0.02, 0.04)
"""Seconds by which one arm comes after the other, and a forearm after its upper arm."""
APART, APART_S = (2.5, 2.0, 1.5), (1.7, 4.0)
"""Degrees about each axis by which an arm is not where the other one is, at most, and the seconds that this takes to
change."""
MEETS, TOUCHES, FLOOR = (0.36, 0.56), (0.2, 0.3), (0.15, 0.4)
"""Metres from hand to hand, from a hand to head or knees, and from the floor, of a body of `STATURE`: arms lag in full
from the second on, and not at all below the first."""
NEAR_S = 0.12
"""Standard deviation of the filter of those, seconds."""


@dataclass(frozen=True)
class _Span:
    """Frames of one movement.

    Attributes:
        quiet: its head, trunk and arms stay as they are.
        drawn: it is drawn.
        holds_on: its arms stay as they are.
    """

    begin: int
    end: int
    quiet: bool
    drawn: bool
    holds_on: bool


def with_life(clip: MotionClip, request: Request) -> MotionClip:
    """Return a generated clip with a head, a trunk and arms that live; feet and contacts stay. Motions around kept
    frames and recordings of streams are as they were.

    Args:
        clip: finished, on the joints of HumanML3D, with what was drawn in its manifest.
        request: for it.
    """
    if request.kept or request.free or request.recording is not None:
        return clip
    shares = np.zeros((clip.frames, 3))
    shares[:, 0] = 1.0
    for span in _spans(clip, request):
        drawn = span.drawn and not span.quiet
        shares[span.begin : span.end] = not span.quiet, drawn, drawn and not span.holds_on
    living, trunk, hands = smooth(shares, PASSES_S * clip.fps).T
    body = _Living(clip, np.random.default_rng(worded_seed(request.seed, request.text.said)))
    body.sway(trunk, hands)
    body.look(living)
    joints = forward_kinematics(clip.skeleton, body.rotations, clip.root).astype(np.float32)
    return replace(clip, rotations=unroll(body.rotations).astype(np.float32), joints=joints)


def _spans(clip: MotionClip, request: Request) -> Iterator[_Span]:
    """Yield the movements of a clip: the rows of its timeline, or all of it."""
    if request.timeline is None:
        yield _span(0, clip.frames, request.text.said, clip.manifest)
        return
    for row, record in zip(request.timeline, clip.manifest["timeline"]["rows"], strict=True):
        begin, end = (min(round(at * clip.fps), clip.frames) for at in (row.start, row.end))
        yield _span(begin, end, row.text.said, record)


def _span(begin: int, end: int, said: str, record: Mapping[str, Any]) -> _Span:
    drawn = record.get("drawn")
    shown = {drawn, *(each["name"] for each in record.get("bearing", ()))}
    quiet = GAZE in record or bool(shown & QUIET) or held_pose(said) is not None or says_frozen(said)
    return _Span(begin, end, quiet, drawn is not None, drawn in HOLDS_ON)


class _Living:
    """A clip while its body comes to life."""

    def __init__(self, clip: MotionClip, rng: np.random.Generator) -> None:
        self.clip, self.fps, self.rng = clip, clip.fps, rng
        self.rotations = clip.rotations.astype(np.float64)
        self.joints = clip.joints.astype(np.float64)
        self.size = stature(clip.skeleton) / STATURE
        self.time = np.arange(clip.frames) / clip.fps
        self.chest = global_rotations(clip.skeleton, self.rotations)[:, self._joint(TRUNK[-1])]
        low, high = UPRIGHT
        up = rotate(self.chest, np.broadcast_to(UP, self.joints[:, 0].shape))[:, 1]
        self.upright = smooth(smoothstep(np.clip((up - low) / (high - low), 0.0, 1.0))[:, None], NEAR_S * self.fps)
        """(T, 1) how upright the chest is, 0 to 1."""

    def look(self, living: Array) -> None:
        """Turn neck and head, by a share (T,)."""
        yaw, pitch = self._heading()
        way = smooth(yaw[:, None], LOOKS_PASS_S * self.fps)[:, 0]
        ahead = np.interp(self.time + LEADS_S, self.time, way) - way
        turned = [np.clip(-STEADY * self._swing(each), -MOST_STEADY, MOST_STEADY) for each in (yaw, pitch)]
        turned[0] += np.clip(LEADS * ahead, -MOST_LEAD, MOST_LEAD)
        degrees = (1.0 - LYING * (1.0 - self.upright)) * self._looks()
        degrees[:, :2] += self.upright * np.stack(turned, axis=-1)
        for name, share in SHARES.items():
            self._turn(name, share * living[:, None] * degrees)

    def sway(self, trunk: Array, hands: Array) -> None:
        """Let the chest follow the arms, and the arms differ, by shares (T,)."""
        if not (trunk[:, None] * self.upright).any():
            return
        hands = hands * self.upright[:, 0]
        shares = [hands * self._free(side) for side in (0, 1)]
        degrees = np.stack([most * self._wander(SWAYS_S) for most in SWAYS], axis=-1)
        degrees[:, 0] += self._followed()
        degrees *= trunk[:, None] * self.upright
        for name in TRUNK:
            self._turn(name, degrees / len(TRUNK))
        later = self.rng.uniform(*LATER_S) * self.rng.permutation([0.0, 1.0])
        for arm, lag, share in zip(arms(self.clip.skeleton), later, shares, strict=True):
            self._lag(arm, lag, share)
            self._keep(arm)

    def _joint(self, name: str) -> int:
        return self.clip.skeleton.index(name)

    def _turn(self, name: str, degrees: Array) -> None:
        """Turn a joint by (T, 3) degrees to the left, down and to the side."""
        joint = self._joint(name)
        self.rotations[:, joint] = multiply(_turns(degrees), self.rotations[:, joint])

    def _heading(self) -> tuple[Array, Array]:
        """Return degrees (T,) to the left and down of where the chest faces, without jumps."""
        ahead = rotate(self.chest, np.broadcast_to([0.0, 0.0, 1.0], self.joints[:, 0].shape))
        yaw = np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2]))
        return np.degrees(yaw), np.degrees(np.arcsin(np.clip(-ahead[:, 1], -1.0, 1.0)))

    def _swing(self, degrees: Array) -> Array:
        """Return what a curve (T,) has beside its slow part."""
        return degrees - smooth(degrees[:, None], STEADY_S * self.fps)[:, 0]

    def _looks(self) -> Array:
        """Return degrees (T, 3) by which a head looks here and there: it turns, and nearly rests for a while."""
        ends = np.cumsum(self.rng.uniform(*LOOKS_S, size=int(self.time[-1] / LOOKS_S[0]) + 2))
        sides = self.rng.choice([-1.0, 1.0], size=(len(ends), 3))
        places = sides * self.rng.uniform(0.4, 1.0, size=(len(ends), 3)) * LOOKS
        at = np.minimum(np.searchsorted(ends, self.time), len(ends) - 1)
        drift = np.stack([DRIFTS * self._wander(DRIFTS_S) for _ in LOOKS], axis=-1)
        return smooth(places[at], LOOKS_PASS_S * self.fps) + drift

    def _wander(self, seconds: tuple[float, float]) -> Array:
        """Return a slow curve (T,) from -1 to 1."""
        waves = [np.sin(2 * np.pi * (self.time / self.rng.uniform(*seconds) + self.rng.random())) for _ in range(2)]
        return 0.5 * (waves[0] + waves[1])

    def _followed(self) -> Array:
        """Return degrees (T,) to the left by which the chest follows the hand that is ahead of the other."""
        right, left = self._wrists()
        apart = dot(right - left, facing(self.joints, self.clip.skeleton)) / self.size
        turned = np.clip(FOLLOWS * apart, -MOST_FOLLOWS, MOST_FOLLOWS)
        return smooth(turned[:, None], FOLLOWS_PASS_S * self.fps)[:, 0]

    def _free(self, side: int) -> Array:
        """Return how free a hand is (T,), 0 to 1: of the other one, of head and knees and of the floor."""
        own = self._wrists()[side]
        touched = [self.joints[:, self._joint(name)] for name in ("head", "L_knee", "R_knee")]
        shares = [self._apart(), self._over(own[:, 1], FLOOR)]
        return np.min([*shares, *(self._over(length(own - each), TOUCHES) for each in touched)], axis=0)

    def _apart(self) -> Array:
        """Return how far the hands are from each other (T,), 0 to 1."""
        right, left = self._wrists()
        return self._over(length(right - left), MEETS)

    def _wrists(self) -> tuple[Array, Array]:
        (*_, right), (*_, left) = arms(self.clip.skeleton)
        return self.joints[:, right], self.joints[:, left]

    def _over(self, metres: Array, bounds: tuple[float, float]) -> Array:
        """Return a smooth share (T,) of a distance between two bounds of a body of `STATURE`."""
        low, high = bounds
        share = smoothstep(np.clip((metres / self.size - low) / (high - low), 0.0, 1.0))
        return 1.0 - smooth_above(1.0 - share, NEAR_S * self.fps)

    def _lag(self, arm: tuple[int, int, int], seconds: float, free: Array) -> None:
        """Let an arm come later and its forearm later still, and be a little elsewhere, by a share (T,)."""
        shoulder, elbow, _ = arm
        frames = np.arange(len(free), dtype=np.float64)
        for joint, lag in ((shoulder, seconds), (elbow, seconds + self.rng.uniform(*FOREARM_S))):
            times = np.maximum(frames - free * lag * self.fps, 0.0)
            self.rotations[:, joint] = interpolate_rotations(self.rotations[:, joint], times)
        apart = np.stack([most * self._wander(APART_S) for most in APART], axis=-1)
        self.rotations[:, shoulder] = multiply(_turns(free[:, None] * apart), self.rotations[:, shoulder])

    def _keep(self, arm: tuple[int, int, int]) -> None:
        """Point an arm where it did before the trunk turned; hands that are together go with the trunk."""
        skeleton, shoulder = self.clip.skeleton, arm[0]
        world = global_rotations(skeleton, self.rotations)[:, self._joint(TRUNK[-1])]
        moved = multiply(conjugate(world), self.chest)  # in the chest's own axes
        above = self.rotations[:, skeleton.parents[shoulder]]
        back = to_rotvec(multiply(multiply(conjugate(above), moved), above))
        local = from_rotvec(self._apart()[:, None] * back)
        self.rotations[:, shoulder] = multiply(local, self.rotations[:, shoulder])


def _turns(degrees: Array) -> Array:
    """Return rotations (T, 4) by degrees (T, 3) to the left, down and to the side."""
    return from_rotvec(np.radians(degrees[:, [1, 0, 2]]))
