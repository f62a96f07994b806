"""Movements so small or so short that a tokenizer's codes lose them, drawn on the motion that a network made: nods,
trembling, waves, punches, dodges, balls.

The network gives the body that nods or shivers, where its arms are and how it stands; of the movement itself no code
keeps 8 degrees of the head, nor 4 mm at 4 Hz (`models/hgm3-open/README.md`, "Tokenizer"). They are drawn as those of
the made clips of the training data are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from marey.generation.ball_games import dribbled, kicked_ball, kicks_well, thrown
from marey.generation.dodging import dodged, dodges_well
from marey.generation.fine_wish import FineWish
from marey.generation.striking import punched
from marey.generation.waving import waved, waves_well
from marey.generation.whole_body import CHOICES, goes_out_of_a_run, whole_body
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth, smoothstep
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, from_rotvec, length, normalize, rotate
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import LEVEL

Float32 = NDArray[np.float32]
Draw = Callable[[Array, float, FineWish, np.random.Generator], Array | None]
"""`(joints, fps, wish, generator)` to joints (T, 22, 3), metres; None if the movement has no place in them."""

NOD_DEGREES, NOD_HZ = (11.0, 17.0), (1.3, 1.7)
NODS, PAUSE_S = (3, 5), (0.6, 1.2)
"""Nods in a row, and seconds between two rows, where no number is asked for."""
HELD_S = 0.8
"""Standard deviation of the filter that leaves out the nods that a head makes already, seconds."""
GOES, GOES_S = 1.2, 0.4
"""Metres a second that a body which leaps out of a run always goes, and seconds in which that is measured."""
EDGE_S = 0.3
"""Seconds at both ends in which nothing is drawn."""
SHAKE_HZ = (4.3, 5.2)
SHAKES: Mapping[str, float] = {
    **dict.fromkeys(("L_wrist", "R_wrist"), 0.013),
    **dict.fromkeys(("L_elbow", "R_elbow", "head"), 0.007),
    **dict.fromkeys(("L_shoulder", "R_shoulder", "L_knee", "R_knee", "neck"), 0.005),
    **dict.fromkeys(("L_collar", "R_collar", "spine3", "spine2"), 0.003),
}
"""Metres by which joints tremble."""


def drawn_features(features: Float32, layout: FeatureLayout, action: str, wish: FineWish, seed: int) -> Float32 | None:
    """Return features (T, D) with the small movement of an action of `FINE`; None if the motion has no place for it.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        action: id in the vocabulary.
        wish: what the prompt asks for.
        seed: of the motion; decides rates and sizes.
    """
    joints = layout.decode(features).astype(np.float64)
    if len(joints) < 2 * (2 * EDGE_S) * layout.fps:
        return None
    drawn = FINE[action].draw(joints, layout.fps, wish, np.random.default_rng([seed, len(action)]))
    return None if drawn is None else encode_all(layout, drawn)


def nodded(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array:
    """Return joints whose head tips down and up, in rows of a few nods or as often as is asked for."""
    frames, rate, count = len(joints), rng.uniform(*NOD_HZ), wish.count
    down, at = np.zeros(frames), EDGE_S * fps
    left, row = count if count is not None else frames, int(rng.integers(*NODS, endpoint=True))
    period = fps / rate
    if count is not None:
        period = min(period, (frames - 2 * at) / count)
        at = max(at, (frames - count * period) / 2 - rng.uniform(0.0, 0.2) * frames)
    time = np.arange(frames)
    while left and at + period <= frames - EDGE_S * fps + 1e-6:
        inside = (time >= at) & (time <= at + period)
        degrees = rng.uniform(*NOD_DEGREES)
        down[inside] = degrees * (0.5 - 0.5 * np.cos(2 * np.pi * (time[inside] - at) / period))
        at, left, row = at + period, left - 1, row - 1
        if not row and count is None:
            at, row = at + rng.uniform(*PAUSE_S) * fps, int(rng.integers(*NODS, endpoint=True))
    neck, head = HUMANML3D.index("neck"), HUMANML3D.index("head")
    forward = smooth(facing(joints, HUMANML3D), 0.2 * fps)
    left_of = np.stack([forward[:, 2], np.zeros(frames), -forward[:, 0]], axis=1)
    moved = joints.copy()
    turn = from_rotvec(np.radians(down)[:, None] * left_of)
    bone = joints[:, head] - joints[:, neck]
    held = normalize(smooth(bone, HELD_S * fps))  # nods of the network's own would count, too
    moved[:, head] = joints[:, neck] + rotate(turn, length(bone)[:, None] * held)
    return moved


def trembling(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array:
    """Return joints that tremble, the hands most; the feet stand."""
    del wish  # trembling has no number
    time = np.arange(len(joints)) / fps
    edge = np.minimum(time, time[-1] - time) / EDGE_S
    strength, rate = smoothstep(np.clip(edge, 0.0, 1.0)), rng.uniform(*SHAKE_HZ)
    moved = joints.copy()
    for name, size in SHAKES.items():
        phases = rng.uniform(0, 2 * np.pi, 3)
        unsteady = 0.35 * np.sin(2 * np.pi * 0.8 * time + phases[2])
        shake = np.sin(2 * np.pi * rate * time[:, None] + phases + unsteady[:, None])
        way = rng.normal(size=3)
        moved[:, HUMANML3D.index(name)] += size * strength[:, None] * shake[:, :1] * way / np.linalg.norm(way)
    return moved


def never(joints: Array, fps: float, wish: FineWish) -> bool:
    """Return False: what a network makes of it is never as good."""
    del joints, fps, wish
    return False


def _goes_well(action: str, joints: Array, fps: float, wish: FineWish) -> bool:
    """Return True if what a network makes of a movement of the whole body stays where it shows the action: one that
    keeps the speed of the run before it."""
    if not goes_out_of_a_run(action, wish):
        return False
    frames = round(GOES_S * fps)
    way = np.linalg.norm((joints[frames:, 0] - joints[:-frames, 0]) * LEVEL, axis=-1) * fps / frames
    return bool(way.min(initial=np.inf) > GOES)


class Fine(NamedTuple):
    """A small movement.

    Attributes:
        draw: draws it.
        is_well: `(joints, fps, wish)`; False if it is to be drawn in a motion that shows its action, too.
        sided: it is drawn on the side that the prompt names.
    """

    draw: Draw
    is_well: Callable[[Array, float, FineWish], bool] = lambda joints, fps, wish: True
    sided: bool = False


FINE: Mapping[str, Fine] = {
    "nod": Fine(nodded),
    "shiver": Fine(trembling),
    "wave": Fine(waved, waves_well),
    "punch": Fine(punched, never, sided=True),
    "dribble": Fine(dribbled, never, sided=True),
    "dodge": Fine(dodged, dodges_well, sided=True),
    "kick-ball": Fine(kicked_ball, kicks_well, sided=True),
    "throw": Fine(thrown, sided=True),
    **{action: Fine(whole_body(action), partial(_goes_well, action)) for action in CHOICES},
}
"""Small and sudden movements by action."""
