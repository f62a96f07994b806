"""Gaits that a network does not know, drawn on walks: limps, staggers, high knees, skips, stomps, steps on the toes,
feet that are dragged, and feet on one line; and, drawn on a body that stands, a foot that taps, weight that goes from
one foot to the other, and hops over a rope.

A limp hurries over the leg that hurts, and the body dips towards it; who staggers goes in curves, now faster and now
slower. Frames are played at other times, so standing feet stay. Knees are lifted while their feet pass the other ones;
who skips hops on the standing foot meanwhile.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from marey.generation.turned import bent_along
from marey.motion.courses import natural_course
from marey.motion.features import FeatureLayout
from marey.motion.filters import smooth_seconds
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import BONE_LENGTHS, GRAVITY
from marey.posing.standing import LEFT, LEGS, OTHER_SIDE, RIGHT, StandingBody, eased
from marey.vocabulary.bearings import Gait

Array = NDArray[np.floating]

ANKLES = {LEFT: 7, RIGHT: 8}
STEP = 0.015
"""Metres a frame by which a standing foot falls behind the other in a walk, at least."""
HURRIES, LINGERS = 0.75, 0.28
"""By how much the time of a limp runs faster over the leg that hurts, and slower over the other."""
DIP, ASIDE, AHEAD = 0.045, 9.0, 7.0
"""Metres by which the hips sink over the leg that hurts, and degrees by which the trunk leans to it, and forward."""
WEAVES, WEAVES_HZ = 46.0, (0.2, 0.28)
"""Degrees by which a staggering body leaves its way to each side, and how often a second."""
WEAVES_EASES_S = 0.8
"""Seconds in which it leaves its way, and comes back to it."""
WEAVES_AT = 0.4
"""Metres a second from which on it does so in full: who stands would slide on the feet."""
UNEVEN, UNEVEN_HZ = 0.5, 0.5
"""By how much its time runs faster and slower, and how often a second."""
WANDERS, ROCKS = 0.09, 0.05
"""Metres by which its hips go to the sides of its feet, and to and fro."""
LURCHES, LURCH_S, LURCH_EVERY = (11.0, 0.05), 0.22, (1.6, 2.6)
"""Degrees by which its trunk falls forward as it loses its balance, and metres by which it sinks; how long that takes
(standard deviation), and seconds from one to the next."""
WIDE = 0.045
"""Metres by which each of its feet is set further out."""
KNEE_UP, KNEE_SKIPS, KNEE_STOMPS = 78.0, 58.0, 64.0
"""Degrees of a lifted thigh from the vertical: in a march with high knees, a skip, and a stomp."""
STOMPS, STOMP_FALLS_S, STAMP_S = 0.05, 0.25, 0.75
"""Metres by which the hips of a stomping body drop where a foot comes down, seconds in which it does so, and seconds
from one stamp of a body that stands to the next."""
DRAGS, DRAGS_LOW = 0.12, 0.015
"""Share that is left of the height to which a dragged foot rises, and metres by which the hips sink for it."""
ROPE_S, ROPE_AIR, ROPE_UP, ROPE_DIP = 0.44, 0.55, 0.085, 0.035
"""Seconds of a hop over a rope, the share of them in the air, and metres by which the body rises, and sinks between."""
TOES_DOWN = 0.025
"""Metres by which the toes of who hops hang below where they stand."""
HEELS_UP, TIPTOE_LEG, TIPTOE_UPRIGHT = 42.0, 0.965, 1.35
"""Degrees by which the feet of who goes on the toes point further down, the longest that a leg gets as a share of its
length, and degrees by which the spine is bent back for each one by which hips and neck lean."""
TIPTOE_RISE = 0.22
"""Metres by which its hips rise at most over those of the walk below, which may be a crouched one."""
SHANK_BACK = 14.0
"""Degrees by which the shank below it hangs back."""
APART = 0.03
"""Metres by which a lifted foot is outward of its hip."""
LIFTS_S = 0.07
"""Standard deviation of the filter by which a knee comes up, seconds."""
UP_FIRST = 1.5
"""By how much a foot rises before it goes ahead: it would slide."""
HOP_AIR, HOP_FROM, LANDS_S = 0.55, 0.6, 0.1
"""Share of each step of who skips that it is in the air, the share of the lift of the other knee from which on a step
is one, and seconds in which it sinks before its first hop and after the last one."""
STILL = 0.15
"""Metres a second of the hips, under which a body stands."""
SHIFTS, SHIFTS_HZ, SHIFTS_RESTS = 0.075, (0.17, 0.24), 1.8
"""Metres by which the hips of a restless body go over each foot, how often a second, and how long it rests there."""
LEAST_SHIFTS, SHIFTS_FASTEST_HZ = 1.25, 0.42
"""Ways over both feet and back in a motion at least, and how often a second they are made for that at most."""
SHIFTS_SINK, SHIFTS_LEAN = 0.012, 3.0
"""Metres by which they sink on the way, and degrees by which the trunk leans back to the middle."""
ON_LINE, ON_LINE_PASSES = 0.85, 0.6
"""Share of the distance of each foot from the middle by which who walks on a line is nearer to it, and share of that
by which it is not while it passes the other."""
TAPS, TAPS_HZ, TAPS_S = 0.05, 2.6, (1.6, 1.0)
"""Metres by which the toes of a tapping foot rise, how often a second, and seconds of tapping and of rest."""


def limping(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a walk, of which the frames `begin` to `end` limp.

    Args:
        joints: metres.
        layout: of the motion, for its rate.
        begin, end: first frame, and the one after the last.
        side: of the leg that hurts; any but `left` and `right` = either.
        rng: chooses it.
    """
    hurt = side if side in ANKLES else str(rng.choice(list(ANKLES)))
    body = StandingBody(joints)
    over, other = (_stands(body, each, layout.fps) for each in (hurt, OTHER_SIDE[hurt]))
    inside = _inside(len(joints), begin, end, layout.fps)
    dips = inside * smooth_seconds(over, 0.06, layout.fps)
    rate = 1.0 + inside * (HURRIES * over - LINGERS * other)
    body.shift(-DIP * dips)
    body.lean((1.0 if hurt == RIGHT else -1.0) * ASIDE * dips, "forward")
    body.lean(AHEAD * dips, "left")
    return _retimed(body.solved(), smooth_seconds(rate, 0.06, layout.fps), begin, end)


