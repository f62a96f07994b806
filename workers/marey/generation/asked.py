"""Motions as the words of their prompt ask: on the side, as often, as far round and at the pace that they name.

A network knows what an action looks like, but seldom reads one word that changes it: its training motions are
mirrored, so both sides are as likely to it; it repeats an action as often as its length has room for; it turns by some
angle; and it does so at the pace of its data. All of these can be mended in the motion that it made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.generation.begun import begun
from marey.generation.distances import SPEEDS, as_far, distance_of, farther
from marey.generation.drawn_whole import DrawnWhole, drawn_whole
from marey.generation.ends import SETTLING, ended
from marey.generation.even_runs import EVEN, even_run
from marey.generation.fine import FINE, drawn_features
from marey.generation.flights import DANCES, JUMPS, ON_FEET, fallen, lowered, on_floor
from marey.generation.footing import RUN_SPEEDS, footed
from marey.generation.gazing import GAZE
from marey.generation.onward import without_return
from marey.generation.passes import PassControl
from marey.generation.port import GenerationControl, Generator, MotionFeatures, NoControl, Request, S
from marey.generation.pose_holds import HOLDING, with_held_pose
from marey.generation.postured import GOING_ON, drawn_posture, gone_on, on_posture
from marey.generation.repetitions import repeated
from marey.generation.skidding import skidded
from marey.generation.stated import AT_PACE
from marey.generation.steered import CLOSED, steered_features
from marey.generation.stepped import stepped
from marey.generation.timed import CUT, cut_of
from marey.generation.turned import NEAR, ended_turn, turned_features
from marey.generation.wish import SPINNING, Wish
from marey.items.values import MAX_SECONDS
from marey.motion.courses import course_of
from marey.motion.features import FeatureLayout
from marey.motion.paced_features import pace_features
from marey.motion.skeleton import HUMANML3D
from marey.quality.record import SHOWN
from marey.selector.matching import ON_THE_SPOT
from marey.selector.motion import SHORTEST, Motion
from marey.selector.records import match_joints
from marey.selector.repetitions import REPETITIONS, Repetition
from marey.selector.rules import is_shown
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.counts import STEPPING
from marey.vocabulary.courses import WAYS as STEERED
from marey.vocabulary.courses import dribbles_ahead
from marey.vocabulary.held_poses import held_pose
from marey.vocabulary.scope import STANDING
from marey.vocabulary.stops import stated_skid

Float32 = NDArray[np.float32]

STRETCHED = (0.6, 1.6)
"""Bounds of the speed at which a motion with another number of repetitions is brought to a length that is fixed."""


@dataclass(frozen=True, eq=False)
class AskedMotion:
    """A motion that was changed to what its prompt asks for.

    Attributes:
        features: (T, D), in the layout's own units.
        changes: for the manifest: `mirrored`, true where left and right are exchanged; `drawn`, the action whose
            movement is drawn on what the network made or in its place (`marey.generation.fine`, `drawn_whole`);
            `repetitions`, how often the network `made` and the prompt `asked` for the action; `turn`, degrees from
            the first frame to the last, positive to the left, as the network `made` them and as they are `shown`;
            `course`, to which a way was bent (`marey.generation.steered`);
            `went_back`, true where it goes on and the network went back (`marey.generation.onward`);
            `evened`, true where a run lost its beat and its strides were made anew (`marey.generation.even_runs`);
            `distance`, metres that a way goes as `asked` for and as `shown` (`marey.generation.distances`);
            `speed`, how many times as fast the motion is played as the network made it; `gaze`, where the head
            turns (`marey.generation.gazing`); `grounded`, true where the body was let down to the floor; `flights`,
            by how many seconds its flights are shorter than the network made them; `left_out`, how many seconds of
            its end came after the action; `footed`, true where a run was held back by the slide of its
            feet; `begun`, how many seconds of its beginning were left out, in which a run stood; `posture`, in which a
            gesture is done (`marey.generation.postured`), or `as before`, that in which the movement before has ended;
            `skids`, `skid` or `stop`, with which a run ends (`marey.generation.skidding`);
            `pose_held`, seconds for which the words have its pose held.
    """

    features: Float32 = field(repr=False)
    changes: Mapping[str, Any]


def changes_of(motion: MotionFeatures) -> Mapping[str, Any]:
    """Return what was changed in a motion, for the manifest."""
    return motion.changes if isinstance(motion, AskedMotion) else {}


DRIBBLING = "dribble"
ENDS_TURNED = frozenset({ON_THE_SPOT, SPINNING})
"""Actions that end where the body has turned as far as is asked for."""
ALIKE = frozenset({"idle", "nod", "flinch"})
"""Actions that networks make nearly alike from every seed: every other motion is the mirror image."""


def generate_as_asked(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S | None = None,
    *,
    control: GenerationControl | None = None,
) -> list[MotionFeatures | None]:
    """Generate one motion per request, as `Generator.generate`, and change those that do not show what their prompt
    says of a side, a number, a turn or a pace.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    wishes = [Wish.of(request) for request in requests]
    whole = [_whole(generator, request, wish) for request, wish in zip(requests, wishes, strict=True)]
    left = [row for row, drawn in enumerate(whole) if drawn is None]
    asked = [wishes[row].for_network(requests[row], generator.limits) for row in left]
    watched = PassControl(control or NoControl(), left, len(requests) - len(left), len(requests))
    made = dict(zip(left, generator.generate(asked, settings, control=watched) if left else (), strict=True))
    return [
        _in_posture(generator, request, wish, _as_asked(generator, request, wish, drawn, made.get(row)))
        for row, (request, wish, drawn) in enumerate(zip(requests, wishes, whole, strict=True))
    ]


