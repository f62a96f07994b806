"""The model of an edit: a loaded generator, the texts of prompts, and clips for gaps."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from marey.core.errors import InvalidInput
from marey.generation.gazing import with_gaze
from marey.generation.port import GenerationControl, Generator, KeepingGenerator
from marey.generation.shots.asked_frames import (
    CANCELLED,
    SHORTEST_S,
    AskedFrames,
    asks_more,
    frames_alone,
    frames_between,
)
from marey.generation.shots.context import Float32, check_error, context_error, frames_at, model_features
from marey.generation.shots.windows import CONTEXT, FrameGap, Window, crossfaded, fill, most_frames, no_text
from marey.generation.software import origin_of
from marey.items.values import MAX_SEED
from marey.motion.body import NamedBody, travel_scale
from marey.motion.clip import MotionClip
from marey.motion.edits.cuts import part
from marey.motion.finish import finish_motion
from marey.text.features import TextFeatures

PROMPTED_CONTEXT = 4
"""Frames that the model reads on a side where it also reads a prompt; with more it follows the prompt less
(docs/decisions/0037-edits-by-a-model.md)."""


@dataclass(frozen=True, eq=False)
class NewFrames:
    """New frames of a motion.

    Attributes:
        clip: on the body of the kept ones, at a place of its own; between others with one of each.
        changes: what was changed and drawn, and the bearings, as manifests of motions have them.
        before, after: metres by which the motion before and that after are higher than they were.
    """

    clip: MotionClip
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    before: float = 0.0
    after: float = 0.0


@dataclass
class EditModel:
    """A generator that fills gaps of clips.

    Attributes:
        generator: loaded.
        settings: of sampling.
        read: returns the features of a prompt.
        control: of the running batch.
    """

    generator: KeepingGenerator[Any]
    settings: Any
    read: Callable[[str], TextFeatures]
    control: GenerationControl | None = None
    errors: list[float] = field(default_factory=list[float])
    """Millimetres: `context_error` beside each gap since the last record."""
    changes: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Of the new frames that were taken since the last record."""

    @classmethod
    def of(
        cls,
        generator: Generator[Any],
        settings: Mapping[str, Any],
        read: Callable[[str], TextFeatures],
        *,
        control: GenerationControl | None = None,
    ) -> EditModel:
        """Use a loaded generator for edits.

        Raises:
            InvalidInput: it cannot generate frames around others, or an unknown setting.
        """
        if not generator.limits.keeps:
            raise InvalidInput(
                f"{generator.bundle.manifest.name!r} cannot generate frames around others",
                where="model",
                hint="Use a bundle of the default model.",
            )
        return cls(cast("KeepingGenerator[Any]", generator), generator.settings(settings), read, control)

    @property
    def licence(self) -> str:
        """Terms of the weights."""
        return self.generator.bundle.manifest.licence

    def record(self) -> dict[str, Any]:
        """Return what decided the frames since the last record, for the manifest."""
        error, self.errors = max(self.errors, default=0.0), []
        changes, self.changes = self.changes, {}
        return {**origin_of(self.generator, self.settings), "context_error_mm": round(error, 1), **changes}

    def generate(self, prompt: str, seed: int, frames: int, fps: float, body: MotionClip) -> NewFrames:
        """Generate a motion of a prompt alone, on the body of a clip: `frames` frames at `fps`."""
        rate = self.generator.layout.fps
        count = max(math.ceil((frames - 1) / fps * rate) + 1, 2)
        made = frames_alone(self.generator, self.read(prompt), seed, count, self.settings, control=self.control)
        clip = self._clip(made.features, fps, body)
        gazing = with_gaze(replace(clip, manifest={**made.changes, "seed": seed}))
        return NewFrames(part(gazing, 0, frames - 1), made.changes)

    def between(
        self,
        before: MotionClip | None,
        frames: int,
        after: MotionClip | None,
        prompt: str | None,
        seed: int,
        *,
        force: bool = False,
        stay: bool = False,
    ) -> NewFrames:
        """Generate the frames between two clips of one rate, with the last frame before and the first after them.

        Args:
            before: None = the motion begins with the new frames.
            frames: new ones, at the rate of the clips.
            after: None = the motion ends with the new frames.
            prompt: None = the clips alone decide.
            seed: of the new frames.
            force: generate them although the model's tokens cannot show those beside them.
            stay: the clip after keeps its place and height.

        Raises:
            InvalidInput: another skeleton than the model's, or frames that its tokens cannot show.
        """
        body = before or after
        assert body is not None
        layout = self.generator.layout
        rate, fps = layout.fps, body.fps
        first, last = self._beside(before, 2), self._beside(after, 2 * self.generator.limits.keeps)
        # From the last frame of the model's rate to the last one of the clip.
        lead = (before.frames - 1) / fps - (len(first) - 1) / rate if before is not None and len(first) else 0.0
        wanted = frames - 1 + (before is not None) + (after is not None)
        gap = (lead + wanted / fps) * rate
        count = max(1, round(gap) - (len(first) > 0)) if len(last) else math.ceil(gap) + 1
        self._check(first[-CONTEXT:], last[:CONTEXT], force=force)
        before_gap, made = self._filled(first, count, last, prompt, seed, stay=stay)
        clip = self._clip(made.features, fps, body)
        start = round(((before_gap - 1) / rate + lead) * fps) if len(first) else 0
        scale = travel_scale(layout.skeleton, body.skeleton)
        return NewFrames(part(clip, start, start + wanted), made.changes, scale * made.before, scale * made.after)

    def _beside(self, clip: MotionClip | None, least: int) -> Float32:
        """Return the features of a clip beside a gap; none of fewer frames than `least`, which have no tokens."""
        layout = self.generator.layout
        found = np.zeros((0, layout.dim), np.float32)
        if clip is not None and frames_at(clip, layout.fps) >= least:
            found = model_features(clip, layout)
        return found

    def _check(self, *beside: Float32, force: bool) -> None:
        tokenizer, layout = self.generator.tokenizer, self.generator.layout
        self.errors += [context_error(each, tokenizer, layout) for each in beside if len(each)]
        if not force:
            check_error(max(self.errors, default=0.0))

    def _filled(
        self, before: Float32, frames: int, after: Float32, prompt: str | None, seed: int, *, stay: bool
    ) -> tuple[int, AskedFrames]:
        """Fill a gap, with up to `CONTEXT` frames beside it; return their number before it, and all of these frames."""
        before, after = before[max(0, len(before) - CONTEXT) :], after[:CONTEXT]
        text = None if prompt is None else self.read(prompt)
        has_room = frames >= SHORTEST_S * self.generator.limits.fps
        if text is not None and has_room and asks_more(self.generator, text, self.settings):
            beside = (before, frames, after)
            return len(before), frames_between(
                self.generator, *beside, text, seed, self.settings, stay=stay, control=self.control
            )
        whole = np.concatenate([before, np.zeros((frames, before.shape[1]), np.float32), after])
        made = self._continued(whole, len(before), len(before) + frames, prompt, seed)
        return len(before), AskedFrames(made, {})

    def _continued(self, whole: Float32, start: int, end: int, prompt: str | None, seed: int) -> Float32:
        """Generate the frames from `start` to `end`, in several windows if there are many."""
        limits = self.generator.limits
        text = no_text(limits.text_width) if prompt is None else self.read(prompt)
        context = CONTEXT if prompt is None else PROMPTED_CONTEXT
        while (left := end - start) > 0:
            most = most_frames(limits, (start > 0) + (end < len(whole)))
            count = left if left <= most else min(left - limits.keeps, most_frames(limits, int(start > 0)))
            after = whole[end:] if count == left else whole[:0]
            window = self._window(
                FrameGap(whole[:start], count, after, text, seed, free=prompt is None, context=context)
            )
            # A window may end with frames that the others have no place for.
            window = replace(window, features=window.features[: len(whole) - start + window.first])
            whole = crossfaded(whole, window, start - window.first)
            start, seed = start + count, (seed + 1) % (MAX_SEED + 1)
        return whole

    def _window(self, gap: FrameGap) -> Window:
        (window,) = fill(self.generator, [gap], self.settings, control=self.control)
        if window is None:
            raise InvalidInput(CANCELLED)
        return window

    def _clip(self, features: Float32, fps: float, body: MotionClip) -> MotionClip:
        return finish_motion(features, self.generator.layout, body=NamedBody("", body.skeleton), fps=fps)