def staggering(
    joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator
) -> Array:
    """Return joints (T, 22, 3) of a walk, of which the frames `begin` to `end` stagger; see `limping`."""
    del side  # a body staggers to both
    inside, time = _inside(len(joints), begin, end, layout.fps), np.arange(len(joints)) / layout.fps
    hz, phase = rng.uniform(*WEAVES_HZ), rng.uniform(0, 2 * np.pi)
    natural = natural_course(joints, layout.skeleton, layout.fps)
    edges = np.minimum(time - begin / layout.fps, (end - 1) / layout.fps - time)
    way = eased(edges / WEAVES_EASES_S) * np.clip(_speed(joints, layout.fps) / WEAVES_AT, 0.0, 1.0)
    swings = np.sin(2 * np.pi * max(hz, layout.fps / (end - begin)) * time + phase)
    swings -= np.sum(way * swings) / max(np.sum(way), 1e-9)  # it comes to the side on which it would walk straight
    weaves = np.radians(WEAVES) * way * swings
    woven = bent_along(joints, layout, natural, natural.facing(natural.headings + weaves))
    body = StandingBody(woven)
    lurch = inside * _lurches(time, rng)
    for leg, (_, _, ankle, toe) in LEGS.items():
        out = np.stack([WIDE * inside, np.zeros_like(time), np.zeros_like(time)], axis=-1)
        body.joints[:, [ankle, toe]] += body.world(out, leg)[:, None]
    body.shift(
        -LURCHES[1] * lurch,
        ROCKS * inside * np.sin(2 * np.pi * 1.7 * hz * time + 2 * phase),
        WANDERS * inside * np.sin(2 * np.pi * 1.3 * hz * time + phase),
    )
    body.lean(LURCHES[0] * lurch, "left")
    rate = 1.0 + UNEVEN * inside * np.sin(2 * np.pi * UNEVEN_HZ * time + rng.uniform(0, 2 * np.pi))
    return _retimed(body.solved(), rate, begin, end)


def _lurches(time: Array, rng: np.random.Generator) -> Array:
    """Return 0 to 1 (T,): how much a body has lost its balance."""
    found, at = np.zeros_like(time), float(rng.uniform(0.9, 1.8))
    while at < time[-1]:
        found += np.exp(-0.5 * ((time - at) / LURCH_S) ** 2)
        at += float(rng.uniform(*LURCH_EVERY))
    return np.minimum(found, 1.0)


def with_high_knees(
    joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator
) -> Array:
    """Return joints (T, 22, 3) of a walk that lifts its knees high in the frames `begin` to `end`; see `limping`."""
    del side, rng  # both knees, all the same
    lifts = _lifts(joints, layout.fps, _inside(len(joints), begin, end, layout.fps))
    return _knees_lifted(joints, lifts, KNEE_UP)


