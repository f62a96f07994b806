"""Motions on the side that their prompt names.

A network often does the right thing with the wrong hand: its training motions are mirrored, so both sides are as likely
to it. The mirror image of such a motion is as good as the motion, and shows what was asked for.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.generation.port import GenerationControl, Generator, MotionFeatures, Request, S
from marey.motion.features import FeatureLayout
from marey.quality.record import SHOWN
from marey.selector.matching import Step, wanted_of
from marey.selector.records import match_joints


@dataclass(frozen=True, eq=False)
class MirroredMotion:
    """Features (T, D) of a motion with left and right exchanged, in the layout's own units."""

    features: NDArray[np.float32] = field(repr=False)


def generate_sided(
    generator: Generator[S],
    requests: Sequence[Request],
    settings: S | None = None,
    *,
    control: GenerationControl | None = None,
) -> list[MotionFeatures | None]:
    """Generate one motion per request, as `Generator.generate`; mirrored where only the mirror image shows the side
    that the prompt names.

    Raises:
        InvalidInput: as `Limits.check`.
    """
    made = generator.generate(requests, settings, control=control)
    return [
        None if motion is None else on_side(generator, request, motion)
        for request, motion in zip(requests, made, strict=True)
    ]


def on_side(generator: Generator[S], request: Request, motion: MotionFeatures) -> MotionFeatures:
    """Return the motion, or its mirror image where that matches the prompt and the motion does not.

    Frames that the model did not generate freely stay as they are: those of streams, and of motions around kept frames.
    """
    if request.kept or request.free or request.recording is not None:
        return motion
    steps = wanted_of(request.text.actions or (request.text.rewritten,))
    if steps is None or not _names_side(steps):
        return motion
    layout = generator.layout
    joints = layout.decode(motion.features)
    as_made = _match(joints, layout, steps)
    if as_made is None or as_made >= SHOWN:
        return motion
    mirrored = _match(layout.mirror_joints(joints), layout, steps)
    if mirrored is None or mirrored <= as_made:
        return motion
    return MirroredMotion(layout.mirror(motion.features))


def _names_side(steps: Sequence[Step]) -> bool:
    return any(wanted.side in ("left", "right") for step in steps for wanted in step)


def _match(joints: NDArray[np.floating], layout: FeatureLayout, steps: Sequence[Step]) -> float | None:
    return match_joints(joints, layout.skeleton, layout.fps, steps)
