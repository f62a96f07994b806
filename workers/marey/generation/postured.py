"""Movements of a sequence in a posture: changes of posture are drawn whole, and gestures are put onto the posture.

A gesture is made by a body that stands, by a network or drawn. Its arms are brought to where they are in it, and trunk
and head are bent by as much, on a body that sits, kneels, crouches or lies.
"""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.floor_ways import rolls_between, way_over_floor
from marey.drawing.holds import BACK, FRONT, PRONE, SLIDE, SLIDES_M, SLIDES_S, passing
from marey.drawing.passing import pose
from marey.drawing.shots import prone_shots
from marey.generation.done import done_s, feet_s
from marey.generation.posture import RowPosture
from marey.generation.whole_body import retimed
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth_seconds
from marey.motion.rotations import normalize
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEFT, LEGS, NECK, StandingBody, eased
from marey.posing.still import standing_still
from marey.vocabulary.bearing_words import stated_bearings

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

STAYS_S, PASSES_ON_S, WAITS_S = (0.9, 1.4), (0.4, 0.7), (1.5, 2.0)
"""Seconds in a posture after it is reached, in one that is left again by the same movement, and of a movement that is
nothing but a wait in it."""
AIMS_S = (2.2, 3.2)
"""Seconds for which a gun is aimed on the front."""
LONGEST_S = 4.2
"""Seconds of a gesture that goes on and on, in a posture."""
RESTS, ACTS = 12.0, 32.0
"""Degrees by which an arm is off its place at the beginning of a gesture, at which it acts in nothing and in full."""
MEETS, LANDS_S = 8, 0.4
"""Frames in which a movement passes into the next one that begins in the same posture, and seconds for which one that
ends low stays so before it goes on."""
PASSES_S = 0.12
"""Standard deviation of the filter by which an arm passes from the posture into the gesture, seconds."""
BENDS = 40.0
"""Degrees by which a trunk bends in a gesture at most, on a posture."""
WORK_S = 3.0
"""Seconds of work in a posture at least."""
LIFTS = 0.3
"""Share of its length by which a bone points down at which it begins to be taken for one that points up."""
LEG_JOINTS = [joint for leg in LEGS.values() for joint in leg]
HEAD = 15
BENDS_S = 0.15
"""Seconds at both ends in which trunk and head pass into those of a gesture, which mostly begins and ends at rest."""
EDGE_S = 0.4
"""Seconds at both ends of a gesture in which the body is in the posture alone."""
GOING_ON = frozenset({"wave"})
"""Gestures that networks make on and on, for as long as they have time."""
WAYS = frozenset(
    {"aim", "shoot", "guide", "draw-bow", "throw", "wave", "raise-arm", "reach-forward", "reach-up", "cheer"}
)
"""Gestures whose arms have their way in the world; those of others have it before the chest."""


def drawn_posture(layout: FeatureLayout, held: RowPosture, said: str, seed: int, frames: int | None) -> Float32:
    """Return features (T, D) of a body that goes to a posture or back, or waits in it.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        held: postures of the movement.
        said: words of the movement; what they ask for beside it takes its time.
        seed: of the movement.
        frames: that it keeps; None = as many as it takes.
    """
    rng = random.Random(f"{seed} posture")  # noqa: S311
    stays = PASSES_ON_S if held.end not in ("", held.own) or held.deed is not None else STAYS_S
    stays = AIMS_S if held.own == PRONE else WAITS_S if held.begin == held.own and held.deed is None else stays
    seconds = rng.uniform(*stays) if held.own else 0.4
    return encode_all(layout, _fitted(held, max(seconds, gestures_s(said)), frames))


