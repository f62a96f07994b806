"""Finishing of generated features: the last step of an item, the same in a worker and in `marey generate`."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from marey.generation.asked import changes_of, draws, draws_bearings
from marey.generation.bearing import actions_alone, borne_spans, with_bearing
from marey.generation.bearing_drawing import borne
from marey.generation.gazing import with_gaze
from marey.generation.living import with_life
from marey.generation.loaded import with_load
from marey.generation.named import names_movement
from marey.generation.port import Generator, MotionFeatures, Request, S
from marey.generation.shots.provenance import describe_timeline, least_match, with_rows
from marey.generation.shots.timelines import TimelineMotion
from marey.generation.software import origin_of
from marey.generation.wish import action_of, is_winding
from marey.motion.body import NamedBody, standard_body
from marey.motion.clip import QUALITY, MotionClip
from marey.motion.finish import CLEANED, finish_motion
from marey.quality.clips import quality_of
from marey.quality.limits import expected_by_prompts
from marey.quality.postures import posture_jumps
from marey.quality.record import PromptMatch
from marey.selector.matching import wanted_of
from marey.selector.records import match_of
from marey.selector.unshown import UNSHOWN_MOST, unshown_actions
from marey.vocabulary.loads import puts_load
from marey.vocabulary.scope import match_scope

UNSHOWN = "unshown"
"""Key of a manifest: actions that the words of the prompt name, and that the motion does not show."""


UNREAD = "unread"
"""Key of a manifest: parts of the prompt that ask for a movement, and that were not read."""


def manifest_of(generator: Generator[S], request: Request, settings: S) -> dict[str, Any]:
    """Return the provenance of a motion: everything that decides it, nothing that differs between two equal runs."""
    bundle, recording = generator.bundle, request.recording
    streamed = {} if recording is None else {"stream": recording.stream, "prompts": list(recording.prompts)}
    return {
        **_reading(generator, request),
        **origin_of(generator, settings),
        "model": bundle.manifest.model,
        "random_weights": bundle.manifest.random,
        "seed": request.seed,
        **streamed,
    }


def _reading(generator: Generator[S], request: Request) -> dict[str, Any]:
    """Return the part of the provenance that says what the prompts are and how they were read."""
    text, lists = request.text, generator.bundle.manifest.actions
    if request.timeline is not None:
        return describe_timeline(request, request.timeline, generator.limits, lists)
    return {
        "prompt": text.prompt,
        "rewritten": text.rewritten,
        **({} if text.not_rewritten is None else {"not_rewritten": text.not_rewritten}),
        "graph": text.graph.to_json(),
        **(
            {}
            if lists is None or request.recording
            else {"scope": dict(request.scope or match_scope(text.prompt, lists).as_json())}
        ),
    }


def finish(
    generator: Generator[S],
    request: Request,
    generated: MotionFeatures,
    settings: S,
    *,
    body: NamedBody | None = None,
    fps: float | None = None,
    clean: bool = True,
) -> MotionClip:
    """Finish a clip: decode, solve rotations on the body, resample, clean the feet, measure the quality.

    Args:
        body: skeleton of the clip; None = the standard body of the bundle.
        fps: output rate; None = the model's.
        clean: lock feet in contact.
    """
    body = body or standard_body(generator.layout.skeleton)
    if isinstance(generated, TimelineMotion):
        request = replace(request, timeline=generated.timeline)
    layout, features = generator.layout, generated.features
    spans = borne_spans(request, layout.fps, len(features)) if draws_bearings(generator, request) else []
    provenance = {**manifest_of(generator, request, settings), **changes_of(generated)}
    manifest = with_bearing({**provenance, CLEANED: clean, "body": body.describe()}, spans, layout.fps)
    finished = partial(finish_motion, layout=layout, body=body, fps=fps, clean=clean, manifest=manifest)
    drawn = borne(generated, layout, spans)
    if request.is_sequence and request.timeline is not None and draws_bearings(generator, request):
        drawn = with_load(drawn, layout, request.timeline)
    clip = finished(drawn)
    clip = with_gaze(with_life(clip, request) if draws(generator, request) else clip)
    acts = actions_alone(spans)
    as_made = clip if acts == spans else finished(borne(generated, layout, acts))
    return judged(clip, request, as_made=as_made)


def judged(clip: MotionClip, request: Request, *, as_made: MotionClip | None = None) -> MotionClip:
    """Return a clip with the record of its quality, for the prompts of its request, in its manifest.

    Args:
        clip: the finished motion.
        request: for it.
        as_made: the same without bearings, by which actions are matched: a hand that salutes is no longer idle. None =
            the clip itself.
    """
    as_made = as_made or clip
    if request.timeline is not None:
        clip = with_rows(clip, request.timeline, as_made)
    quality = quality_of(clip, expected_by_prompts(_prompts(request)))
    if quality is None:
        return clip
    match = least_match(clip) if request.timeline is not None else _match(as_made, request)
    if missed := _unshown(clip, request):
        match = PromptMatch(value=min(match.value or 0.0, UNSHOWN_MOST))
        clip = replace(clip, manifest={**clip.manifest, UNSHOWN: list(missed)})
    quality = quality.with_match(match)
    if unread := _unread(request):
        quality = quality.with_part_left_out()
        clip = replace(clip, manifest={**clip.manifest, UNREAD: list(unread)})
    if posture_jumps(clip):
        quality = quality.with_posture_jump()
    return replace(clip, manifest={**clip.manifest, QUALITY: quality.model_dump(mode="json")})


def _prompts(request: Request) -> list[str]:
    """Return what a motion shows in words: its prompts, and as what they are read."""
    if request.timeline is not None:
        rows = [said for row in request.timeline for said in (row.text.prompt, row.text.rewritten)]
        return [request.text.prompt, *rows] if request.is_sequence else rows
    if request.recording is not None:
        return [prompt for _, prompt in request.recording.prompts]
    return [request.text.prompt, request.text.rewritten]


def _unread(request: Request) -> tuple[str, ...]:
    """Return the parts of the prompts of a request that were not read."""
    if request.recording is not None:
        return ()
    rows = () if request.timeline is None or request.is_sequence else request.timeline
    texts = [row.text for row in rows] or [request.text]
    return tuple(dict.fromkeys(part for text in texts for part in text.left_out))


def _unshown(clip: MotionClip, request: Request) -> tuple[str, ...]:
    """Return the actions that the words of a prompt name beside those that are read of it, and that a clip does not
    show."""
    if request.recording is not None or (request.timeline is not None and not request.is_sequence):
        return ()
    texts = [row.text for row in request.timeline or ()] or [request.text]
    steps = [step for text in texts for step in wanted_of(text.actions or (text.rewritten,)) or ()]
    read = {action_of(text) for text in texts} | {each.action for step in steps for each in step}
    return unshown_actions(request.text.said, read - {""}, clip.joints, clip.skeleton, clip.fps)


def _match(clip: MotionClip, request: Request) -> PromptMatch:
    """Match a clip with its prompt, by its words or else by its meaning.

    Recordings of streams, which hold several prompts, have none, nor have movements that are no action.
    """
    if request.recording is not None or names_movement(request.text.said) or puts_load(request.text.said):
        return PromptMatch()
    sentences, winds = request.text.actions or (request.text.rewritten,), is_winding(request.text)
    return match_of(clip, sentences, request.scope, winds=winds)
