"""Windows: frames that a model generates between others, in its own features and at its own rate.

The frames beside a gap are its context: they are encoded as tokens and kept while the tokens of the gap are decoded, as
in MoMask's and MMM's temporal inpainting (Guo et al. 2024, Sec. 4.4; Pinyoanuntapong et al. 2024, Sec. 3.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.generation.port import GenerationControl, Generator, KeptFrames, Limits, Request, S
from marey.text.features import TextFeatures
from marey.text.graph import Node, SemanticGraph

Float32 = NDArray[np.float32]

CONTEXT = 60
"""Most frames of context on a side, at the model's rate."""
LEAST_CONTEXT = 8
"""Frames of context on a side that a gap leaves at least, where there are as many."""
CROSSFADE = 8
"""Frames of context in which the frames beside a gap pass into what the model made of them."""


NOTHING = "a person moves"


def no_text(width: int) -> TextFeatures:
    """Return features (1, `width`) of no prompt, for requests that do not read their text."""
    graph = SemanticGraph(NOTHING, tuple(NOTHING.split()), (Node(0, "motion", NOTHING, (0, 1, 2)),), ())
    return TextFeatures(NOTHING, NOTHING, graph, np.zeros((1, width), np.float16))


@dataclass(frozen=True, eq=False)
class FrameGap:
    """Frames to generate between others.

    Attributes:
        before: (a, D) features of the frames before; (0, D) = none.
        frames: number of frames to generate.
        after: (b, D) features of the frames after; (0, D) = none.
        text: of the prompt.
        seed: of the new frames.
        free: the prompt is not read; the frames beside the gap alone decide.
        context: most frames that the model reads on a side. Beside much context it goes on as before, whatever the
            prompt says.
    """

    before: Float32 = field(repr=False)
    frames: int
    after: Float32 = field(repr=False)
    text: TextFeatures = field(repr=False)
    seed: int
    free: bool = False
    context: int = CONTEXT


@dataclass(frozen=True, eq=False)
class Window:
    """A gap with its context, as the model decoded both.

    Attributes:
        features: (n, D): context before, new frames, context after.
        first: index of the first new frame.
        end: index behind the last new frame.
    """

    features: Float32 = field(repr=False)
    first: int
    end: int

    @property
    def new(self) -> Float32:
        """(frames, D) the new frames alone."""
        return self.features[self.first : self.end]


def most_frames(limits: Limits, sides: int) -> int:
    """Return the longest gap of one window with context on one or two sides."""
    return limits.max_frames - sides * _on_grid(LEAST_CONTEXT, limits.keeps or 1, up=True)


def fill(
    generator: Generator[S],
    gaps: Sequence[FrameGap],
    settings: S | None = None,
    *,
    control: GenerationControl | None = None,
) -> list[Window | None]:
    """Generate the frames of gaps, together; None where `control` dropped one.

    The frames of a gap depend on its own context, text and seed alone.

    Raises:
        InvalidInput: the model keeps no frames, or a gap is too long for one window (`most_frames`).
    """
    plans = [_plan(gap, generator.limits) for gap in gaps]
    made = generator.generate([request for request, _ in plans], settings, control=control)
    return [
        None if motion is None else Window(motion.features, first, first + gap.frames)
        for gap, (_, first), motion in zip(gaps, plans, made, strict=True)
    ]


def crossfaded(frames: Float32, window: Window, start: int) -> Float32:
    """Return features (T, D) with a window written into them.

    Between the new frames and the others, the features pass from one to the other within `CROSSFADE` frames of the
    context.

    Args:
        frames: (T, D), the place of the gap included.
        window: the gap's.
        start: frame at which the window begins.
    """
    count, before, after = len(window.features), window.first, len(window.features) - window.end
    weight = np.ones(count)
    weight[:before], weight[window.end :] = 0.0, 0.0
    left, right = min(CROSSFADE, before), min(CROSSFADE, after)
    weight[before - left : before] = np.arange(1, left + 1) / (left + 1)
    weight[window.end : window.end + right] = 1 - np.arange(1, right + 1) / (right + 1)
    mixed = frames.copy()
    place = slice(start, start + count)
    mixed[place] = (1 - weight)[:, None] * frames[place] + weight[:, None] * window.features
    return mixed


def _plan(gap: FrameGap, limits: Limits) -> tuple[Request, int]:
    """Return the request of a gap, and the frames of context before it."""
    grid = limits.keeps
    if not grid:
        raise InvalidInput("this model cannot generate frames around others", where="model")
    sides = (len(gap.before) > 0) + (len(gap.after) > 0)
    if not 0 < gap.frames <= most_frames(limits, sides):
        seconds = most_frames(limits, sides) / limits.fps
        raise InvalidInput(
            f"{gap.frames / limits.fps:g} s cannot be generated at once; at most {seconds:g} s", where="seconds"
        )
    room = (limits.max_frames - gap.frames) // max(sides, 1)
    before = _on_grid(min(len(gap.before), gap.context, room), grid)
    skipped = -(before + gap.frames) % grid if len(gap.after) else 0  # context begins at a token
    after = gap.after[skipped : skipped + max(0, min(gap.context, limits.max_frames - before - gap.frames - skipped))]
    after = after[: _on_grid(len(after), grid)]
    end = before + gap.frames + (skipped if len(after) else 0)
    total = max(end + len(after), limits.min_frames)
    kept = [KeptFrames(0, gap.before[len(gap.before) - before :])] if before else []
    kept += [KeptFrames(end, after)] if len(after) else []
    return Request(gap.text, gap.seed, total, kept=tuple(kept), free=gap.free), before


def _on_grid(frames: int, grid: int, *, up: bool = False) -> int:
    return (-(-frames // grid) if up else frames // grid) * grid