def on_posture(
    features: Float32, layout: FeatureLayout, held: RowPosture, action: str, *, fixed: bool, whole: bool
) -> Float32:
    """Return features (T', D) of a gesture that is made in a posture, and of what leads to the next one.

    Args:
        features: (T, D) of the gesture of a body that stands.
        layout: of the features, on the skeleton of HumanML3D.
        held: postures of the movement.
        action: id in the vocabulary.
        fixed: the motion keeps its number of frames.
        whole: nothing of the gesture is left out: a number of repetitions is asked for.
    """
    made = StandingBody(layout.decode(features).astype(np.float64))
    acts = _acts(made)
    begin, end = (0, len(features)) if fixed else _span(np.max(list(acts.values()), axis=0), whole=whole)
    joints = _fitted(held, (end - begin) / FPS, len(features) if fixed else None)
    frames = min(end - begin, len(joints))
    index = np.minimum(begin + np.arange(len(joints)), begin + frames - 1)
    made.joints = made.joints[index]
    made = StandingBody(made.joints)
    there = np.arange(len(joints)) / FPS
    left = np.minimum(there, frames / FPS - there)
    edge, lies = np.clip(left / EDGE_S, 0.0, 1.0), held.own in (BACK, FRONT)
    body = StandingBody(joints)
    _bend(body, made, eased(np.clip(left / BENDS_S, 0.0, 1.0)))
    for side, share in acts.items():
        _carry(body, made, side, eased(edge) * share[index], lies=lies, in_trunk=lies or action not in WAYS)
    solved = body.solved()
    solved[:, LEG_JOINTS] = joints[:, LEG_JOINTS]  # solved knees of who kneels go through the floor
    return encode_all(layout, solved)


def gone_on(features: Float32, layout: FeatureLayout, held: RowPosture) -> Float32:
    """Return features (T', D) of a movement that ends low, and of what leads to the posture in which the next begins.

    Args:
        features: (T, D) of the movement, drawn by itself.
        layout: of the features, on the skeleton of HumanML3D.
        held: postures of the movement.
    """
    if not held.goes_on:
        return features
    low = held.comes_to
    after = _fitted(RowPosture(low, low, held.end, seed=held.seed), LANDS_S, None)
    frames = np.concatenate([features, encode_all(layout, after)]).astype(np.float32)
    pass_into(frames, len(features), MEETS)
    return frames


def pass_into(frames: Float32, start: int, count: int) -> None:
    """Let features (T, D) pass from the last frame before `start` into those behind it, in so many frames; both are of
    one posture."""
    count = min(count, len(frames) - start)
    if start and count > 0:
        share = (np.arange(1, count + 1) / (count + 1))[:, None]
        frames[start : start + count] = (1 - share) * frames[start - 1] + share * frames[start : start + count]


def gestures_s(said: str) -> float:
    """Return the seconds that gestures take at least that are drawn on a body, one after the other, and work."""
    stated = stated_bearings(said)
    gestures = [seconds + EDGE_S for each in stated if (seconds := done_s(each))]
    return max([sum(gestures), *map(feet_s, stated), *(WORK_S for each in stated if each.bearing.work)])


def _fitted(held: RowPosture, seconds: float, frames: int | None) -> Array:
    """Return joints (T, 22, 3) of a body that passes its postures and stays so long in its own, or fills `frames`."""
    names = held.begin, held.own, held.end
    if held.halves or rolls_between(*names):
        rolled = way_over_floor(*names, seconds, held.seed, halves=held.halves, side=held.rolls_to)
        return rolled if frames is None or len(rolled) == frames else retimed(rolled, frames)
    least = passing(*names, 0.0, str(held.seed), held.deed).times[-1]
    if frames is not None:
        seconds = max(frames / FPS - least, 0.1)
    done = passing(*names, seconds, str(held.seed), held.deed)
    if held.fires:
        done = prone_shots(done, seconds, random.Random(f"{held.seed} fires"))  # noqa: S311
    own = max(round(done.times[-1] * FPS) + 1, 2)
    body = StandingBody(standing_still(own, random.Random(f"{held.seed} stands")))  # noqa: S311
    pose(body, done.times, done.postures)
    joints = body.solved()
    if held.own == SLIDE and not held.begin:
        left = 1.0 - np.clip(np.arange(own) / FPS / SLIDES_S, 0.0, 1.0)
        joints += SLIDES_M * (1.0 - left**2)[:, None, None] * np.array([0.0, 0.0, 1.0])
    return joints if frames is None or len(joints) == frames else retimed(joints, frames)