def skipping(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a walk, of which the frames `begin` to `end` skip; see `limping`."""
    del side, rng
    lifts = _lifts(joints, layout.fps, _inside(len(joints), begin, end, layout.fps))
    body = StandingBody(_knees_lifted(joints, lifts, KNEE_SKIPS))
    up, sinks = _hops(np.maximum(*lifts.values()), layout.fps)
    body.joints[:, :, 1] += up[:, None]
    body.shift(-sinks)
    return body.solved()


def _hops(lift: Array, fps: float) -> tuple[Array, Array]:
    """Metres (T,) by which a body rises that hops each time a knee is lifted most, and by which its hips sink between.

    It rises and falls freely, and its legs take up the speed of the fall until they push off for the next hop.

    Args:
        lift: 0 to 1 (T,) of the knee that is lifted more.
        fps: frames a second.
    """
    time, up, sinks = np.arange(len(lift)) / fps, np.zeros(len(lift)), np.zeros(len(lift))
    tops = 1 + np.flatnonzero((lift[1:-1] > lift[:-2]) & (lift[1:-1] >= lift[2:]) & (lift[1:-1] > HOP_FROM))
    if len(tops) < 2:
        return up, sinks
    air = HOP_AIR * float(np.median(np.diff(tops))) / fps
    leaves, lands, speed = tops / fps - 0.5 * air, tops / fps + 0.5 * air, 0.5 * GRAVITY * air
    for begin in leaves:
        flies = np.clip((time - begin) / air, 0.0, 1.0)
        up += 0.5 * GRAVITY * air**2 * flies * (1.0 - flies)
    for begin, end in zip(lands[:-1], leaves[1:], strict=True):
        if end > begin:
            sinks += speed * (end - begin) / np.pi * np.sin(np.pi * np.clip((time - begin) / (end - begin), 0.0, 1.0))
    for away in (leaves[0] - time, time - lands[-1]):
        sinks += speed * np.maximum(away, 0.0) * np.exp(-np.maximum(away, 0.0) / LANDS_S)
    return up, sinks


def stomping(
    joints: Array,
    layout: FeatureLayout,
    begin: int,
    end: int,
    side: str,
    rng: np.random.Generator,
    *,
    times: int | None = None,
) -> Array:
    """Return joints (T, 22, 3) of a walk that stomps in the frames `begin` to `end`, or of a body that stands and
    stamps with its feet in turn, or that of the `side`, over and over or a number of `times`; see `limping`."""
    fps, inside = layout.fps, _inside(len(joints), begin, end, layout.fps)
    goes = np.clip(smooth_seconds((_speed(joints, fps) > STILL).astype(float), 0.15, fps), 0.0, 1.0)
    lifts = {each: goes * lift for each, lift in _lifts(joints, fps, inside).items()}
    rounds, stamps = np.arange(len(joints)) / fps / STAMP_S + rng.uniform(), inside
    if times is not None:
        room = (end - begin) / fps
        each_s = min(STAMP_S, (room - 0.3) / times)
        first = begin / fps + min(rng.uniform(0.4, 0.8), max(room - times * each_s - 0.1, 0.1))
        rounds = (np.arange(len(joints)) / fps - first) / each_s
        stamps = ((rounds >= 0.0) & (rounds < times)).astype(float)
    for each in [side] if side in LEGS else LEGS:
        its = (rounds.astype(int) % 2 == list(LEGS).index(each)) | (side in LEGS)
        lifts[each] = lifts[each] + (1.0 - goes) * stamps * its * np.sin(np.pi * np.minimum(rounds % 1.0 / 0.6, 1.0))
    body = StandingBody(_knees_lifted(joints, lifts, KNEE_STOMPS))
    falls = np.maximum(*(-np.gradient(lift) * fps * STOMP_FALLS_S for lift in lifts.values()))
    body.shift(-STOMPS * inside * np.clip(smooth_seconds(falls, 0.05, fps), 0.0, 1.0))
    return body.solved()


def shuffling(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a walk whose feet stay near the floor in the frames `begin` to `end`; see
    `limping`."""
    del side, rng
    moved, inside = joints.copy(), _inside(len(joints), begin, end, layout.fps)[:, None]
    for _, _, ankle, toe in LEGS.values():
        heights = moved[:, [ankle, toe], 1]
        stands = np.percentile(heights, 10, axis=0)
        moved[:, [ankle, toe], 1] -= (1.0 - DRAGS) * inside * np.maximum(heights - stands, 0.0)
    body = StandingBody(moved)
    body.shift(-DRAGS_LOW * inside[:, 0])
    return body.solved()


def on_toes(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a walk, of which the frames `begin` to `end` go on the toes, upright, however low the
    walk is; see `limping`."""
    del side, rng
    fps, inside = layout.fps, _inside(len(joints), begin, end, layout.fps)
    body = StandingBody(joints)
    reach: list[Array] = []
    for leg, (hip, knee, ankle, toe) in LEGS.items():
        foot = body.local(body.joints[:, ankle] - body.joints[:, toe], leg)
        angle = np.radians(HEELS_UP) * inside
        up = foot[:, 1] * np.cos(angle) - foot[:, 2] * np.sin(angle)
        back = foot[:, 1] * np.sin(angle) + foot[:, 2] * np.cos(angle)
        tipped = np.stack([foot[:, 0], up, back], axis=-1)
        body.joints[:, ankle] = body.joints[:, toe] + body.world(tipped, leg)
        longest = TIPTOE_LEG * (BONE_LENGTHS[knee] + BONE_LENGTHS[ankle])
        apart = body.joints[:, hip] - body.joints[:, ankle]
        level = np.linalg.norm(apart[:, [0, 2]], axis=-1)
        reach.append(np.sqrt(np.maximum(longest**2 - level**2, 0.0)) - apart[:, 1])
    room = np.clip(smooth_seconds(np.minimum(*reach), 0.12, fps), 0.0, TIPTOE_RISE)
    body.shift(inside * np.minimum(room, np.minimum(*reach)))
    trunk = body.local(body.joints[:, HUMANML3D.index("neck")] - body.joints[:, 0], LEFT)
    lean = np.degrees(np.arctan2(smooth_seconds(trunk[:, 2], 0.3, fps), smooth_seconds(trunk[:, 1], 0.3, fps)))
    body.lean(-TIPTOE_UPRIGHT * inside * np.maximum(lean, 0.0), "left")
    return body.solved()


def over_rope(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a body that stands, and hops on both feet in the frames `begin` to `end`; see
    `limping`."""
    del side
    inside = _inside(len(joints), begin, end, layout.fps)
    phase = (np.arange(len(joints)) / layout.fps / ROPE_S + rng.uniform()) % 1.0
    air = np.clip(phase / ROPE_AIR, 0.0, 1.0)
    up = inside * 4 * air * (1.0 - air)
    floor = np.clip((phase - ROPE_AIR) / (1.0 - ROPE_AIR), 0.0, 1.0)
    body = StandingBody(joints)
    body.shift(-ROPE_DIP * inside * np.sin(np.pi * floor))
    body.joints[:, :, 1] += ROPE_UP * up[:, None]
    body.joints[:, [leg[-1] for leg in LEGS.values()], 1] -= TOES_DOWN * up[:, None]
    return body.solved()


def _lifts(joints: Array, fps: float, inside: Array) -> dict[str, Array]:
    """Return 0 to 1 (T,) for each side: how much its knee is lifted, while its foot passes the other one."""
    body = StandingBody(joints)
    return {side: inside * smooth_seconds(_stands(body, OTHER_SIDE[side], fps), LIFTS_S, fps) for side in LEGS}


def _knees_lifted(joints: Array, lifts: Mapping[str, Array], degrees: float) -> Array:
    """Return joints (T, 22, 3) with thighs that are lifted by `degrees` in each step."""
    body = StandingBody(joints)
    thigh, shank = np.radians(degrees), np.radians(SHANK_BACK)
    for side, (hip, knee, ankle, toe) in LEGS.items():
        lifted = lifts[side]
        share = np.stack([lifted**2, eased(UP_FIRST * lifted), lifted**2], axis=-1)
        bent = BONE_LENGTHS[knee] * np.array([0.0, -np.cos(thigh), np.sin(thigh)])
        below = BONE_LENGTHS[ankle] * np.array([0.0, -np.cos(shank), -np.sin(shank)])
        for moved, place in (([knee], bent), ([ankle, toe], bent + below)):
            wanted = np.tile(place + np.array([APART, 0.0, 0.0]), (len(joints), 1))
            away = body.joints[:, hip] + body.world(wanted, side) - body.joints[:, moved[0]]
            body.joints[:, moved] += (share * away)[:, None]
    return body.solved()


def on_line(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a walk that sets its feet on one line in the frames `begin` to `end`; see
    `limping`."""
    del side, rng
    inside, body = _inside(len(joints), begin, end, layout.fps), StandingBody(joints)
    natural, passes = natural_course(joints, layout.skeleton, layout.fps), _lifts(joints, layout.fps, inside)
    left = np.stack([np.cos(natural.headings), 0.0 * natural.headings, -np.sin(natural.headings)], axis=-1)
    middle = np.stack([natural.places[:, 0], 0.0 * natural.headings, natural.places[:, 1]], axis=-1)
    for leg, (_, _, ankle, toe) in LEGS.items():
        off = np.sum((body.joints[:, ankle] - middle) * left, axis=-1)
        share = ON_LINE * inside * (1.0 - ON_LINE_PASSES * passes[leg])
        body.joints[:, [ankle, toe]] -= (share * off)[:, None, None] * left[:, None]
    return body.solved()


def tapping(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a body that stands, and taps a foot in the frames `begin` to `end`; see `limping`."""
    taps = side if side in LEGS else str(rng.choice(list(LEGS)))
    time = np.arange(len(joints)) / layout.fps
    busy = (time + rng.uniform(0, TAPS_S[0])) % sum(TAPS_S) < TAPS_S[0]
    speed = _speed(joints, layout.fps)
    way = _inside(len(joints), begin, end, layout.fps) * smooth_seconds(
        (busy & (speed < STILL)).astype(float), 0.08, layout.fps
    )
    moved = joints.copy()
    moved[:, LEGS[taps][-1], 1] += TAPS * way * np.sin(np.pi * TAPS_HZ * time) ** 2
    return StandingBody(moved).solved()


def shifting(joints: Array, layout: FeatureLayout, begin: int, end: int, side: str, rng: np.random.Generator) -> Array:
    """Return joints (T, 22, 3) of a body that stands, whose weight goes from one foot to the other and back in the
    frames `begin` to `end`; see `limping`."""
    del side  # over both
    time, body = np.arange(len(joints)) / layout.fps, StandingBody(joints)
    stands = smooth_seconds((_speed(joints, layout.fps) < STILL).astype(float), 0.2, layout.fps)
    way = _inside(len(joints), begin, end, layout.fps) * np.clip(stands, 0.0, 1.0)
    hz = max(rng.uniform(*SHIFTS_HZ), min(LEAST_SHIFTS * layout.fps / max(end - begin, 1), SHIFTS_FASTEST_HZ))
    swing = np.sin(2 * np.pi * hz * time + rng.uniform(0, 2 * np.pi))
    over = way * np.tanh(SHIFTS_RESTS * swing) / np.tanh(SHIFTS_RESTS)
    body.shift(-SHIFTS_SINK * way * (1.0 - np.abs(over)), 0.0 * over, SHIFTS * over)
    body.lean(SHIFTS_LEAN * over, "forward")
    return body.solved()


GAITS: Mapping[Gait, Callable[[Array, FeatureLayout, int, int, str, np.random.Generator], Array]] = {
    "limp": limping,
    "stagger": staggering,
    "high-knees": with_high_knees,
    "skip": skipping,
    "foot-tap": tapping,
    "weight-shift": shifting,
    "stomp": stomping,
    "shuffle": shuffling,
    "rope": over_rope,
    "tiptoe": on_toes,
    "one-line": on_line,
}
"""Gaits of bearings, by their name in `bearings.toml`."""


def _speed(joints: Array, fps: float) -> Array:
    """Return the metres a second (T,) of the hips."""
    return np.linalg.norm(np.gradient(smooth_seconds(joints[:, 0], 0.2, fps), axis=0), axis=-1) * fps


def _inside(frames: int, begin: int, end: int, fps: float) -> Array:
    inside = np.zeros(frames)
    inside[begin:end] = 1.0
    return np.clip(smooth_seconds(inside, 0.15, fps), 0.0, 1.0)


def _stands(body: StandingBody, side: str, fps: float) -> Array:
    """Return 0 to 1 (T,): how much the body goes over a foot, which falls behind the other as it does."""
    this, other = ANKLES[side], ANKLES[OTHER_SIDE[side]]
    apart = body.local(body.joints[:, this] - body.joints[:, other], LEFT)[:, 2]
    falls = -np.gradient(smooth_seconds(apart, 0.05, fps))
    return np.clip(falls / max(float(np.percentile(np.abs(falls), 80)), STEP), 0.0, 1.0)


def _retimed(joints: Array, rate: Array, begin: int, end: int) -> Array:
    """Return joints (T, J, 3) whose time runs at `rate` (T,) from `begin` to `end`, which stay where they are."""
    part = slice(begin, end)
    times = np.concatenate([[0.0], np.cumsum(0.5 * (rate[part][1:] + rate[part][:-1]))])
    times *= (len(times) - 1) / times[-1]
    low = np.minimum(times.astype(int), len(times) - 2)
    share = (times - low)[:, None, None]
    moved = joints.copy()
    moved[part] = (1 - share) * joints[part][low] + share * joints[part][low + 1]
    return moved
