"""Motions that are drawn whole, without a network: movements whose form is known better than a network learned it.

Networks that learned an action from few takes lead into it for long, do it twice, begin in the air, end in another
posture, or do something else. What is drawn begins and ends with a body that stands, on the side, as often and in the
form that the prompt names, as the made clips of the training data are. Walks, runs, dances and everything else stay
theirs, and what has no room in a length that is fixed.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.drawing.forms import NAMED, StatedForm, is_at_pace, misfit
from marey.drawing.gesture import Gesture
from marey.drawing.kinds import COUNTED, DRAWINGS, Counted
from marey.generation.ball_games import dribbles_on_spot
from marey.generation.dodging import stays
from marey.generation.fine import FINE
from marey.generation.fine_wish import FineWish
from marey.generation.pose_holds import with_frames_held
from marey.generation.stated import stated_features
from marey.generation.striking import stands
from marey.generation.timed import worded_seed
from marey.generation.weight import WEIGHS, with_weight
from marey.generation.whole_body import CHOICES, QUICKER, is_drawn, retimed
from marey.motion.features import FeatureLayout, encode_all
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, RIGHT, StandingBody
from marey.posing.still import standing_still
from marey.selector.motion import SHORTEST, Motion
from marey.selector.rules import is_shown
from marey.vocabulary.lengths import stated_length
from marey.vocabulary.paces import stated_pace

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

SECONDS: Mapping[str, tuple[float, float]] = {
    "dodge": (2.2, 2.8),
    "dribble": (4.0, 6.0),
    "nod": (2.6, 4.0),
    "punch": (3.5, 5.0),
}
"""Seconds of a body that moves on and on, where nothing is said of them; others bring their own."""
BRIEF_S: Mapping[str, tuple[float, float]] = {"dribble": (3.0, 3.8)}
SHORT_S = (2.0, 2.6)
"""The same of a body that does other things before or after: of some actions, and of all others."""
ROUNDS_S: Mapping[str, tuple[float, float]] = {"dodge": (2.1, 1.2), "nod": (0.75, 1.0)}
"""Seconds of each of a stated number, and beside them."""
ONE_TAKE = frozenset({"shoot", "throw", "wave"})
"""Actions that not every take shows clearly: the seed alone decides theirs."""
TRIES = 40
"""Movements of random kind, side and length, of which those are left out that the prompt does not ask for."""
MOST_TRIES = 160
"""The same where none of them is of the kind that the prompt names."""
DRAWN = 6
"""Movements that are drawn and graded at most."""
MOST = 20
"""Times that a movement is drawn at most; a larger number is made of these (`marey.generation.repetitions`)."""
MOST_LASTING = 80
"""The same of one that lasts as long as the prompt says."""
SOME = (3, 6)
"""Times by which its pace is known: one alone is often slower."""
STAYING = frozenset({"bow", "bend-over", "raise-arm", "reach-up", "reach-forward", "crouch", "balance"})
"""Actions whose pose is held for as long as a prompt says that they last: "bows for four seconds"."""
AGAIN: Mapping[str, Counted] = {action: draw for action, draw in COUNTED.items() if action not in STAYING}
"""Those that are done again and again meanwhile: "kicks for six seconds"."""
SHORTER = 0.85
"""Share of its own length to which a movement is cut at most, where the length is fixed: at its end the body waits. A
body that stands has any length."""


@dataclass(frozen=True, eq=False)
class DrawnWhole:
    """A motion that is drawn whole.

    Attributes:
        features: (T, D), in the layout's own units.
        exact: its number, pace and end are as asked for already.
        at_pace: it is of a kind that is at the pace that is asked for.
    """

    features: Float32 = field(repr=False)
    exact: bool = False
    at_pace: bool = False


def drawn_whole(layout: FeatureLayout, action: str, wish: FineWish, seed: int, frames: int | None) -> DrawnWhole | None:
    """Return a motion that shows an action as its prompt asks, drawn on a body that stands; None if it is a network's,
    or none of those that the prompt asks for shows the action.

    Args:
        layout: of the features, on the skeleton of HumanML3D.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        seed: of the motion; it and the words of the prompt decide what is drawn.
        frames: that it keeps if its length is fixed, and has at least otherwise; None = as many as it takes.
    """
    stated = stated_features(layout, action, wish, frames, seed)
    if stated is not None:
        return DrawnWhole(stated, exact=True)
    if action not in ONE_TAKE and not any(wish.beside):  # rows of a sequence have seeds of their own
        made = _one(layout, action, wish, worded_seed(seed, wish.prompt), frames)
        if made is not None and _shows(made, layout, action):
            return made
    return _one(layout, action, wish, seed, frames)


def _shows(made: DrawnWhole, layout: FeatureLayout, action: str) -> bool:
    """Return True if a drawn motion shows its action, however it was hurried."""
    return len(made.features) < SHORTEST or is_shown(Motion(layout.decode(made.features), FPS), action)


def _one(layout: FeatureLayout, action: str, wish: FineWish, seed: int, frames: int | None) -> DrawnWhole | None:
    """Return the motion that is drawn of an action by one seed; None if none is."""
    rng = np.random.default_rng([seed, len(action)])
    if action in ALONE and ALONE[action](wish):
        body = standing_still(frames or _frames(action, wish, rng), random.Random(f"{seed} stands"))  # noqa: S311
        joints = FINE[action].draw(body, FPS, wish, rng)
        return None if joints is None else DrawnWhole(encode_all(layout, joints))
    if action not in DRAWINGS or (frames is not None and frames < SHORTEST):
        return None
    shown = _shown(action, wish, random.Random(f"{seed} {action}"), frames)  # noqa: S311
    if shown is None:
        return None
    gesture, joints = shown
    if action in FINE and wish.count is not None:
        joints = FINE[action].draw(joints, FPS, wish, rng)
    if joints is not None and wish.fixed and frames is not None and len(joints) > frames:
        joints = retimed(joints, frames)
    at_pace = is_at_pace(gesture, stated_pace(wish.prompt))
    return None if joints is None else DrawnWhole(encode_all(layout, joints), at_pace=at_pace)


def _frames(action: str, wish: FineWish, rng: np.random.Generator) -> int:
    """Return the frames of a body that stands until its movement is drawn; most movements bring their own."""
    once, before = ROUNDS_S.get(action, (0.0, 0.0))
    if wish.count is not None and once:
        return round((wish.count * once + before) * FPS)
    if action not in SECONDS:
        return SHORTEST
    return round(float(rng.uniform(*(BRIEF_S.get(action, SHORT_S) if any(wish.beside) else SECONDS[action]))) * FPS)


ALONE: Mapping[str, Callable[[FineWish], bool]] = {
    **{action: is_drawn(action) for action in CHOICES},
    "dodge": stays,
    "dribble": dribbles_on_spot,
    "nod": lambda wish: True,
    "punch": stands,
}
"""Actions of `FINE`, by what prompts are drawn without what a network made."""


def _shown(action: str, wish: FineWish, rng: random.Random, frames: int | None) -> tuple[Gesture, Array] | None:
    """Return the first movement that shows its action, and its joints (T, 22, 3); None if none does."""
    lasts = frames if frames is not None and wish.fixed and stated_length(wish.prompt).seconds is not None else None
    for number, gesture in enumerate(_asked_for(action, wish, rng, frames, lasts)):
        if number == DRAWN:
            break
        if lasts is not None and action in STAYING:
            own = _drawn(gesture, wish.fixed, min(lasts, round(gesture.seconds * FPS)), rng)
            joints = with_frames_held(own, lasts, FPS)
        else:
            joints = _drawn(gesture, wish.fixed, frames, rng)
        if action in WEIGHS:
            joints = with_weight(joints, random.Random(f"{gesture.seconds} weight"))  # noqa: S311
        side = wish.side if gesture.side in (LEFT, RIGHT) else ""
        if is_shown(Motion(joints, FPS), action, side):
            return gesture, joints
    return None


def _asked_for(
    action: str, wish: FineWish, rng: random.Random, frames: int | None, lasts: int | None = None
) -> Iterator[Gesture]:
    """Yield movements of which the prompt says nothing that is not true, and that have room: those whose form is as it
    says first.

    Args:
        action, wish, rng, frames: as in `_one`.
        lasts: frames that the prompt has the movement last; it is done as often as there is room.
    """
    again = AGAIN.get(action) if lasts is not None and wish.count is None else None
    text = wish.prompt.lower()
    brief, seconds = any(wish.beside) and not wish.fixed, frames / FPS if wish.fixed and frames is not None else None
    beside = " ".join(wish.beside).lower()
    asked = StatedForm(text, wish.count, wish.side, brief, seconds, beside, stated_pace(text))
    found: list[tuple[float, Gesture]] = []
    for number in range(MOST_TRIES):
        if number >= TRIES and any(far < NAMED for far, _ in found):
            break
        gesture = _draw(action, rng, wish.count) if again is None else _lasting(again, rng, (lasts or 0) / FPS)
        if _may_be(gesture, text, wish.side, frames if wish.fixed else None):
            found.append((misfit(gesture, action, asked), gesture))
    yield from (gesture for _, gesture in sorted(found, key=lambda each: each[0]))


def _lasting(draw: Counted, rng: random.Random, seconds: float) -> Gesture:
    """Draw a movement by chance, as often as there is room in so many seconds at its own pace."""
    begun, found = rng.getstate(), list[float]()
    for times in SOME:
        found.append(draw(rng, times=times).seconds)
        rng.setstate(begun)
    each = (found[1] - found[0]) / (SOME[1] - SOME[0])
    return draw(rng, times=min(max(SOME[0] + int((seconds - found[0]) / each), 1), MOST_LASTING))


def _draw(action: str, rng: random.Random, count: int | None) -> Gesture:
    """Draw a movement by chance, as often as is asked for where it can be."""
    if count is not None and count <= MOST and action in COUNTED:
        return COUNTED[action](rng, times=count)
    return DRAWINGS[action](rng)


def _may_be(gesture: Gesture, text: str, side: str, frames: int | None) -> bool:
    other_side = side and gesture.side in (LEFT, RIGHT) and gesture.side != side
    too_long = frames is not None and not gesture.fills and QUICKER * SHORTER * gesture.seconds * FPS > frames
    untrue = gesture.untrue and re.search(gesture.untrue, text)
    return not (gesture.base or other_side or too_long or untrue)


def _drawn(gesture: Gesture, fixed: bool, frames: int | None, rng: random.Random) -> Array:
    own = max(round(gesture.seconds * FPS), SHORTEST)
    if frames is not None and (gesture.fills or SHORTER * own <= frames):
        own = frames
    elif frames is not None and fixed:
        own = min(own, round(frames / QUICKER))  # `drawn_whole` hurries it
    body = StandingBody(standing_still(own, rng))
    gesture.change(body)
    return body.solved()
