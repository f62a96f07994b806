"""Operations whose frames a model generates: `extend`, `in-between`, `repaint`, `body-part`. Kept frames are copied.

`marey.motion.edits.table` declares them. A difference between kept and new frames fades within `BLEND` seconds of the
new ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from marey.core.errors import InvalidInput
from marey.generation.shots.editor import EditModel
from marey.motion.clip import MotionClip
from marey.motion.edits.concat import check_bodies, with_prompts
from marey.motion.edits.cuts import frames_of, part
from marey.motion.edits.joining import bridged
from marey.motion.edits.place import posed, raised
from marey.motion.edits.prompt_frames import prompts_of, resampled
from marey.motion.edits.prompts import joined, with_own
from marey.motion.edits.table import MOST_SEED
from marey.motion.filters import smoothstep
from marey.motion.rotations import Array, slerp
from marey.motion.skeleton import Skeleton
from marey.selector.records import match_of

BLEND = 0.25
"""Seconds of new frames in which a difference to the kept ones fades."""
Candidate: TypeAlias = tuple[MotionClip, Mapping[str, Any]]
"""A result, and what was changed and drawn in its new frames."""


def extend(clip: MotionClip, values: Mapping[str, Any], model: EditModel) -> MotionClip:
    """Generate more of a motion.

    Raises:
        InvalidInput: the motion has no prompt and none is given; and as `EditModel.between`.
    """
    own = values["prompt"]
    known = prompts_of(clip)
    if own is None and not known:
        raise InvalidInput("the motion has no prompt", hint="Give the operation a prompt.")
    prompt = own or known[-1][1]
    frames = max(1, round(values["seconds"] * clip.fps))
    manifest = _with_own("extend", clip, own, [*known, [clip.frames, prompt]])

    def make(seed: int) -> Candidate:
        new = model.between(clip, frames, None, prompt, seed, force=values["force"])
        before = raised(clip, new.before)
        piece, _ = bridged(before, new.clip, None, _blend(clip))
        return _whole(clip, before, piece, None, manifest), new.changes

    return _best(make, values, prompt, clip.frames, clip.frames + frames - 1, model)


def in_between(clip: MotionClip, values: Mapping[str, Any], model: EditModel) -> MotionClip:
    """Generate the way to another motion, which follows.

    Raises:
        InvalidInput: the skeletons differ; and as `EditModel.between`.
    """
    check_bodies(clip, values["with"])
    other = resampled(values["with"], clip.fps)
    frames = max(1, round(values["seconds"] * clip.fps))
    new = model.between(clip, frames, other, values["prompt"], values["seed"], force=values["force"])
    model.changes = new.changes
    before = raised(clip, new.before)
    piece, after = bridged(before, new.clip, raised(other, new.after), _blend(clip))
    own, end = values["prompt"], clip.frames + frames
    known = [*prompts_of(clip), *([[clip.frames, own]] if own else [])]
    manifest = _with_own("in-between", clip, own, known)
    later = [[frame + end, text] for frame, text in prompts_of(other)]
    whole = joined(manifest.get("prompt", ""), other.manifest.get("prompt", ""))
    return _whole(clip, before, piece, after, with_prompts(manifest, whole, [*known, *later]))


def repaint(clip: MotionClip, values: Mapping[str, Any], model: EditModel) -> MotionClip:
    """Generate a range of frames anew.

    Raises:
        InvalidInput: the range is the whole motion, or outside it; and as `EditModel.between`.
    """
    first, last = frames_of(clip, values["from"], values["to"])
    before = part(clip, 0, first - 1) if first else None
    after = part(clip, last + 1, clip.frames - 1) if last < clip.frames - 1 else None
    if before is None and after is None:
        raise InvalidInput("the whole motion would be generated anew", hint="Generate a motion of the prompt instead.")
    own, known = values["prompt"], prompts_of(clip)
    then = [text for frame, text in known if frame <= last + 1][-1:] if after is not None else []
    told = [
        *(each for each in known if each[0] < first),
        *([[first, own]] if own else []),
        *([last + 1, text] for text in then),
        *(each for each in known if each[0] > last + 1),
    ]
    manifest = _with_own("repaint", clip, own, told)

    def make(seed: int) -> Candidate:
        stay = values["rest"] == "stay"
        new = model.between(before, last - first + 1, after, own, seed, force=values["force"], stay=stay)
        here, there = (
            None if each is None else raised(each, up) for each, up in ((before, new.before), (after, new.after))
        )
        piece, rest = bridged(here, new.clip, there, _blend(clip), stay=stay)
        return _whole(clip, here, piece, rest, manifest), new.changes

    return _best(make, values, own, first, last, model)


def body_part(clip: MotionClip, values: Mapping[str, Any], model: EditModel) -> MotionClip:
    """Move a part of the body as a motion of another prompt does; root, legs and all other joints stay as they are.

    The part comes from a motion that is generated alone: tokens of HGM³ and MoMask++ are of the whole body, so no part
    of it can be kept while they generate.

    Raises:
        InvalidInput: the skeleton has no such part, or the range is outside the motion.
    """
    first, last = frames_of(clip, values["from"], values["to"])
    joints = joints_of(clip.skeleton, values["part"])
    weight = _weights(clip, first, last)[:, None]
    rows = slice(first, last + 1)
    manifest = _with_own("body-part", clip, values["prompt"], [])

    def make(seed: int) -> Candidate:
        new = model.generate(values["prompt"], seed, last - first + 1, clip.fps, clip)
        made = new.clip
        rotations = clip.rotations.astype(np.float64)
        rotations[rows, joints] = slerp(rotations[rows, joints], made.rotations[:, joints].astype(np.float64), weight)
        return posed(clip, rotations, clip.root, manifest=manifest), new.changes

    return _best(make, values, values["prompt"], first, last, model)


def _best(
    make: Callable[[int], Candidate],
    values: Mapping[str, Any],
    prompt: str | None,
    first: int,
    last: int,
    model: EditModel,
) -> MotionClip:
    """Return the candidate whose new frames match the prompt best, and let the model record its changes; the first of
    equal ones, and without a prompt."""
    count = values["candidates"] if prompt else 1
    found = [make((values["seed"] + number) % (MOST_SEED + 1)) for number in range(count)]

    def match(candidate: Candidate) -> float:
        return match_of(part(candidate[0], first, last), [str(prompt)]).value or 0.0

    clip, model.changes = found[0] if count == 1 else max(found, key=match)
    return clip


def joints_of(skeleton: Skeleton, name: str) -> list[int]:
    """Return the joints of a part of the body.

    Raises:
        InvalidInput: hips and shoulders of the skeleton are not known.
    """
    if not skeleton.facing:
        raise InvalidInput("the joints of the skeleton are not known", hint="Edit a generated motion.")
    _, _, right, left = skeleton.facing
    arms = {"left-arm": _top_of(skeleton, left, right), "right-arm": _top_of(skeleton, right, left)}
    chest = skeleton.parents[arms["left-arm"]]
    spine = _line(skeleton, chest)
    tops = {
        **{side: [top] for side, top in arms.items()},
        "arms": [*arms.values()],
        "head": [child for child in skeleton.children[chest] if child not in arms.values()],
        "upper-body": spine[1:2],
    }
    wanted = set(tops[name])
    for joint, parent in enumerate(skeleton.parents):
        if parent in wanted:
            wanted.add(joint)
    return sorted(wanted)


def _top_of(skeleton: Skeleton, joint: int, other: int) -> int:
    """Return the first joint of the limb with `joint` that is not on the way to `other`, too."""
    shared = set(_line(skeleton, other))
    return next(each for each in _line(skeleton, joint) if each not in shared)


def _line(skeleton: Skeleton, joint: int) -> list[int]:
    """Return the joints from the root to one."""
    line = [joint]
    while skeleton.parents[line[0]] >= 0:
        line.insert(0, skeleton.parents[line[0]])
    return line


def _blend(clip: MotionClip) -> int:
    return max(1, round(BLEND * clip.fps))


def _weights(clip: MotionClip, first: int, last: int) -> Array:
    """Return the share (n,) of the new frames: it rises and falls within `BLEND` seconds where frames are kept."""
    count, blend = last - first + 1, _blend(clip)
    k = np.arange(count)
    rising = np.minimum(1.0, (k + 1) / (blend + 1)) if first else np.ones(count)
    falling = np.minimum(1.0, (count - k) / (blend + 1)) if last < clip.frames - 1 else np.ones(count)
    return smoothstep(np.minimum(rising, falling))


def _with_own(operation: str, clip: MotionClip, own: str | None, prompts: Sequence[Sequence[Any]]) -> dict[str, Any]:
    """Return the manifest of a clip with the prompt of an operation, if it has one."""
    if own is None:
        return dict(clip.manifest)
    return with_prompts(clip.manifest, with_own(operation, clip.manifest.get("prompt", ""), own), prompts)


def _whole(
    clip: MotionClip,
    before: MotionClip | None,
    piece: MotionClip,
    after: MotionClip | None,
    manifest: Mapping[str, Any],
) -> MotionClip:
    """Return the motion of three parts; the piece repeats the frames beside it."""
    own = part(piece, 1 if before is not None else 0, piece.frames - 1 - (after is not None))
    parts = [each for each in (before, own, after) if each is not None]
    return posed(
        clip,
        np.concatenate([each.rotations.astype(np.float64) for each in parts]),
        np.concatenate([each.root.astype(np.float64) for each in parts]),
        contacts=np.concatenate([each.contacts for each in parts]),
        manifest=dict(manifest),
    )