def drawn_as_asked(generator: Generator[Any], request: Request) -> MotionFeatures | None:
    """Return the motion of a request of any length that is drawn without a network; None if none is, or it has another
    length.

    Args:
        generator: of the motion.
        request: with a length.
    """
    wish = Wish.of(request)
    whole = _drawn_whole(generator, request, wish) if _may_be_drawn(generator, request, wish) else None
    if whole is None:
        return None
    motion = _in_posture(generator, request, wish, _as_asked(generator, request, wish, whole, None))
    return motion if motion is not None and len(motion.features) == request.frames else None


def _whole(generator: Generator[S], request: Request, wish: Wish) -> DrawnWhole | None:
    """Return the motion that is drawn for a request before a network is asked; None if none is.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    if not _may_be_drawn(generator, request, wish):
        return None
    generator.limits.check(request)
    return _drawn_whole(generator, request, wish)


def _may_be_drawn(generator: Generator[Any], request: Request, wish: Wish) -> bool:
    return draws(generator, request) and bool(wish.action or request.held.is_drawn)


def _drawn_whole(generator: Generator[Any], request: Request, wish: Wish) -> DrawnWhole | None:
    if request.held.is_drawn:
        kept = None if request.open else wish.for_network(request, generator.limits).frames
        drawn = drawn_posture(generator.layout, request.held, request.text.said, request.seed, kept)
        return DrawnWhole(drawn, exact=True)
    frames = (request if wish.action in AT_PACE else wish.for_network(request, generator.limits)).frames
    fine = wish.fine(request)
    borne = any(not each.bearing.mood for each in stated_bearings(request.text.said))
    held = fine.fixed or borne  # what is drawn on it needs the time
    drawn = drawn_whole(generator.layout, wish.action, fine, request.seed, frames if held else None)
    if drawn is not None and request.open:
        drawn = replace(drawn, features=gone_on(drawn.features, generator.layout, request.held))
    if drawn is None or held or not any(request.beside):
        return drawn
    if not request.beside[0]:  # who stands before others does so for a moment
        return replace(drawn, features=drawn.features[: request.frames]) if wish.action == STANDING else drawn
    features = np.concatenate([_at_rest(drawn.features[:1].repeat(CUT, axis=0), generator.layout), drawn.features])
    return replace(drawn, features=features[: request.frames] if wish.action == STANDING else features)


def _at_rest(features: Float32, layout: FeatureLayout) -> Float32:
    """Return features (T, D) of one frame again and again, without its step to the next one."""
    still = features.copy()
    for group in ("yaw", "velocity", "velocities"):
        still[:, layout.slices[group]] = 0.0
    return still


DRAWING = "drawing"
"""Setting of models whose bundles may draw: 0 = the network makes everything."""


def drawing_of(generator: Generator[S], settings: S) -> bool:
    """Return True if these settings let rules draw movements, `Request.drawing`; also where the model has no such
    setting."""
    return bool(generator.describe_settings(settings).get(DRAWING, True))


def draws_bearings(generator: Generator[Any], request: Request) -> bool:
    """Return True if bearings are drawn on the motion of a request."""
    return generator.bundle.manifest.draws_bearings and request.drawing


def draws(generator: Generator[Any], request: Request) -> bool:
    """Return True if the motion of a request may be drawn, as those that its generator learned from."""
    return draws_bearings(generator, request) and generator.layout.skeleton.name == HUMANML3D.name


def _as_asked(
    generator: Generator[S], request: Request, wish: Wish, whole: DrawnWhole | None, made: MotionFeatures | None
) -> MotionFeatures | None:
    """Return a motion that was drawn, or the one that the network made, changed where the wish is not fulfilled and can
    be; None if there is neither.

    Args:
        generator: that made it.
        request: for the motion.
        wish: what its prompt asks for.
        whole: drawn.
        made: by the network.
    """
    source = made or whole
    if source is None:
        return None
    layout, features = generator.layout, source.features
    late = 0 if whole is not None or wish.count is not None else begun(features, layout, wish.action, request.text.said)
    changes: dict[str, Any] = {GAZE: list(wish.gaze)} if wish.gaze and request.drawing else {}
    if not request.held.is_drawn and _is_mirrored(features, layout, wish, request.seed, drawn=whole is not None):
        features, changes["mirrored"] = layout.mirror(features), True
    fixed = None if request.open else request.frames
    if late:
        features, changes["begun"] = features[late:], round(late / layout.fps, 2)
    if whole is None and fixed is not None:
        features = features[: wish.length(request, generator.limits)]
    if whole is not None:
        changes["drawn"] = wish.action or "idle"
    elif layout.skeleton.name == HUMANML3D.name:
        drawn = _drawn(features, layout, wish, request)
        if drawn is not None:
            features, changes["drawn"] = drawn, wish.action if wish.action in FINE else DRIBBLING
    if layout.skeleton.name == HUMANML3D.name:
        features = features if whole is not None else _evened(features, layout, wish, changes)
        for change in (_as_often, _turned, _on_floor, _ended) if whole is None or not whole.exact else ():
            if len(features) >= SHORTEST:
                features = change(features, layout, wish, fixed, changes)
    far = _as_far(features, layout, wish, fixed, changes) if whole is None else None
    if far is not None:
        features = far
    elif whole is None or not whole.exact or wish.action not in AT_PACE:
        features = _retimed(features, layout, wish, fixed, changes, whole)
    features = _skidded(features, layout, wish, request, changes) if whole is None else features
    held = held_pose(request.text.said) if whole is not None and fixed is None and wish.action in HOLDING else None
    if held is not None and len(features) >= SHORTEST:
        features, changes["pose_held"] = with_held_pose(features, layout, held), held
    changed = changes or made is None or len(features) != len(made.features)
    return AskedMotion(features, changes) if changed else made


def _in_posture(
    generator: Generator[S], request: Request, wish: Wish, motion: MotionFeatures | None
) -> MotionFeatures | None:
    """Return the motion of a gesture in the posture of its row, and one that would go on and on as a short one; any
    other motion as it is."""
    held, fixed = request.held, request.frames is not None and not request.open
    if motion is None or not draws(generator, request) or len(motion.features) < SHORTEST:
        return motion
    whole = fixed or wish.count is not None
    goes_on = wish.action in GOING_ON and any(request.beside) and not whole
    if not (held.carries or goes_on):
        return motion
    features = on_posture(motion.features, generator.layout, held, wish.action, fixed=fixed, whole=whole)
    return AskedMotion(features, {**changes_of(motion), **({"posture": held.own} if held.own else {})})


def _is_mirrored(features: Float32, layout: FeatureLayout, wish: Wish, seed: int, *, drawn: bool) -> bool:
    """Return True if the mirror image of a motion is what the prompt asks for, or does as well and differs from that of
    the seed before."""
    if drawn and wish.drawn_side:
        return False
    if wish.limb or wish.side:
        return _is_better_mirrored(features, layout, wish)
    return not drawn and wish.action in ALIKE and seed % 2 == 1


def _drawn(features: Float32, layout: FeatureLayout, wish: Wish, request: Request) -> Float32 | None:
    """Return the motion of a network with what is drawn of its action; None if it stays."""
    if wish.action in STEERED and request.drawing and dribbles_ahead(request.text.said):
        return drawn_features(features, layout, DRIBBLING, wish.fine(request), request.seed)
    if wish.action not in FINE or not request.drawing or _shows(features, layout, wish, request):
        return None
    return drawn_features(features, layout, wish.action, wish.fine(request), request.seed)


def _evened(features: Float32, layout: FeatureLayout, wish: Wish, changes: dict[str, Any]) -> Float32:
    """Return the motion without the moments in which a run loses its beat."""
    even = even_run(features, layout) if wish.action in EVEN and wish.count is None else None
    if even is None or len(features) < SHORTEST:
        return features
    changes["evened"] = True
    return even


def _as_often(
    features: Float32, layout: FeatureLayout, wish: Wish, fixed: int | None, changes: dict[str, Any]
) -> Float32:
    """Return the motion with as many repetitions as are asked for; `changes` says so, as in all of these."""
    as_drawn = "drawn" in changes and wish.action in FINE  # as often as asked for
    if wish.count is None or as_drawn or wish.action not in REPETITIONS:
        return features
    as_often = stepped if wish.action in STEPPING else repeated
    often = as_often(features, layout, lambda joints: _repetitions(joints, layout.fps, wish.action), wish.count)
    if often is None or often is features or not _fits(len(often), fixed, wish.pace.share, layout.fps):
        return features
    made = len(_repetitions(layout.decode(features), layout.fps, wish.action))
    changes["repetitions"] = {"made": made, "asked": wish.count}
    return often


def _turned(
    features: Float32, layout: FeatureLayout, wish: Wish, fixed: int | None, changes: dict[str, Any]
) -> Float32:
    """Return the motion with the turn that is asked for, behind what a transition replaces of it."""
    if wish.turn is None and wish.course is None:
        return features
    lost = cut_of(len(features)) if wish.joined else 0
    replaced, features = features[:lost], features[lost:]
    if wish.course is not None:
        onward = without_return(features, layout)
        if onward is not None:
            features, changes["went_back"] = onward, True
        steered = steered_features(features, layout, wish.course, wish.seed)
        if steered is None:
            return np.concatenate([replaced, features])
        changes["turn"] = {"made": round(_turn(features, layout)), "shown": round(_turn(steered, layout))}
        changes["course"] = wish.course.kind
        return np.concatenate([replaced, steered])
    assert wish.turn is not None
    first = ended_turn(features, layout, wish.turn) if fixed is None and wish.action in ENDS_TURNED else None
    enough = features if first is None else first
    bent = turned_features(enough, layout, wish.turn, wish.side)
    if first is not None or bent is not None:
        made = _turn(features, layout) if first is not None or bent is None else bent[1]
        enough = enough if bent is None else bent[0]
        changes["turn"] = {"made": round(made), "shown": round(_turn(enough, layout))}
    return np.concatenate([replaced, enough])


def _on_floor(
    features: Float32, layout: FeatureLayout, wish: Wish, fixed: int | None, changes: dict[str, Any]
) -> Float32:
    """Return the motion of a body that comes down to the floor; the moments of a counted one are found by the height of
    the feet, which stays."""
    if wish.count is not None:
        return features
    if wish.action in RUN_SPEEDS and (held := footed(features, layout, RUN_SPEEDS[wish.action])) is not None:
        features, changes["footed"] = held, True
    if wish.action in ON_FEET and (grounded := on_floor(features, layout, wish.action)) is not None:
        features, changes["grounded"] = grounded, True
    if wish.action in DANCES and (stands := lowered(features, layout)) is not None:
        features, changes["grounded"] = stands, True
    if wish.action in JUMPS and fixed is None:
        falls = fallen(features, layout)
        if falls is not None and len(falls) >= SHORTEST:
            changes["flights"] = round((len(features) - len(falls)) / layout.fps, 2)
            features = falls
    return features


def _ended(features: Float32, layout: FeatureLayout, wish: Wish, fixed: int | None, changes: dict[str, Any]) -> Float32:
    """Return the motion without the beginning of what would come after its action; ways of a number of steps, and those
    that end where they began, are whole."""
    closed = wish.course is not None and wish.course.kind in CLOSED
    whole = wish.action in SETTLING and (wish.count is not None or closed)
    ends = ended(features, layout, wish.action) if fixed is None and not whole else None
    if ends is None or len(ends) < SHORTEST:
        return features
    changes["left_out"] = round((len(features) - len(ends)) / layout.fps, 2)
    return ends


def _retimed(
    features: Float32,
    layout: FeatureLayout,
    wish: Wish,
    fixed: int | None,
    changes: dict[str, Any],
    whole: DrawnWhole | None,
) -> Float32:
    """Return the motion at the pace that is asked for, in as many frames as are `fixed`; `changes` says so."""
    if whole is None or wish.pace.of_way:
        speed = wish.pace.of_motion(features, layout)
    else:
        speed = wish.pace.of_drawn(len(features) / layout.fps, at_pace=whole.at_pace)
    frames = max(round(len(features) / speed), 2)
    if fixed is not None and (not wish.pace.of_way or frames < fixed):
        frames = fixed
    if frames != len(features) and ("repetitions" in changes or speed != 1.0 or wish.pace.share != 1.0):
        changes["speed"] = round(len(features) / frames, 3)
        features = pace_features(features, layout.slices, frames)
    if wish.pace.of_way:
        return features[:fixed]  # a way may end at any step
    return features


def _skidded(
    features: Float32, layout: FeatureLayout, wish: Wish, request: Request, changes: dict[str, Any]
) -> Float32:
    """Return the motion of a run with the skid in which its prompt has it end."""
    draws_skid = request.drawing and layout.skeleton.name == HUMANML3D.name
    how = stated_skid(request.text.said, wish.action) if draws_skid else ""
    ends = skidded(features, layout, how, wish.seed, None if request.open else request.frames) if how else None
    changes.update({} if ends is None else {"skids": how})
    return features if ends is None else ends


def _as_far(
    features: Float32, layout: FeatureLayout, wish: Wish, fixed: int | None, changes: dict[str, Any]
) -> Float32 | None:
    """Return the motion of a way that goes as far as is asked for, at the pace that is; None if it cannot."""
    if wish.metres is None or wish.action not in SPEEDS or len(features) < SHORTEST:
        return None
    said = dict[str, Any]()
    paced = features if fixed is not None else _retimed(features, layout, wish, None, said, None)
    far = as_far(paced, layout, wish.metres, fixed)
    if far is None and fixed is None:
        far = farther(paced, layout, wish.metres, round(MAX_SECONDS * layout.fps))
    if far is None:
        return None
    changes.update({**said, "distance": {"asked": round(wish.metres, 2), "shown": distance_of(far, layout)}})
    return far


def _is_better_mirrored(features: Float32, layout: FeatureLayout, wish: Wish) -> bool:
    """Return True if the motion turns to the other side, or only the mirror image matches the prompt, or both or
    neither does, and the other limb acts than the one that the prompt names."""
    if layout.skeleton.name != HUMANML3D.name or len(features) < SHORTEST:
        return False
    if wish.side and wish.turn is not None and (wish.turn.least or wish.turn.whole):
        turn = _turn(features, layout)
        return abs(turn) > NEAR and (turn < 0) == (wish.side == "left")
    joints = layout.decode(features)
    as_made, mirrored = (
        match_joints(each, layout.skeleton, layout.fps, wish.steps) or 0.0
        for each in (joints, layout.mirror_joints(joints))
    )
    if (as_made >= SHOWN) != (mirrored >= SHOWN):
        return mirrored >= SHOWN
    if wish.limb is not None:
        return wish.limb.is_other(Motion(joints, layout.fps))
    return SHOWN > mirrored > as_made


def _shows(features: Float32, layout: FeatureLayout, wish: Wish, request: Request) -> bool:
    """Return True if a motion shows its small movement well, and as often as it is asked for, by itself."""
    if len(features) < SHORTEST:
        return False
    joints = layout.decode(features)
    if not FINE[wish.action].is_well(joints.astype(np.float64), layout.fps, wish.fine(request)):
        return False
    motion = Motion(joints, layout.fps)
    as_often = wish.count is None or len(REPETITIONS[wish.action](motion)) == wish.count
    return as_often and is_shown(motion, wish.action, wish.side if FINE[wish.action].sided else "")


def _turn(features: Float32, layout: FeatureLayout) -> float:
    """Return the degrees by which a motion turns, positive to the left."""
    return course_of(features, layout).turn


def _repetitions(joints: NDArray[np.floating], fps: float, action: str) -> Sequence[Repetition]:
    return REPETITIONS[action](Motion(joints, fps)) if len(joints) >= SHORTEST else []


def _fits(frames: int, fixed: int | None, speed: float, fps: float) -> bool:
    """Return True if a motion is no longer than one may be, and can be brought to a length that is fixed without
    a pace that shows."""
    low, high = STRETCHED
    return frames / speed <= MAX_SECONDS * fps if fixed is None else low <= frames / fixed / speed <= high