def _acts(made: StandingBody) -> dict[str, Array]:
    """Return how much each arm acts, 0 to 1 (T,): it rests where it is at the beginning."""
    found = {}
    for side, (_, shoulder, elbow, wrist) in ARMS.items():
        bones = [_way(made, side, *pair) for pair in ((shoulder, elbow), (elbow, wrist))]
        turned = [np.degrees(np.arccos(np.clip((bone * bone[:1]).sum(-1), -1.0, 1.0))) for bone in bones]
        raised = np.degrees(np.arccos(np.clip(-bones[0][:, 1], -1.0, 1.0)))
        off = np.maximum(np.maximum(*turned), raised if raised[0] > ACTS else 0.0)
        acts = np.clip((off - RESTS) / (ACTS - RESTS), 0.0, 1.0)
        found[side] = np.clip(smooth_seconds(acts, PASSES_S, FPS), 0.0, 1.0)
    return found


def _way(body: StandingBody, side: str, a: int, b: int) -> Array:
    """Return the direction (T, 3) of a bone, outward, up and forward."""
    return body.local(normalize(body.joints[:, b] - body.joints[:, a]), side)


def _span(acts: Array, *, whole: bool) -> tuple[int, int]:
    """Return the first frame of a gesture, and the one after the last, with a moment before and after."""
    active = np.flatnonzero(acts > 0.1)
    if not len(active):
        return 0, len(acts) if whole else min(len(acts), round(LONGEST_S * FPS))
    begin = max(int(active[0]) - round(EDGE_S * FPS), 0)
    end = min(int(active[-1]) + round(EDGE_S * FPS), len(acts))
    return begin, end if whole else min(end, begin + round(LONGEST_S * FPS))


def _bend(body: StandingBody, made: StandingBody, edge: Array) -> None:
    """Bend trunk and head by as much as those of a gesture are bent since its beginning."""
    trunk, head = (_way(made, LEFT, *pair) for pair in ((0, NECK), (NECK, HEAD)))
    for axis, along, sign in (("left", 2, 1.0), ("forward", 0, -1.0)):
        bent, nods = (sign * np.degrees(np.arctan2(bone[:, along], bone[:, 1])) for bone in (trunk, head))
        nods = nods - bent
        body.lean(np.clip(bent - bent[0], -BENDS, BENDS) * edge, axis)
        body.turn(NECK, axis, np.clip(nods - nods[0], -BENDS, BENDS) * edge)
    across = made.local(made.joints[:, ARMS["left"][1]] - made.joints[:, ARMS["right"][1]], LEFT)
    twist = -np.degrees(np.arctan2(across[:, 2], across[:, 0]))
    body.lean(np.clip(twist - twist[0], -BENDS, BENDS) * edge, "up")


def _carry(body: StandingBody, made: StandingBody, side: str, share: Array, *, in_trunk: bool, lies: bool) -> None:
    """Bring an arm to where it is in a gesture, by `share` (T,); of a body that `lies`, arms that go up go away from
    the floor."""
    _, shoulder, elbow, wrist = ARMS[side]
    bones = [_way(made, side, *pair) for pair in ((shoulder, elbow), (elbow, wrist))]
    if lies:
        bones = [_before_chest(bone) for bone in bones]
    if in_trunk:
        turn = np.einsum("tki,tkj->tij", _trunk(made, side), _trunk(body, side))
        bones = [np.einsum("ti,tij->tj", bone, turn) for bone in bones]
    body.move_arm(side, share, *bones, lag=0.0, straight=True)


def _before_chest(bone: Array) -> Array:
    """Return directions (T, 3) of a bone, outward, up and forward, of which those that point up point forward, and
    those that point down stay."""
    raised = 0.5 * np.arccos(np.clip(-bone[:, 1], -1.0, 1.0))
    lifted = np.clip((bone[:, 1] + LIFTS) / LIFTS, 0.0, 1.0)[:, None]
    ahead = normalize(np.stack([0.5 * bone[:, 0], -np.cos(raised), np.sin(raised)], axis=-1))
    return normalize((1 - lifted) * bone + lifted * ahead)


def _trunk(body: StandingBody, side: str) -> Array:
    """Return the axes (T, 3, 3) of a trunk in rows: outward, up and forward, in the frame of the body."""
    middle = body.joints[:, [arm[1] for arm in ARMS.values()]].mean(1)
    up = normalize(body.local(middle - body.joints[:, 0], side))
    out = body.local(body.joints[:, ARMS[side][1]] - middle, side)
    out = normalize(out - up * (out * up).sum(-1, keepdims=True))
    return np.stack([out, up, np.cross(out, up)], axis=1)
