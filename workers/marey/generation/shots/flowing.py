"""Drawn movements that go on into each other, without a rest between them.

Each movement of a sequence is drawn alone: it begins and ends with a body that stands at rest, or in guard, for a
moment. Behind each other, a blow would be drawn back, the guard let down, and after a second the next one begun. Here
the end of one and the beginning of the next are cut where the bodies are near each other and little time is
lost; in between, the pose passes from one to the other, and feet that stand elsewhere take a step.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.generation.timed import CUT
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth
from marey.motion.rotations import about, normalize, rotate
from marey.posing.limbs import FPS, LEVEL
from marey.posing.standing import ARMS, LEGS, StandingBody, eased
from marey.selector.motion import SHORTEST, Motion
from marey.selector.rules import RULES, is_shown

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

BENT_ON = "bent on"
"""Name of the posture in which a body stays that is hit and does not come upright again, in the record of its row."""
ACTS = 0.6
"""Share of its farthest way from rest behind which a movement comes back, and at which it is under way."""
SLOW = 0.6
"""Metres a second of its fastest joint under which a movement is not yet under way."""
MOST_S = 2.0
"""Seconds of a movement that are left out at most, at either end."""
RESTS_M = 0.05
"""Metres from rest within which a movement has not begun, where what is beside it is not drawn."""
RESTS_SHARE = 0.25
"""The same, as a share of the farthest way of a small movement."""
SINKS_M, BENDS_M = 0.06, 0.05
"""Metres by which the pelvis of a body that is at rest but for its arms is higher or lower than at its end, and by
which its head is elsewhere over it."""
REST_S = 0.15
"""Seconds of rest that are left there."""
TIME = 0.25
"""Metres between two bodies that weigh as much as a second of rest."""
HELD, LOWERED_M = 0.9, 0.2
"""Share of its farthest way from rest in which a body is bent, and metres by which it is lowered when it goes down."""
SPEED = 1.6
"""Metres a second of a joint on the way from one movement to the next at most, if that has the time."""
PASSES = (6, 16)
"""Frames of that way."""
STEPS_M, LIFT_M, SHARE = 0.05, 0.07, 0.62
"""Metres by which a foot that takes a step is moved at least and lifted, and the share of the way that a step takes."""
STEPS_S, METRES_S = 0.35, 0.8
"""Seconds of a way with steps, and more for each metre of the longest."""
STANDS_M, ON_FLOOR_M = 0.6, 0.13
"""Metres of the pelvis of a body that stands at least, and of its lower ankle at most."""
LEAD = 12
"""Frames of a way that belong to the fall or roll behind it: it begins on the feet."""
ONWARD, STRIDE, NEAR = 10, 14, 3
"""Frames of the way out of a walk or run at most, frames near its end that are searched for its beginning, and those
before a body goes down that are searched for its end."""
GOES_M, GOING, SPEED_S = 0.5, 0.8, 0.1
"""Metres a second of a body that goes, at least, the share of its median speed at which it still does, and the standard
deviation of the filter of its speed, seconds."""
FALLS_M, DOWN_M = 0.35, 0.27
"""Metres by which a body that falls or rolls goes down, and by which it is down when it goes on out of a way."""
FLIES_M, LANDS_IN, LANDS_M = 0.12, 6, 0.38
"""Metres of the lowest joint of the feet over the floor from which on a body flies, frames in which it lands, and
metres by which a body that goes on down then is down already."""
WIDE = 110.0
"""Degrees by which an arm turns on that way that passes before the body."""
HEAD = 15
LEAST = 16
"""Frames of a movement that are left at least."""


@dataclass(frozen=True, eq=False)
class JoinedRows:
    """Two movements of which the second goes on from the first.

    Attributes:
        before, after: features (T, D); the way from one to the other is part of `after`.
        entered: frames of that way.
    """

    before: Float32 = field(repr=False)
    after: Float32 = field(repr=False)
    entered: int


def flowing(
    before: Float32,
    after: Float32,
    layout: FeatureLayout,
    *,
    whole: tuple[bool, bool] = (False, False),
    entered: int = 0,
    down: bool = False,
    onward: bool = False,
    landing: bool = False,
) -> JoinedRows | None:
    """Return two drawn movements that go on into each other; None if a body does not stand between them.

    Args:
        before: features (T, D), at 20 fps, on the skeleton of HumanML3D.
        after: the same of the next movement.
        layout: of the features.
        whole: nothing is left out of the first, and of the second.
        entered: frames at the beginning of the first in which it goes on from another one.
        down: the body goes to the floor, or bends on, in the second out of the bent posture of the first.
        onward: the first is a way, out of whose speed the second goes on.
        landing: the first ends on the feet out of the air or off the hands, and the second, in which the body goes
            down, begins there.
    """
    first, second = (layout.decode(each).astype(np.float64) for each in (before, after))
    onward = onward or landing
    if not ((onward or _stands(first[-1])) and _stands(second[0])) or min(len(first), len(second)) < LEAST:
        return None
    if len(first) - entered < LEAST // 2:
        return None
    ends, begins = entered + _ends(first[entered:], whole=whole[0]), _begins(second, whole=whole[1])
    if down:
        ends, begins = (_bent(first), _lowered(second)) if _falls(second) else (_bowed(first), _bending(second))
    if onward:
        ends = _landed(first) if landing else _under_way(first)
        begins = _lowered(second, LANDS_M if landing else DOWN_M)[-NEAR:] if _falls(second) else begins
        if not len(ends):
            return None
    apart = _apart(_at_feet(first)[ends], _at_feet(second)[begins])
    lost = (ends - ends[0])[:, None] + (begins[-1] - begins)[None]
    cost = np.sqrt((apart**2).mean(-1)) + TIME / FPS * lost
    one, other = np.unravel_index(int(cost.argmin()), cost.shape)
    end, begin = int(ends[one]), int(begins[other])
    count = _count(apart[one, other])
    if down and not _falls(second):  # it is as bent all the way
        begin = min(begin + count, int(_bending(second)[-1]))
    second = _beside(first[end], second, begin)
    if onward:
        count = min(count, ONWARD) if _falls(second) else count
        second = second + _ahead(first, second, end, begin, count)
    goes_on = (1, NEAR) if landing else (count, count)
    way = _way(first, second, (end, begin), count, goes_on, onward=onward)
    joints = np.concatenate([first[:end], way, second[begin + 1 :]])
    features = encode_all(layout, joints)
    border = end
    if onward and _falls(second) and not landing:
        border = max(end - LEAD, LEAST // 2)
    elif down and not _falls(second):  # who is hit is bent by it
        border = end + count
    return JoinedRows(features[:border], features[border:], max(count + end - border, 1))


def flowing_as_shown(
    before: Float32,
    after: Float32,
    layout: FeatureLayout,
    actions: tuple[str, str],
    *,
    whole: tuple[bool, bool] = (False, False),
    entered: int = 0,
    landing: bool = False,
) -> JoinedRows | None:
    """Return two drawn movements that go on into each other as `flowing` does, and still show their actions: of one
    that would not, nothing is left out. None if they cannot.

    Args:
        before, after, layout, whole, entered: as of `flowing`.
        landing: as of `flowing`, if both show then.
        actions: their ids in the vocabulary; empty = none that is known.
    """
    first, second = whole
    ways = dict.fromkeys([(first, second), (first, True), (True, second), (True, True)])
    for lands, tried in [*([(True, (first, second))] if landing else []), *((False, way) for way in ways)]:
        joined = flowing(before, after, layout, whole=tried, entered=entered, landing=lands)
        if joined is None and lands:
            continue
        if joined is None:
            return None
        rows = ((before, joined.before, actions[0]), (after, joined.after, actions[1]))
        if all(_shows(cut, layout, action) or not _shows(made, layout, action) for made, cut, action in rows):
            return joined
    return None


def _shows(features: Float32, layout: FeatureLayout, action: str) -> bool:
    """Return True if features show an action by its rule, or it has none."""
    if action not in RULES:
        return True
    return len(features) >= SHORTEST and is_shown(Motion(layout.decode(features), layout.fps), action)


def without_rest(features: Float32, layout: FeatureLayout, action: str = "", *, first: bool, last: bool) -> Float32:
    """Return features (T', D) of a drawn movement without the rest before it, behind it, or both, unless its action
    would not show then."""
    joints = layout.decode(features).astype(np.float64)
    if not (_stands(joints[0]) and _stands(joints[-1])):
        return features
    begin, end, rest = 0, len(joints), round(REST_S * FPS)
    if first and (moved := _moves(joints, 0)):
        begin = min(max(moved[0] - max(rest, CUT), 0), round(MOST_S * FPS))  # a transition replaces as much
    if last and (moved := _moves(joints, -1)):
        end = max(min(moved[-1] + 1 + rest, end), end - round(MOST_S * FPS))
    cut = features[begin:end]
    keeps = _shows(cut, layout, action) or not _shows(features, layout, action)
    return cut if end - begin >= LEAST and keeps else features


def _stands(pose: Array) -> bool:
    ankles = [leg[2] for leg in LEGS.values()]
    return bool(pose[0, 1] > STANDS_M and pose[ankles, 1].min() < ON_FLOOR_M)


def _moves(joints: Array, rest: int) -> list[int]:
    """Return the frames in which a body is away from its pose in frame `rest`."""
    away = _away(joints, rest)
    return np.flatnonzero(away > min(RESTS_M, RESTS_SHARE * float(away.max()))).tolist()


def _away(joints: Array, rest: int) -> Array:
    """Return how far the farthest joint is from its place in frame `rest`, metres (T,)."""
    seen = _at_feet(joints)
    return np.linalg.norm(seen - seen[rest], axis=-1).max(-1)


def _sinks(joints: Array, rest: int) -> NDArray[np.bool_]:
    """Return the frames (T,) in which the pelvis is higher or lower than in frame `rest`, or the trunk is bent."""
    head = _at_feet(joints)[:, HEAD]
    bent = np.linalg.norm(head - head[rest], axis=-1) > BENDS_M
    return bent | (np.abs(joints[:, 0, 1] - joints[rest, 0, 1]) > SINKS_M)


def _ends(joints: Array, *, whole: bool) -> NDArray[np.intp]:
    """Return the frames at which a movement may be left, while it comes back to rest."""
    last = len(joints) - 1
    if whole:
        return np.array([last - PASSES[0]])
    away = _away(joints, -1)
    done = int(np.flatnonzero((away >= ACTS * away.max()) | _sinks(joints, -1))[-1])
    return np.arange(max(min(done, last - 1), last - round(MOST_S * FPS), LEAST // 2), last)


def _begins(joints: Array, *, whole: bool) -> NDArray[np.intp]:
    """Return the frames at which a movement may be entered, before it is under way."""
    if whole:
        return np.array([PASSES[0]])
    away = _away(joints, 0)
    acts = int(np.flatnonzero((away >= ACTS * away.max()) | _sinks(joints, 0))[0])
    speed = np.linalg.norm(np.diff(_at_feet(joints), axis=0), axis=-1).max(-1) * FPS
    acts = int(np.flatnonzero(speed[: max(acts, 1)] < SLOW).max(initial=0)) + 1
    return np.arange(1, max(min(acts, round(MOST_S * FPS), len(joints) - LEAST // 2), 2))


def _bent(joints: Array) -> NDArray[np.intp]:
    """Return the last frame in which a body is as far from rest as it comes."""
    away = _away(joints, -1)
    return np.flatnonzero(away >= HELD * away.max())[-1:]


def _lowered(joints: Array, metres: float = LOWERED_M) -> NDArray[np.intp]:
    """Return the frames in which a body begins to go down."""
    begins = np.flatnonzero(joints[0, 0, 1] - joints[:, 0, 1] > metres)
    return np.arange(1, max(int(begins[0]) if len(begins) else 1, 2))


def _falls(joints: Array) -> bool:
    """Return True if a body goes down to the floor."""
    return bool((joints[0, 0, 1] - joints[:, 0, 1]).max() > FALLS_M)


def _under_way(joints: Array) -> NDArray[np.intp]:
    """Return frames near the end of a way in which a body goes at full speed, and some time on; none where it stands
    still."""
    speed = np.linalg.norm(_velocity(joints), axis=-1)
    if np.median(speed) < GOES_M:
        return np.zeros(0, np.intp)
    last = int(np.flatnonzero(speed >= GOING * np.median(speed))[-1]) - ONWARD // 2
    return np.arange(max(last - STRIDE, LEAST // 2), max(last, LEAST // 2 + 1))


def _landed(joints: Array) -> NDArray[np.intp]:
    """Return the first frames in which a body is on its feet again out of the air or off the hands; none where it never
    was."""
    low = joints[:, [joint for leg in LEGS.values() for joint in leg[2:]], 1].min(axis=1)
    up = np.flatnonzero(low > FLIES_M)
    if not len(up):
        return np.zeros(0, np.intp)
    lands = int(up[-1]) + 1
    return np.arange(lands, min(lands + LANDS_IN, len(joints) - 1))


def _velocity(joints: Array) -> Array:
    """Return the velocity (T, 3) of the pelvis over the floor, metres a second."""
    return smooth(np.gradient(joints[:, 0] * LEVEL, axis=0) * FPS, SPEED_S * FPS)


def _ahead(first: Array, second: Array, end: int, begin: int, count: int) -> Array:
    """Return how far a movement is moved over the floor (3,), metres, so that the pelvis comes to where it begins at a
    speed that changes evenly."""
    goes, comes = _velocity(first)[end], _velocity(second)[begin]
    there = first[end, 0] + (goes + comes) / 2 * (count - 1) / FPS
    return (there - second[begin, 0]) * LEVEL


def _bowed(joints: Array) -> NDArray[np.intp]:
    """Return the last frame in which the head of a body is about as low as it comes."""
    sunk = joints[-1, HEAD, 1] - joints[:, HEAD, 1]
    return np.flatnonzero(sunk >= HELD * sunk.max())[-1:]


def _bending(joints: Array) -> NDArray[np.intp]:
    """Return the frames in which a body that stands comes to be as far from rest as it does."""
    away = _away(joints, 0)
    return np.arange(1, max(int((away >= HELD * away.max()).argmax()), 2))


def _at_feet(joints: Array) -> Array:
    """Return joints (T, 22, 3) from the middle of the ankles on the floor, with +Z ahead."""
    middle = joints[:, [leg[2] for leg in LEGS.values()]].mean(1) * LEVEL
    return rotate(about("Y", -np.radians(heading(joints, FPS)))[:, None], joints - middle[:, None])


def _apart(one: Array, other: Array) -> Array:
    """Return the metres (A, B, 22) between the joints of poses (A, 22, 3) and (B, 22, 3)."""
    return np.linalg.norm(one[:, None] - other[None], axis=-1)


def _count(apart: Array) -> int:
    """Return the frames of the way between poses whose joints are so many metres (22,) apart."""
    steps = float(apart[[leg[2] for leg in LEGS.values()]].max())
    seconds = max(float(apart.max()) / SPEED, STEPS_S + METRES_S * steps if steps > STEPS_M else 0.0)
    return int(np.clip(np.ceil(seconds * FPS), *PASSES))


def _beside(pose: Array, joints: Array, frame: int) -> Array:
    """Return joints (T, 22, 3), moved and turned so that those of a frame stand where a pose (22, 3) does."""
    ankles = [leg[2] for leg in LEGS.values()]
    degrees = heading(pose[None].repeat(2, axis=0), FPS)[0] - heading(joints, FPS)[frame]
    there, here = (each[ankles].mean(0) * LEVEL for each in (pose, joints[frame]))
    return rotate(about("Y", np.radians(degrees)), joints - here) + there


def _way(
    first: Array, second: Array, borders: tuple[int, int], count: int, goes_on: tuple[int, int], *, onward: bool
) -> Array:
    """Return so many joints (count, 22, 3) of the way from frame `end` of one movement to frame `begin` of another, its
    `borders`: both go on meanwhile, for so many frames as `goes_on` says, and the second stands where it goes on;
    `onward`: from one speed to the other."""
    end, begin = borders
    leaves = first[np.minimum(end + np.minimum(np.arange(count), goes_on[0] - 1), len(first) - 1)]
    comes = second[np.maximum(begin + 1 + np.maximum(np.arange(count) - count, -goes_on[1]), 0)]
    share = np.arange(1, count + 1) / (count + 1)
    way = (1 - eased(share))[:, None, None] * leaves + eased(share)[:, None, None] * comes
    if onward:
        time = np.arange(count)[:, None] / FPS
        goes, comes_at = _velocity(first)[end], _velocity(second)[begin]
        pelvis = first[end, 0] + goes * time + (comes_at - goes) * time**2 * FPS / (2 * (count - 1))
        way += ((pelvis - way[:, 0]) * LEVEL)[:, None]
    for side, (feet, _) in steps_between(leaves, comes, share).items():
        way[:, list(LEGS[side][2:])] = feet
    leaves, way, comes = (np.concatenate([leaves[:1], each, comes[-1:]]) for each in (leaves, way, comes))
    body = StandingBody(way)
    for side in ARMS:
        _pass_arm(body, leaves, comes, side)
    return body.solved()[1:-1]


def steps_between(leaves: Array, comes: Array, share: Array) -> dict[str, tuple[Array, NDArray[np.bool_]]]:
    """Return for each side the places (T, 2, 3) of ankle and toe on the way from one stance to the next, and the frames
    (T,) in which the foot steps: the one with the longer way first, and a foot that stays about where it is not at all.

    Args:
        leaves, comes: joints (T, 22, 3) that the way leads from and to, metres.
        share: (T,) of the time of the way, 0 to 1.
    """
    ankles = {side: leg[2] for side, leg in LEGS.items()}
    far = {side: float(np.linalg.norm((comes[-1, at] - leaves[0, at]) * LEVEL)) for side, at in ankles.items()}
    found: dict[str, tuple[Array, NDArray[np.bool_]]] = {}
    for number, side in enumerate(sorted(far, key=lambda each: -far[each])):
        goes = far[side] > STEPS_M
        done = np.clip((share - (1 - SHARE) * number) / SHARE, 0.0, 1.0) if goes else share
        stepped = eased(done)[:, None, None]
        foot = list(LEGS[side][2:])
        places = (1 - stepped) * leaves[:, foot] + stepped * comes[:, foot]
        places[..., 1] += (LIFT_M * goes * np.sin(np.pi * done))[:, None]
        found[side] = places, goes & (done > 0) & (done < 1)
    return found


def _pass_arm(body: StandingBody, leaves: Array, comes: Array, side: str) -> None:
    """Bring an arm from its way in one movement to that in another: bones that point in opposite directions pass before
    the body."""
    _, shoulder, elbow, wrist = ARMS[side]
    share = np.linspace(0.0, 1.0, len(leaves))
    wide = 0.0
    bones = list[Array]()
    for a, b in ((shoulder, elbow), (elbow, wrist)):
        here, there = (normalize(each[:, b] - each[:, a]) for each in (leaves, comes))
        body.joints[:, b] = body.joints[:, a] + leaves[:, b] - leaves[:, a]
        bones.append(body.local(there, side))
        wide = max(wide, float(np.degrees(np.arccos(np.clip((here * there).sum(-1), -1.0, 1.0))).max()))
    body.move_arm(side, eased(share), *bones, lag=0.0, straight=wide < WIDE)
