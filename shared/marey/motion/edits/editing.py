"""`marey.motion.edit`: operations applied to a motion in their order."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol

from marey.core.errors import InvalidInput
from marey.core.package import own_version
from marey.motion.clip import QUALITY, SELECTION, MotionClip, load_npz
from marey.motion.edits.licences import strictest
from marey.motion.edits.operation import MOST_FRAMES
from marey.motion.edits.place import at_origin
from marey.motion.edits.steps import Step, pieces_of, read_steps
from marey.motion.edits.timeline_rows import CYCLE, TIMELINE, has_rows

EDITED_FROM = "edited_from"
OUTDATED = (QUALITY, SELECTION, "travel", "travel_per_second", "constraints")
"""Keys of a manifest that describe the frames of the source."""


@dataclass(frozen=True, eq=False)
class EditSource:
    """A motion to edit, as its file.

    Attributes:
        clip: the motion.
        name: of its file, or the id of a stored motion; empty if it has neither.
        sha256: of its file; by default of the npz file that the clip would be.
    """

    clip: MotionClip
    name: str = ""
    sha256: str = field(default="")

    @cached_property
    def record(self) -> dict[str, Any]:
        """Return its entry in the manifest of the result; edits of edits are nested."""
        manifest = self.clip.manifest
        digest = self.sha256 or hashlib.sha256(self.clip.to_npz()).hexdigest()
        kept = {name: manifest[name] for name in ("bundle", "seed", "licence", EDITED_FROM) if name in manifest}
        return {**({"name": self.name} if self.name else {}), "sha256": digest, **kept}


Load = Callable[[str], "MotionClip | EditSource"]


class FrameModel(Protocol):
    """A model that generates frames for operations (`marey.generation.shots.editor.EditModel`)."""

    @property
    def licence(self) -> str:
        """Terms of its weights."""
        ...

    def record(self) -> Mapping[str, Any]:
        """Return what decided the frames of the last operation, for the manifest."""
        ...


def edit(
    clip: MotionClip | EditSource,
    ops: Sequence[Mapping[str, Any]],
    *,
    load: Load = load_npz,
    model: FrameModel | None = None,
) -> tuple[MotionClip, ...]:
    """Apply operations in their order; the clip itself does not change.

    Results are kinematic: they have no features. In frame 0 they face +Z at the origin; where they were in the source
    stands in the manifest as `placement`, metres and radians. `edited_from` names the sources by their SHA-256, the
    operations and the version of Marey, and `licence` is that of the strictest source.

    Args:
        clip: metres, Y up.
        ops: operations as in JSON, such as `[{"op": "trim", "from": 0.5}, {"op": "loop"}]`; see
            `docs/reference/edits.md`.
        load: reads the motion that `with` of an operation names, an npz file by default; a clip may stand there too.
        model: generates the frames of `extend`, `in-between`, `repaint` and `body-part`; see
            `marey.generate.LocalModel.edit`.

    Returns:
        One motion, or two for each `split`.

    Raises:
        InvalidInput: an unknown operation or parameter, a moment outside the motion, skeletons that differ, a motion
            that cannot become a loop, licences that exclude each other, or an operation that needs a model.
        NotFound, InvalidFile: from reading another motion.
    """
    source = clip if isinstance(clip, EditSource) else EditSource(clip)
    return edit_steps(source, read_steps(ops), load=load, model=model)


def edit_steps(
    source: EditSource, given: Sequence[Step], *, load: Load, model: FrameModel | None = None
) -> tuple[MotionClip, ...]:
    """Apply operations that have been read; otherwise as `edit`."""
    loaded: dict[int, EditSource] = {}

    def other(step: Step) -> EditSource:
        key = id(step.values["with"])
        if key not in loaded:
            loaded[key] = _loaded(step.values["with"], load)
        return loaded[key]

    return tuple(_apply(source, steps, other, model) for steps in pieces_of(given))


def _loaded(named: Any, load: Load) -> EditSource:
    found = named if isinstance(named, MotionClip | EditSource) else load(named)
    if isinstance(found, EditSource):
        return found
    return EditSource(found, name=named if isinstance(named, str) else "")


def _apply(
    source: EditSource, steps: Sequence[Step], other: Callable[[Step], EditSource], model: FrameModel | None
) -> MotionClip:
    """Return the result of operations without a split."""
    manifest = {name: value for name, value in source.clip.manifest.items() if name not in OUTDATED}
    if not has_rows(manifest):
        manifest.pop(TIMELINE, None)
    clip = at_origin(replace(source.clip, manifest=manifest))
    sources, done = [source], list[dict[str, Any]]()
    for step in steps:
        values, record = dict(step.values), step.as_json()
        if "with" in values:
            joined = other(step)
            values["with"] = joined.clip
            record["with"] = joined.record["sha256"]
            sources.append(joined)
        clip = _run(step, clip, values, model)
        done.append({**record, "model": dict(model.record())} if step.operation.needs_model and model else record)
    terms = [model.licence] if model is not None and any(step.operation.needs_model for step in steps) else []
    clip = replace(clip, manifest={**clip.manifest, **_provenance(sources, done, terms)})
    return MotionClip.of(
        clip.skeleton, clip.rotations, clip.root, clip.contacts, clip.fps, manifest=clip.manifest
    )  # without features


def _run(step: Step, clip: MotionClip, values: Mapping[str, Any], model: FrameModel | None) -> MotionClip:
    if step.operation.needs_model and model is None:
        raise InvalidInput(
            f"{step.operation.name} generates frames, and no model is given", where=step.where, argument="model"
        )
    if not step.operation.keeps_rows:
        clip = replace(clip, manifest={name: value for name, value in clip.manifest.items() if name != TIMELINE})
    if not step.operation.keeps_cycle:
        clip = replace(clip, manifest={name: value for name, value in clip.manifest.items() if name != CYCLE})
    try:
        given = (clip, values, model) if step.operation.needs_model else (clip, values)
        made = step.operation.function()(*given)
        result = made if step.operation.keeps_place else at_origin(made)
    except InvalidInput as error:
        raise type(error)(error.message, where=step.named, hint=error.hint) from None
    if result.frames > MOST_FRAMES:
        raise InvalidInput(f"the result has {result.frames} frames; the most is {MOST_FRAMES}", where=step.where)
    return result


def _provenance(
    sources: Sequence[EditSource], done: Sequence[Mapping[str, Any]], terms: Sequence[str]
) -> dict[str, Any]:
    licence = strictest([*(each.clip.manifest.get("licence") for each in sources), *terms])
    unique = {each.record["sha256"]: each.record for each in sources}
    record = {"sources": [*unique.values()], "ops": [*done], "software": {"marey": own_version()}}
    return {EDITED_FROM: record, **({} if licence is None else {"licence": licence})}
