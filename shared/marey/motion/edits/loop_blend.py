"""A cycle of a motion whose end meets its beginning: before its last frame it fades into the movement before its first.

The frame after the last is the one after the first, moved on by the travel of a cycle. So the last frames fade from the
source to the frames before `first`, moved on in the same way: at the end places, speeds and accelerations agree. Where
the source begins too late for that, the frames before it are the movement after its beginning, turned round there:
places and speeds agree, and of these frames the blend shows the least. The seam of the loop may be anywhere in the
blend. A blend may also show a fraction of a frame less than it is long: joints move less in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from marey.motion.clip import MotionClip
from marey.motion.edits.loop_search import Cycle
from marey.motion.filters import smootherstep
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.legs import foot_chain, two_bone_knee
from marey.motion.pose import aim_bones
from marey.motion.resample import interpolate, interpolate_rotations
from marey.motion.rotations import (
    Array,
    about,
    conjugate,
    length,
    multiply,
    normalize,
    rotate,
    slerp,
    unroll,
)

Bool = NDArray[np.bool_]
STANDING = 30.0
"""Weight of a standing joint beside the others in the travel of a cycle."""


@dataclass(frozen=True, eq=False)
class Travel:
    """Way of a cycle: a turn about the vertical axis of the origin, then a shift on the floor.

    Attributes:
        angle: radians.
        shift: (3,) metres.
    """

    angle: float
    shift: Array = field(repr=False)

    @property
    def turn(self) -> Array:
        """(4,) quaternion."""
        return about("Y", self.angle)

    def back(self) -> Travel:
        """Return the way from a cycle to the one before."""
        return Travel(-self.angle, -rotate(about("Y", -self.angle), self.shift))

    def places(self, places: Array) -> Array:
        """Move places (..., 3)."""
        return rotate(self.turn, places) + self.shift

    def turns(self, rotations: Array) -> Array:
        """Turn local rotations (..., J, 4) of bodies in the world."""
        moved = np.array(rotations, np.float64)
        moved[..., 0, :] = multiply(self.turn, moved[..., 0, :])
        return moved


@dataclass(frozen=True, eq=False)
class Closed:
    """A closed cycle.

    Attributes:
        rotations, root, contacts: of its frames from `first` to `last`, both included; the last is the first, moved.
        travel: from a cycle to the next.
        blend: number of frames before the last that differ from the source.
        room: largest number of frames by which the cycle can begin earlier: there are no more in the source.
        earlier: number of frames by which the seam is before the end of the blend.
        hitch: largest measure of the seam over what does not show; above 1 a joint moves most just there.
    """

    rotations: Array = field(repr=False)
    root: Array = field(repr=False)
    contacts: Bool = field(repr=False)
    travel: Travel
    blend: int
    room: int
    earlier: int = 0
    hitch: float = 0.0

    def begun(self, earlier: int) -> Closed:
        """Return the cycle with its seam some frames earlier: they come before the first one, moved back."""
        if not earlier:
            return self
        back = self.travel.back()
        own = slice(len(self.root) - 1 - earlier, len(self.root) - 1)
        rotations = unroll(np.concatenate([back.turns(self.rotations[own]), self.rotations[:-earlier]]))
        root = np.concatenate([back.places(self.root[own]), self.root[:-earlier]])
        contacts = np.concatenate([self.contacts[own], self.contacts[:-earlier]])
        return replace(self, rotations=rotations, root=root, contacts=contacts, earlier=earlier)


def travel_of_cycle(clip: MotionClip, contacts: Bool, cycle: Cycle, slower: float = 0.0) -> Travel:
    """Return the way from the first pose to the last: standing feet stay where they are.

    The turn fits all joints on the floor plane, the shift those feet that stand in both frames, or else all joints.

    Args:
        slower: frames by which the last pose is before the last frame.
    """
    from_ = clip.joints[cycle.first].astype(np.float64)
    to = interpolate(clip.joints.astype(np.float64), np.array([cycle.last - slower]))[0]
    first, last = from_[:, [0, 2]], to[:, [0, 2]]
    weights = np.ones(len(first))
    both = contacts[cycle.first] & contacts[cycle.last]
    held = [joint for joint, stays in zip(clip.skeleton.feet, both, strict=True) if stays]
    weights[held] = STANDING
    weights /= weights.sum()
    a, b = (points - weights @ points for points in (first, last))
    cosine, sine = (weights @ (a * b)).sum(), (weights @ (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]))
    angle = float(np.arctan2(sine, cosine))
    gaps = to - rotate(about("Y", angle), from_)
    shift = (gaps[held] if held else gaps).mean(axis=0) * np.array([1.0, 0.0, 1.0])
    return Travel(angle, shift)


def closed(clip: MotionClip, contacts: Bool, cycle: Cycle, window: int, slower: float = 0.0) -> Closed:
    """Return the cycle with its last `window` frames blended.

    Args:
        slower: frames that the blend shows less of the source than it is long: it is slower, so that joints move less
            at the seam.
    """
    window = min(window, cycle.last - cycle.first - 1)
    travel = travel_of_cycle(clip, contacts, cycle, slower)
    whole = slice(cycle.first, cycle.last + 1)
    rotations = unroll(clip.rotations[whole].astype(np.float64))
    root = clip.root[whole].astype(np.float64)
    feet = contacts[whole].copy()
    end = slice(len(root) - 1 - window, len(root))
    (rotations[end], root[end]), feet[end] = _cross_faded(clip, contacts, travel, cycle, window, slower)
    rotations[-1], root[-1] = travel.turns(rotations[0]), travel.places(root[0])
    feet[-1] = feet[0]
    return Closed(unroll(rotations), root, feet, travel, window, min(window, cycle.first))


def _cross_faded(
    clip: MotionClip, contacts: Bool, travel: Travel, cycle: Cycle, window: int, slower: float
) -> tuple[tuple[Array, Array], Bool]:
    """Fade from the last frames to those before the first, moved by the travel; feet keep to the paths of both."""
    frames = np.arange(window + 1.0)
    share = smootherstep(frames / window)
    times = frames - window - slower * share
    mine, begun = cycle.last + times, cycle.first + slower + times
    (rotations, root), (theirs, place) = (_at(clip, each) for each in (mine, begun))
    theirs, place = travel.turns(theirs), travel.places(place)
    mixed = slerp(rotations, theirs, share[:, None])
    middle = root + share[:, None] * (place - root)
    joints = [forward_kinematics(clip.skeleton, r, p) for r, p in ((rotations, root), (theirs, place))]
    wanted = joints[0] + share[:, None, None] * (joints[1] - joints[0])
    later = frames > window / 2
    stands = np.where(later[:, None], *(contacts[np.rint(np.abs(each)).astype(np.intp)] for each in (begun, mine)))
    return (with_feet(clip, mixed, middle, wanted), middle), stands


def _at(clip: MotionClip, times: Array) -> tuple[Array, Array]:
    """Return rotations (n, J, 4) and root (n, 3) at times (n,), counted in frames; before the first frame, those of the
    movement after it, turned round there."""
    after = np.abs(times)
    whole = np.rint(after).astype(np.intp)
    if np.array_equal(whole, after):
        rotations, root = clip.rotations[whole].astype(np.float64), clip.root[whole].astype(np.float64)
    else:
        rotations = interpolate_rotations(clip.rotations, after)
        root = interpolate(clip.root.astype(np.float64), after)
    early = times < 0
    begin = clip.rotations[0].astype(np.float64)
    rotations[early] = multiply(multiply(begin, conjugate(rotations[early])), begin)
    root[early] = 2 * clip.root[0].astype(np.float64) - root[early]
    return rotations, root


def with_feet(clip: MotionClip, rotations: Array, root: Array, wanted: Array) -> Array:
    """Return the rotations (n, J, 4) with legs that put the feet at wanted places, as far as they reach.

    Args:
        wanted: (n, J, 3) metres; only the joints of the feet are read.
    """
    tree = clip.skeleton
    joints = forward_kinematics(tree, rotations, root)
    ahead = facing(joints, tree)
    for hip, toe in zip((tree.facing[1], tree.facing[0]), tree.feet[1::2], strict=True):
        chain = foot_chain(tree, toe)
        knee, ankle = tree.children[hip][0], chain[-1]
        leg = joints[:, [hip, knee, ankle]]
        bent = two_bone_knee(leg, leg[:, 0], wanted[:, ankle], ahead)
        shank = length(leg[:, 2] - leg[:, 1])[:, None]
        joints[:, knee] = bent
        joints[:, ankle] = bent + shank * normalize(wanted[:, ankle] - bent)
        for child in chain[-2::-1]:
            parent, bone = tree.parents[child], float(np.linalg.norm(tree.offsets[child]))
            joints[:, child] = joints[:, parent] + bone * normalize(wanted[:, child] - wanted[:, parent])
    return aim_bones(joints, rotations, tree)
